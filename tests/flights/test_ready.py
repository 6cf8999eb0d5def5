"""Whether the vehicle may be armed, as SYS_STATUS states it before, during and after a flight."""

from __future__ import annotations

from itertools import groupby
from typing import Any

from autopilot.wire.codec import decode
from autopilot.wire.dialect import plumbline as mavlink
from gcs.closed_loop import Conditions, fly
from missions.model import Land, Mission, Takeoff, Waypoint

ROUTE = (Takeoff(1.5), Waypoint(2.0, 0.0, 1.5), Land())
PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK


class Heard:
    """The log of a flight: for each SYS_STATUS, whether the vehicle was armed, and whether it could be."""

    def __init__(self) -> None:
        self.armed = False
        self.told: list[tuple[bool, bool]] = []

    def write(self, unix_us: int, *frames: bytes) -> None:
        for frame in frames:
            for received in decode(frame)[0]:
                self._hear(received.message, received.component)

    def _hear(self, message: Any, component: int) -> None:
        if component == mavlink.MAV_COMP_ID_AUTOPILOT1 and message.get_type() == "HEARTBEAT":
            self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        elif message.get_type() == "SYS_STATUS":
            self.told.append((self.armed, bool(message.onboard_control_sensors_health & PREARM)))


def test_the_bit_of_the_pre_arm_checks_stays_while_the_vehicle_is_armed() -> None:
    heard = Heard()
    outcome = fly(Mission("ready", "", "", (), ROUTE), Conditions(), heard)
    assert outcome.name == "completed", outcome
    in_flight = [ready for armed, ready in heard.told if armed]
    assert len(in_flight) > 10
    assert all(in_flight), "it did not flap"
    assert [ready for ready, _ in groupby(ready for _, ready in heard.told)][:2] == [False, True]
