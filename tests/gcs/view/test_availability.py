"""The buttons of the live page are those whose requests the vehicle accepts: its supervisor is asked."""

from __future__ import annotations

import math
from typing import Any

import pytest

from autopilot.onboard.snapshot import flight_status
from autopilot.services import identity, requests
from autopilot.services.records import Verdict
from autopilot.supervisor.requests.decide import decide
from autopilot.supervisor.state import Flight, MissionPlan, Phase
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.telemetry import winch_status_message
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.vehicle_view import VehicleView
from gcs.view.availability import unavailable_actions
from tests.doubles.sky import ACCEPTED, SETTINGS
from tests.supervisor.test_requests import PLAN, flight_in, seen_in

REQUESTS: dict[str, tuple[Any, ...]] = {
    "arm": (requests.Arm(True, False),),
    "disarm": (requests.Arm(False, False),),
    "takeoff": (requests.Takeoff(None),),
    "start": (requests.StartMission(None),),
    "resume": (requests.Continue(),),
    "hold": (requests.Pause(),),
    "land": (requests.Land(),),
    "return": (requests.SetMode(identity.AUTO, identity.AUTO_RTL),),
    "goto": (requests.Reposition(0.5, 0.5, 2.0, True),),
    "release": (requests.Release(),),
}
PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK


def view_of(*messages: Any) -> VehicleView:
    """What is known of a vehicle that has sent these messages."""
    view, writer = VehicleView(), FrameWriter(1, 1)
    for message in messages:
        for received in decode(writer.frame(message))[0]:
            view.update(received, 0)
    return view


def heartbeat(armed: bool, main: int = identity.AUTO, sub: int = identity.AUTO_LOITER) -> Any:
    mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, mode, main << 16 | sub << 24, 3, 3)


def landed(state: int) -> Any:
    return mavlink.MAVLink_extended_sys_state_message(0, state)


def sys_status(ready: bool) -> Any:
    health = PREARM if ready else 0
    return mavlink.MAVLink_sys_status_message(PREARM, PREARM, health, *(0,) * 10)


def reported(flight: Flight, items: int) -> VehicleView:
    """The view of a vehicle that reports this flight."""
    status = flight_status(flight, items)
    setpoint = mavlink.MAVLink_load_setpoint_message(**SETPOINT | {"phase": status.phase})
    current = mavlink.MAVLink_mission_current_message(status.seq, items, status.mission_state)
    beat = heartbeat(status.armed, status.main_mode, status.sub_mode)
    winch = winch_status_message(0, 0.7, 0.0, status.reel_rate, status.released)
    return view_of(beat, setpoint, current, landed(status.landed_state), sys_status(True), winch)


SETPOINT: dict[str, Any] = dict.fromkeys(mavlink.MAVLink_load_setpoint_message.fieldnames, 0)


@pytest.mark.parametrize("plan", [PLAN, MissionPlan()], ids=["mission", "no mission"])
@pytest.mark.parametrize("on_mission", [False, True])
@pytest.mark.parametrize("phase", Phase)
def test_a_button_is_enabled_if_and_only_if_its_request_is_accepted_and_does_something(
    phase: Phase, on_mission: bool, plan: MissionPlan
) -> None:
    before = flight_in(phase, on_mission and bool(plan.steps), plan)
    unavailable = unavailable_actions(reported(before, plan.item_count))
    for action, (request,) in REQUESTS.items():
        after, verdict = decide(before, request, seen_in(phase), SETTINGS)
        if action in unavailable:
            assert verdict.result != ACCEPTED or after.phase == phase, action
        else:
            assert verdict.result == ACCEPTED, (action, verdict.text)


def test_a_vehicle_on_the_ground_is_armed_for_its_mission_and_a_vehicle_in_the_air_is_not() -> None:
    ground = unavailable_actions(reported(flight_in(Phase.DISARMED, False, PLAN), 5))
    assert set(ground) == {"disarm", "resume", "hold", "land", "return", "goto"}
    air = unavailable_actions(reported(flight_in(Phase.HOLD, False, PLAN), 5))
    assert air == {"arm": "armed already", "disarm": "in the air: land first", "takeoff": "in the air"}


@pytest.mark.parametrize("phase", Phase)
def test_a_load_that_is_released_is_not_released_again(phase: Phase) -> None:
    before = flight_in(phase, False, PLAN)
    after, _ = decide(before, requests.Release(), seen_in(phase), SETTINGS)
    assert "release" not in unavailable_actions(reported(before, 5))
    assert unavailable_actions(reported(after, 5))["release"] == "the load is released already"
    assert decide(after, requests.Release(), seen_in(phase), SETTINGS) == (
        after,
        Verdict(ACCEPTED, "Gripper: the load is released already"),
    )


def test_what_is_held_at_rest_is_held_already_and_what_still_stops_is_not() -> None:
    mode, hold = mavlink.PLUMBLINE_CONTROL_LOAD_POSITION, mavlink.PLUMBLINE_PHASE_HOLD
    for duration_s, expected in ((math.nan, "held already"), (2.0, None)):
        changes = {"phase": hold, "control_mode": mode, "duration": duration_s}
        view = view_of(heartbeat(True), mavlink.MAVLink_load_setpoint_message(**SETPOINT | changes))
        assert unavailable_actions(view).get("hold") == expected


def test_a_vehicle_that_is_not_ready_is_not_armed() -> None:
    view = view_of(heartbeat(False), landed(mavlink.MAV_LANDED_STATE_ON_GROUND), sys_status(False))
    unavailable = unavailable_actions(view)
    assert {unavailable[action] for action in ("arm", "takeoff", "start")} == {"not ready to arm"}


def test_another_firmware_is_judged_by_what_it_reports_and_by_nothing_else() -> None:
    assert unavailable_actions(VehicleView()) == {}
    flying = unavailable_actions(view_of(heartbeat(True), landed(mavlink.MAV_LANDED_STATE_IN_AIR)))
    assert set(flying) == {"arm", "disarm", "takeoff"}
    standing = unavailable_actions(view_of(heartbeat(False), landed(mavlink.MAV_LANDED_STATE_ON_GROUND)))
    assert set(standing) == {"disarm", "resume", "hold", "land", "return", "goto"}
