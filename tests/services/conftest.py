"""A vehicle endpoint on fake time, and a minimal ground side of the protocols."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from autopilot.services.endpoint import VehicleEndpoint
from autopilot.services.identity import AUTO, AUTO_LOITER, Identity
from autopilot.services.mission_store import StoredMission
from autopilot.services.records import Event, Verdict
from autopilot.services.snapshot import Snapshot
from autopilot.wire.codec import FrameWriter, Received, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, encode_steps
from autopilot.wire.parameter_table import Parameter, ParameterTable
from missions.model import Takeoff, Waypoint

TICK_US = 4000
HOME = Home()
ACCEPT = Verdict(mavlink.MAV_RESULT_ACCEPTED)


def make_table() -> ParameterTable:
    return ParameterTable(
        [
            Parameter("LOAD_MASS", 0.0843, 0.01, 1.0, "kg", "Believed mass of the load"),
            Parameter("MIS_TAKEOFF_ALT", 2.0, 0.1, 50.0, "m", "Height of a take-off"),
            Parameter("SIXTEEN_LETTERS1", 1.0, 0.0, 2.0, "", "A name that fills its field"),
            Parameter("CTRL_RATE_HZ", 250.0, 100.0, 1000.0, "Hz", "Rate", integer=True, fixed=True),
        ]
    )


def waypoints(count: int) -> tuple[WireItem, ...]:
    """A mission of `count` items, no two alike."""
    steps: list[Any] = [Takeoff(2.0)]
    steps += [Waypoint(float(i), -0.5 * i, 1.0 + 0.01 * i, 0.25 * i) for i in range(1, count)]
    return encode_steps(steps, HOME)


def snapshot(now_us: int = 0, **changes: Any) -> Snapshot:
    known: dict[str, Any] = {
        "now_us": now_us,
        "boot_unix_us": 1_767_225_600_000_000,
        "home": HOME,
        "armed": False,
        "phase": mavlink.PLUMBLINE_PHASE_DISARMED,
        "main_mode": AUTO,
        "sub_mode": AUTO_LOITER,
        "landed_state": mavlink.MAV_LANDED_STATE_ON_GROUND,
        "system_status": mavlink.MAV_STATE_STANDBY,
    }
    return Snapshot(**(known | changes))


@dataclass
class Rig:
    """The vehicle, its clock, and ground stations that only write and read frames."""

    endpoint: VehicleEndpoint
    table: ParameterTable
    now_us: int = 0
    verdict: Callable[[Any], Verdict] = lambda request: ACCEPT
    asked: list[Any] = field(default_factory=list)  # requests that the supervisor saw
    events: list[Event] = field(default_factory=list)
    changes: dict[str, Any] = field(default_factory=dict)  # of the snapshot
    writers: dict[tuple[int, int], FrameWriter] = field(default_factory=dict)

    def decide(self, request: Any) -> Verdict:
        self.asked.append(request)
        return self.verdict(request)

    def send(self, *messages: Any, link: str = "gcs", system: int = 255, component: int = 190) -> None:
        """One datagram from a ground station."""
        writer = self.writers.setdefault((system, component), FrameWriter(system, component))
        self.send_bytes(b"".join(writer.frame(message) for message in messages), link)

    def send_bytes(self, datagram: bytes, link: str = "gcs") -> None:
        self.events += self.endpoint.receive(datagram, link, self.now_us, self.decide)

    def poll(self) -> dict[str, list[Received]]:
        """The messages sent at this tick, by link; then the clock advances."""
        out: dict[str, list[Received]] = {}
        made = self.endpoint.poll(lambda: snapshot(self.now_us, **self.changes), self.now_us)
        for link, datagram in made:
            received, junk = decode(datagram)
            assert junk == 0
            out.setdefault(str(link), []).extend(received)
        self.now_us += TICK_US
        return out

    def replies(self, *messages: Any, link: str = "gcs", **origin: int) -> list[Any]:
        """What one link receives in answer to messages, without the streams of the same tick."""
        self.poll()
        self.send(*messages, link=link, **origin)
        streamed = set(STREAMED)
        return [r.message for r in self.poll().get(link, []) if r.message.get_type() not in streamed]

    def run(self, duration_us: int, link: str = "gcs") -> list[Received]:
        """All messages sent on a link during this time."""
        out: list[Received] = []
        for _ in range(duration_us // TICK_US):
            out += self.poll().get(link, [])
        return out


STREAMED = [
    "HEARTBEAT",
    "SYS_STATUS",
    "SYSTEM_TIME",
    "EXTENDED_SYS_STATE",
    "BATTERY_STATUS",
    "GPS_RAW_INT",
    "HOME_POSITION",
    "ATTITUDE",
    "ESTIMATOR_STATUS",
    "ATTITUDE_QUATERNION",
    "LOCAL_POSITION_NED",
    "GLOBAL_POSITION_INT",
    "ALTITUDE",
    "VFR_HUD",
    "POSITION_TARGET_LOCAL_NED",
    "ATTITUDE_TARGET",
    "SERVO_OUTPUT_RAW",
    "DEBUG_VECT",
    "NAMED_VALUE_FLOAT",
    "WINCH_STATUS",
    "LOAD_STATE",
    "LOAD_SETPOINT",
    "CASCADE_ERRORS",
    "ROTOR_STATE",
    "MISSION_CURRENT",
    "FENCE_STATUS",
]


def make_rig(
    mission: tuple[WireItem, ...] = (), identity: Identity | None = None, setup_signing: bool = False
) -> Rig:
    table = make_table()
    stored = StoredMission(mission)
    rig = Rig(
        VehicleEndpoint(identity or Identity(), HOME, table, stored, setup_signing=setup_signing), table
    )
    rig.endpoint.add_link("gcs")
    return rig


@pytest.fixture
def rig() -> Rig:
    """A vehicle without a mission, one configured link `gcs`."""
    return make_rig()


@pytest.fixture
def rig_with() -> Callable[..., Rig]:
    """Make a vehicle that has a mission, or another identity."""
    return make_rig


@pytest.fixture
def items() -> Callable[[int], tuple[WireItem, ...]]:
    return waypoints


@pytest.fixture
def snap() -> Callable[..., Snapshot]:
    return snapshot


@dataclass
class MissionClient:
    """The ground side of a mission transfer: repeats its last message after a silence, never gives up."""

    items: tuple[WireItem, ...] = ()
    result: int | None = None  # of an upload
    done: bool = False
    last: Any = None
    said_us: int = 0
    uploading: bool = False
    wanted: int = -1  # next item of a download; -1: the count
    count: int = 0
    retry_us: int = 300_000

    def upload(self, items: tuple[WireItem, ...], now_us: int) -> list[Any]:
        self.items, self.result, self.done, self.uploading = items, None, False, True
        return self._say(mavlink.MAVLink_mission_count_message(1, 1, len(items)), now_us)

    def download(self, now_us: int) -> list[Any]:
        self.items, self.done, self.uploading, self.wanted = (), False, False, -1
        return self._say(mavlink.MAVLink_mission_request_list_message(1, 1), now_us)

    def poll(self, now_us: int) -> list[Any]:
        if self.done or now_us - self.said_us < self.retry_us:
            return []
        return self._say(self.last, now_us)

    def receive(self, message: Any, now_us: int) -> list[Any]:
        match message.get_type():
            case "MISSION_REQUEST_INT" if not self.done and self.uploading:
                return self._say(item_message(message.seq, self.items[message.seq]), now_us)
            case "MISSION_ACK" if not self.done and self.uploading:
                if message.type == mavlink.MAV_MISSION_OPERATION_CANCELLED:
                    return self.upload(self.items, now_us)
                self.result, self.done = message.type, True
            case "MISSION_COUNT" if not self.uploading and self.wanted == -1:
                self.wanted, self.count = 0, message.count
                return self._ask(now_us)
            case "MISSION_ITEM_INT" if not self.uploading and message.seq == self.wanted:
                self.items += (item_of(message),)
                self.wanted += 1
                return self._ask(now_us)
        return []

    def _ask(self, now_us: int) -> list[Any]:
        if self.wanted < self.count:
            return self._say(mavlink.MAVLink_mission_request_int_message(1, 1, self.wanted), now_us)
        self.done = True
        return [mavlink.MAVLink_mission_ack_message(1, 1, mavlink.MAV_MISSION_ACCEPTED)]

    def _say(self, message: Any, now_us: int) -> list[Any]:
        self.last, self.said_us = message, now_us
        return [message]


def item_message(seq: int, item: WireItem, mission_type: int = 0) -> Any:
    return mavlink.MAVLink_mission_item_int_message(
        target_system=1, target_component=1, seq=seq, mission_type=mission_type, **item._asdict()
    )


def item_of(message: Any) -> WireItem:
    return WireItem(**{name: getattr(message, name) for name in WireItem._fields})


@pytest.fixture
def mission_client() -> MissionClient:
    return MissionClient()


@pytest.fixture
def as_message() -> Callable[..., Any]:
    return item_message


@pytest.fixture
def as_item() -> Callable[[Any], WireItem]:
    return item_of
