"""The flight machine with a third-party autopilot: a scripted firmware that knows no load, on fake time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.firmware_flight import ARDUPILOT, FirmwareFlight
from gcs.clients.firmware_mission import firmware_items
from missions.model import Land, Takeoff, Waypoint

ITEMS = firmware_items((Takeoff(2.0), Waypoint(5.0, 0.0, 2.0), Land()), Home(), 1.0, 0.13, True)
STEP_US = 20_000
ACCEPTED, FAILED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED
AIR, GROUND = mavlink.MAV_LANDED_STATE_IN_AIR, mavlink.MAV_LANDED_STATE_ON_GROUND
GUIDED, AUTO = 4, 3


class Scripted:
    """Answers like ArduCopter: refuses until it is ready, flies an item per second, disarms on the ground."""

    def __init__(self) -> None:
        self._writer = FrameWriter(1, 1)
        self.now_us = 0
        self.storage_ready_us = 1_000_000
        self.ready_us = 3_000_000
        self.mode, self.armed, self.item = 0, False, 0
        self.count = 0
        self.uploaded: list[Any] = []
        self.began_us: int | None = None
        self.ends_at = len(ITEMS)  # item at which it disarms
        self.silent = False
        self._out: list[bytes] = []

    def say(self, message: Any) -> None:
        self._out.append(self._writer.frame(message))

    def hear(self, datagram: bytes) -> None:
        for one in decode(datagram)[0]:
            self._heard(one.message)

    def _heard(self, m: Any) -> None:
        match m.get_type():
            case "COMMAND_LONG":
                self.say(mavlink.MAVLink_command_ack_message(m.command, self._obeyed(m), 0, 0, 255, 190))
            case "MISSION_COUNT":
                if self.now_us < self.storage_ready_us:
                    self._acknowledge(mavlink.MAV_MISSION_NO_SPACE)
                else:
                    self.count, self.uploaded = m.count, []
                    self.say(mavlink.MAVLink_mission_request_message(255, 190, 0, 0))
            case "MISSION_ITEM_INT":
                self.uploaded.append(m)
                if len(self.uploaded) < self.count:
                    self.say(mavlink.MAVLink_mission_request_message(255, 190, len(self.uploaded), 0))
                else:
                    self._acknowledge(mavlink.MAV_MISSION_ACCEPTED)

    def _acknowledge(self, result: int) -> None:
        self.say(mavlink.MAVLink_mission_ack_message(255, 190, result, 0))

    def _obeyed(self, m: Any) -> int:
        ready = self.now_us >= self.ready_us
        match m.command:
            case mavlink.MAV_CMD_DO_SET_MODE:
                self.mode = int(m.param2)
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                if m.param1 == 1.0 and not (ready and self.mode == GUIDED):
                    self.say(mavlink.MAVLink_statustext_message(2, b"Arm: Need Position Estimate"))
                    return FAILED
                self.armed = m.param1 == 1.0
            case mavlink.MAV_CMD_MISSION_START:
                if not self.armed or m.param1 != 0.0:
                    return FAILED
                self.mode, self.began_us = AUTO, self.now_us
        return ACCEPTED

    def tick(self) -> list[bytes]:
        """What it sends at this time."""
        if self.silent:
            return []
        if self.began_us is not None:
            self.item = 1 + (self.now_us - self.began_us) // 1_000_000
            if self.item >= self.ends_at:
                self.armed, self.item = False, min(self.item, len(ITEMS) - 1)
        if self.now_us % 200_000 == 0:
            base = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
            self.say(mavlink.MAVLink_heartbeat_message(2, 3, base | 1, self.mode, 3, 3))
            bit = mavlink.MAV_SYS_STATUS_PREARM_CHECK
            # it reports to be healthy a second before it accepts to be armed, as ArduCopter may
            health = bit if self.now_us >= self.ready_us - 1_000_000 else 0
            self.say(mavlink.MAVLink_sys_status_message(bit, bit, health, *(0,) * 10))
            self.say(
                mavlink.MAVLink_extended_sys_state_message(0, AIR if self.armed and self.item else GROUND)
            )
            self.say(mavlink.MAVLink_mission_current_message(self.item))
            self.say(mavlink.MAVLink_system_time_message(0, self.now_us // 1000))
        said, self._out = self._out, []
        return said


Script = Callable[[Scripted], None]


def flown(script: Script | None = None, vehicle: Scripted | None = None) -> tuple[FirmwareFlight, Scripted]:
    vehicle = vehicle or Scripted()
    client = FirmwareFlight(ARDUPILOT, ITEMS, expected_s=20.0)
    while client.outcome is None and vehicle.now_us < 400_000_000:
        if script is not None:
            script(vehicle)
        for datagram in vehicle.tick():
            client.receive(datagram, vehicle.now_us)
        for datagram in client.poll(vehicle.now_us):
            vehicle.hear(datagram)
        vehicle.now_us += STEP_US
    return client, vehicle


def test_it_is_found_uploaded_armed_flown_and_landed() -> None:
    client, vehicle = flown()
    assert client.outcome is not None and (client.outcome.name, client.outcome.reason) == ("completed", "")
    assert [m.command for m in vehicle.uploaded] == [item.command for item in ITEMS]
    assert [(m.x, m.y) for m in vehicle.uploaded] == [(item.x, item.y) for item in ITEMS]
    assert vehicle.mode == AUTO


def test_what_it_refuses_while_it_starts_is_asked_again() -> None:
    vehicle = Scripted()
    vehicle.storage_ready_us, vehicle.ready_us = 5_000_000, 40_000_000
    client, vehicle = flown(vehicle=vehicle)
    assert client.outcome is not None and client.outcome.name == "completed"
    assert vehicle.began_us is not None and vehicle.began_us >= 40_000_000


def test_one_that_is_never_ready_is_told_with_its_own_reason() -> None:
    vehicle = Scripted()
    vehicle.ready_us = 10**12
    client, _ = flown(vehicle=vehicle)
    assert client.outcome is not None and client.outcome.name == "refused"
    assert "arm: failed" in client.outcome.reason and "Need Position Estimate" in client.outcome.reason


def test_one_that_stops_on_the_way_has_not_completed() -> None:
    vehicle = Scripted()
    vehicle.ends_at = 4
    client, _ = flown(vehicle=vehicle)
    assert client.outcome is not None and client.outcome.name == "interrupted"
    assert "disarmed before the end of the mission" in client.outcome.reason


@pytest.mark.parametrize("at_us", [500_000, 2_000_000, 5_000_000])
def test_one_that_falls_silent_is_lost(at_us: int) -> None:
    def die(vehicle: Scripted) -> None:
        vehicle.silent = vehicle.now_us >= at_us

    client, vehicle = flown(die)
    assert client.outcome is not None and client.outcome.name == "lost"
    assert vehicle.now_us < at_us + 10_000_000
