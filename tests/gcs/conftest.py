"""A scripted vehicle without sockets or clock, and links that lose, double and delay datagrams."""

from __future__ import annotations

import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import pytest

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from tests.doubles.ports import ground_port

TICK_US = 20_000
PX4_HOLD = 0x03040000


class ScriptedVehicle:
    """A vehicle as the protocols see it. Tests change its attributes; `script` is what it does in flight.

    The mission protocol follows the specification: an item is requested again after `ASK_US`, an item that
    was not requested is ignored, a finished transfer is acknowledged again.
    """

    ASK_US = 250_000
    HEARTBEAT_US = 1_000_000

    def __init__(self) -> None:
        self.writer = FrameWriter(1, 1)
        self.dialect_writer = FrameWriter(1, 25)
        self.load_writer = FrameWriter(2, 35)
        self.now_us = 0
        self.out: list[bytes] = []
        self.parameters = {f"P{index:03d}": float(index) for index in range(120)}
        self.fixed: set[str] = set()
        self.lost_list_indices: set[int] = set()
        self.mission: list[WireItem] = []
        self.refuse_item: int | None = None
        self.autopilot = mavlink.MAV_AUTOPILOT_PX4
        self.command_results: dict[int, list[int]] = {}
        self.commands: list[Any] = []
        self.silent = False
        self.silent_commands: set[int] = set()
        self.ready = True
        self.ready_from_us = 0  # before this time it is not ready, even if `ready`
        self.kept_texts: list[tuple[int, str]] = []  # sent again on request
        self.armed = False
        self.started_us: int | None = None
        self.script: Callable[[ScriptedVehicle, float], None] | None = None
        self.nothing_waits = threading.Event()  # set by `LiveVehicle` when it has taken all that was sent
        self.phase = mavlink.PLUMBLINE_PHASE_DISARMED
        self.custom_mode = PX4_HOLD
        self.item = 0
        self.mission_state = mavlink.MISSION_STATE_NOT_STARTED
        self.areas: dict[int, list[WireItem]] = {}  # fence and rally points by MAV_MISSION_TYPE
        self._upload: list[WireItem] | None = None
        self._kind = 0
        self._upload_count = 0
        self._asked_us = 0
        self._next_heartbeat_us = 0

    def wait_until_all_is_taken(self) -> None:
        """Wait until a live vehicle has taken what was sent to it before this call."""
        for _ in range(2):  # the first may tell of a moment before the call
            self.nothing_waits.clear()
            assert self.nothing_waits.wait(10.0)

    # ---- out

    def send(self, message: Any) -> None:
        self.out.append(self.writer.frame(message))

    def say(self, text: str, severity: int = mavlink.MAV_SEVERITY_WARNING) -> None:
        self.send(mavlink.MAVLink_statustext_message(severity, text.encode()))

    def heartbeat(self) -> None:
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        self.send(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_QUADROTOR, self.autopilot, 29 | armed, self.custom_mode, 3, 3
            )
        )
        self.out.append(
            self.load_writer.frame(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_AIRSHIP, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3
                )
            )
        )

    def tell_load(self, east_m: float, north_m: float, up_m: float, tension_n: float = 0.8) -> None:
        place, rest = (north_m, east_m, -up_m), (0.0, 0.0, 0.0)
        estimated = mavlink.PLUMBLINE_SOURCE_ESTIMATED
        message = mavlink.MAVLink_load_state_message(
            self.now_us, *place, *rest, *rest, *rest, 0.7, tension_n, 0, 1, estimated
        )
        self.out.append(self.dialect_writer.frame(message))

    def arm(self, armed: bool) -> None:
        self.armed = armed
        self.phase = mavlink.PLUMBLINE_PHASE_ARMED if armed else mavlink.PLUMBLINE_PHASE_DISARMED
        self.heartbeat()

    def tick(self, now_us: int) -> list[bytes]:
        """Let time pass; return what the vehicle sends."""
        self.now_us = now_us
        if now_us >= self._next_heartbeat_us:
            self._next_heartbeat_us += self.HEARTBEAT_US
            self.heartbeat()
            present = mavlink.MAV_SYS_STATUS_PREARM_CHECK
            health = present if self.ready and now_us >= self.ready_from_us else 0
            self.send(
                mavlink.MAVLink_sys_status_message(
                    present, present, health, 0, 12600, -1, 90, 0, 0, 0, 0, 0, 0
                )
            )
            self.send(
                mavlink.MAVLink_mission_current_message(
                    self.item, len(self.mission) or 0xFFFF, self.mission_state
                )
            )
        if self._upload is not None and now_us - self._asked_us >= self.ASK_US:
            self._ask()
        if self.started_us is not None and self.script is not None:
            self.script(self, (now_us - self.started_us) * 1e-6)
        if self.started_us is not None:
            self._fast()
        out, self.out = self.out, []
        return [] if self.silent else out

    def _fast(self) -> None:
        zero3 = (0.0, 0.0, 0.0)
        setpoint = mavlink.MAVLink_load_setpoint_message(
            self.now_us, *zero3, *zero3, *zero3, *zero3, 0.0, float("nan"), self.item, self.phase, 3
        )
        errors = mavlink.MAVLink_cascade_errors_message(
            self.now_us, [0.003, 0.004, 0.0], *([list(zero3)] * 5), 0.0, 0.0, 5.0, list(zero3), 3
        )
        rotors = mavlink.MAVLink_rotor_state_message(
            self.now_us, [1.0, 1.2, 1.2, 0.98], 0.0, 1.6, 0, mavlink.PLUMBLINE_SOURCE_ESTIMATED
        )
        for message in (setpoint, errors, rotors):
            self.out.append(self.dialect_writer.frame(message))

    # ---- in

    def receive(self, datagram: bytes) -> None:
        for one in decode(datagram)[0]:
            handler = getattr(self, f"on_{one.message.get_type().lower()}", None)
            if handler is not None and not self.silent:
                handler(one.message)

    def on_command_long(self, message: Any) -> None:
        self.commands.append(message)
        if message.command in self.silent_commands:
            return
        results = self.command_results.get(message.command, [])
        result = results.pop(0) if results else mavlink.MAV_RESULT_ACCEPTED
        if result == mavlink.MAV_RESULT_ACCEPTED:
            if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.arm(message.param1 == 1.0)
            if message.command == mavlink.MAV_CMD_MISSION_START:
                self.started_us = self.now_us
            if message.command == mavlink.MAV_CMD_RUN_PREARM_CHECKS:
                self.say("Not ready to arm: load position not settled")
            if message.command == mavlink.MAV_CMD_REQUEST_MESSAGE and message.param1 == 253:
                for severity, text in self.kept_texts:
                    self.say(text, severity)
            if message.command == mavlink.MAV_CMD_REQUEST_MESSAGE and message.param1 == 49:
                self.send(mavlink.MAVLink_gps_global_origin_message(473977420, 85455940, 0))
            if message.command == mavlink.MAV_CMD_REQUEST_MESSAGE and message.param1 == 242:
                self.send(
                    mavlink.MAVLink_home_position_message(
                        473977420, 85455940, 0, 0, 0, 0, [1.0, 0.0, 0.0, 0.0], 0, 0, 0
                    )
                )
        self.send(mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, 255, 190))

    def on_command_int(self, message: Any) -> None:
        self.commands.append(message)
        self.send(
            mavlink.MAVLink_command_ack_message(message.command, mavlink.MAV_RESULT_ACCEPTED, 0, 0, 255, 190)
        )

    def on_param_request_list(self, message: Any) -> None:
        for index, name in enumerate(self.parameters):
            if index not in self.lost_list_indices:
                self._value(name)

    def on_param_request_read(self, message: Any) -> None:
        names = list(self.parameters)
        if message.param_index >= 0:
            self._value(names[message.param_index])
        elif message.param_id in self.parameters:
            self._value(message.param_id)
        else:
            self._unknown(message.param_id)

    def _unknown(self, name: str) -> None:
        missing = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
        self.send(mavlink.MAVLink_param_error_message(255, 190, name.encode(), -1, missing))

    def on_param_set(self, message: Any) -> None:
        if message.param_id not in self.parameters:
            self._unknown(message.param_id)
            return
        if message.param_id not in self.fixed:
            self.parameters[message.param_id] = message.param_value
        self._value(message.param_id)

    def _value(self, name: str) -> None:
        index = list(self.parameters).index(name)
        self.send(
            mavlink.MAVLink_param_value_message(
                name.encode(), self.parameters[name], 9, len(self.parameters), index
            )
        )

    def _items(self, kind: int) -> list[WireItem]:
        return self.areas.get(kind, []) if kind else self.mission

    def on_mission_count(self, message: Any) -> None:
        self._upload, self._upload_count, self._kind = [], message.count, message.mission_type
        self._asked_us = self.now_us
        self._ask()

    def _ask(self) -> None:
        assert self._upload is not None
        self._asked_us = self.now_us
        if len(self._upload) == self._upload_count:
            if self._kind:
                self.areas[self._kind] = self._upload
            else:
                self.mission = self._upload
            self._upload = None
            self._acknowledge(mavlink.MAV_MISSION_ACCEPTED)
        else:
            seq = len(self._upload)
            self.send(mavlink.MAVLink_mission_request_int_message(255, 190, seq, self._kind))

    def _acknowledge(self, result: int) -> None:
        self.send(mavlink.MAVLink_mission_ack_message(255, 190, result, self._kind))

    def on_mission_item_int(self, message: Any) -> None:
        if self._upload is None:
            if message.seq == len(self._items(self._kind)) - 1:
                self._acknowledge(mavlink.MAV_MISSION_ACCEPTED)
            return
        if message.seq == self.refuse_item:
            self._upload = None
            self._acknowledge(mavlink.MAV_MISSION_UNSUPPORTED)
        elif message.seq == len(self._upload):
            self._upload.append(_item(message))
            self._ask()

    def on_mission_request_list(self, message: Any) -> None:
        kind = message.mission_type
        self.send(mavlink.MAVLink_mission_count_message(255, 190, len(self._items(kind)), kind))

    def on_mission_request_int(self, message: Any) -> None:
        kind = message.mission_type
        item = self._items(kind)[message.seq]
        self.send(mavlink.MAVLink_mission_item_int_message(255, 190, message.seq, *item, mission_type=kind))

    def on_mission_clear_all(self, message: Any) -> None:
        self._kind = 0
        self.mission = []
        self._acknowledge(mavlink.MAV_MISSION_ACCEPTED)


def _item(m: Any) -> WireItem:
    return WireItem(
        m.frame, m.command, m.current, m.autocontinue, m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z
    )


@dataclass
class BadLink:
    """Drops, doubles and delays datagrams, each with `chance`; the delays change their order."""

    rng: random.Random
    chance: float = 0.0
    waiting: list[tuple[int, bytes]] = field(default_factory=list)

    def put(self, datagrams: list[bytes], now_us: int) -> None:
        for datagram in datagrams:
            if self.rng.random() < self.chance:
                continue
            for _ in range(2 if self.rng.random() < self.chance else 1):
                late = self.rng.randrange(1, 8) * TICK_US if self.rng.random() < self.chance else 0
                self.waiting.append((now_us + late, datagram))

    def get(self, now_us: int) -> list[bytes]:
        ready = [datagram for due, datagram in self.waiting if due <= now_us]
        self.waiting = [(due, datagram) for due, datagram in self.waiting if due > now_us]
        return ready


class World:
    """The scripted vehicle, a link to it and one from it, and the clock that it shares with a client."""

    def __init__(self) -> None:
        self.vehicle = ScriptedVehicle()
        rng = random.Random(1)
        self.up = BadLink(rng)
        self.down = BadLink(rng)
        self.now_us = 0

    def lossy(self, chance: float) -> None:
        self.up.chance = self.down.chance = chance

    def ticks(
        self, receive: Callable[[bytes, int], object], poll: Callable[[int], list[bytes]], seconds: float
    ) -> Iterator[int]:
        """Run client and vehicle; yield the time after each tick."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.now_us += TICK_US
            self.down.put(self.vehicle.tick(self.now_us), self.now_us)
            for datagram in self.down.get(self.now_us):
                receive(datagram, self.now_us)
            self.up.put(poll(self.now_us), self.now_us)
            for datagram in self.up.get(self.now_us):
                self.vehicle.receive(datagram)
            yield self.now_us


@pytest.fixture
def new_world() -> type[World]:
    return World


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def items() -> list[WireItem]:
    """A hundred different items; the first is a take-off, the last a landing."""
    rng = random.Random(7)
    middle = [
        WireItem(
            6, 16, 0, 1, float(n), 0.5, float("nan"), 0.25, rng.randrange(-(2**31), 2**31), n * 7919, n / 4
        )
        for n in range(98)
    ]
    takeoff = WireItem(6, 22, 1, 1, 0.0, 0.0, 0.0, float("nan"), 473977420, 85455940, 2.0)
    land = WireItem(6, 21, 0, 1, 0.0, 0.0, 0.0, float("nan"), 473977420, 85455940, 0.0)
    return [takeoff, *middle, land]


class LiveVehicle(threading.Thread):
    """The scripted vehicle on the wall clock behind a socket; it sends first, to `port`."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        self.vehicle = ScriptedVehicle()
        self._ground = ("127.0.0.1", port)
        self._over = threading.Event()

    def run(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.bind(("127.0.0.1", 0))
            link.settimeout(0.005)
            began_ns = time.monotonic_ns()
            while not self._over.is_set():
                with suppress(ConnectionRefusedError):  # the ground station does not listen yet
                    try:
                        self.vehicle.receive(link.recv(65535))
                    except TimeoutError:
                        self.vehicle.nothing_waits.set()
                for datagram in self.vehicle.tick((time.monotonic_ns() - began_ns) // 1000):
                    with suppress(OSError):
                        link.sendto(datagram, self._ground)

    def stop(self) -> None:
        self._over.set()
        self.join(5.0)


@pytest.fixture
def live() -> Iterator[tuple[ScriptedVehicle, str]]:
    """A running vehicle, and the port to which it sends."""
    port = ground_port()
    thread = LiveVehicle(port)
    thread.vehicle.HEARTBEAT_US = 50_000
    thread.start()
    yield thread.vehicle, str(port)
    thread.stop()
