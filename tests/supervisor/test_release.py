"""The load released: what the supervisor does in every phase, and what it refuses without a load."""

from __future__ import annotations

from dataclasses import replace

import pytest

from autopilot.guidance.legs import QUAD_POSITION, Creep
from autopilot.services.requests import FollowAttitude, Grab, Release, StartMission
from autopilot.supervisor.phase_legs import TOUCH_HEIGHT
from autopilot.supervisor.requests.decide import decide
from autopilot.supervisor.state import CableState, Flight, MissionProgress, Phase
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import AttitudeRun, Delay, Land, Signals, Takeoff, Term, Waypoint
from tests.doubles.sky import ACCEPTED, SETTINGS, Sky, entered, hanging

DENIED = mavlink.MAV_RESULT_DENIED


def test_released_by_command_a_mission_is_held_and_goes_on_as_the_vehicles() -> None:
    sky = Sky(Takeoff(1.0), Waypoint(3.0, 0.0, 1.0, 2.0), Waypoint(0.0, 0.0, 2.0, 1.0), Land())
    sky.airborne()
    assert sky.ask(StartMission(1)).result == ACCEPTED
    sky.wait(1.0)
    verdict = sky.ask(Release())
    assert (verdict.result, verdict.text) == (ACCEPTED, "Load released, mission held")
    assert (sky.flight.phase, sky.flight.mission.active) == (Phase.HOLD, False)
    assert sky.ask(StartMission(None)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    flown = [(mode, jet[0]) for _, mode, jet in sky.setpoints[-500:]]
    assert {mode for mode, _ in flown} == {QUAD_POSITION}
    assert sky.flight.mission.done


SIGNALS = Signals(4.0, (Term("x", 0.1, 0.0, 2.0, None, 0.0),))


@pytest.mark.parametrize("step", [SIGNALS, AttitudeRun("load", 0.1, 0.0, 1.0)])
def test_what_swings_the_load_is_refused_without_it(step: Signals | AttitudeRun) -> None:
    sky = Sky(Takeoff(1.0), Delay(1.0), step, Land())
    sky.airborne()
    sky.ask(Release())
    verdict = sky.ask(StartMission(1))
    assert verdict.result == DENIED
    assert "needs the load, which is released" in str(verdict.text)
    assert sky.ask(FollowAttitude((0.0, 0.0, 1.0), None)).result == DENIED


@pytest.mark.parametrize("phase", [p for p in Phase if p not in (Phase.DISARMED, Phase.ARMED)])
def test_a_release_is_never_refused(phase: Phase) -> None:
    """Whatever is flown, the vehicle continues alone, and its setpoint begins at its present position."""
    sky = Sky(Takeoff(1.0), Waypoint(3.0, 0.0, 1.0, 9.0), Land()).airborne()
    if phase == Phase.MISSION:
        sky.ask(StartMission(1))
    else:
        sky.flight = entered(sky.flight, phase, sky.view, sky.settings)
    flight, verdict = decide(sky.flight, Release(), hanging(sky.now_us), sky.settings)
    assert verdict.result == ACCEPTED
    assert flight.cable.released
    if phase in (Phase.FAILSAFE, Phase.SET_DOWN):
        assert flight.phase == phase
        return
    assert flight.legs[0].control_mode == QUAD_POSITION
    assert flight.legs[0].jet(0.0)[0] == pytest.approx(hanging().x_quad, abs=1e-9)


@pytest.mark.parametrize("gear_m", [0.06, 0.5])
@pytest.mark.parametrize("height_std_m", [0.0, 0.1])
def test_a_vehicle_without_its_load_creeps_to_the_ground_however_high_it_stands(
    gear_m: float, height_std_m: float
) -> None:
    settings = replace(SETTINGS, standing_height_m=gear_m)
    flight = Flight(mission=MissionProgress(speed_m_s=1.0), cable=CableState(released=True))
    seen = hanging()._replace(height_std=height_std_m)
    *_, down, creep = entered(flight, Phase.LOWER, seen, settings).legs
    assert isinstance(creep, Creep)
    assert down.jet(down.duration_s)[0] == creep.jet(0.0)[0]
    assert creep.jet(0.0)[0][2] == pytest.approx(gear_m + TOUCH_HEIGHT + 3.0 * height_std_m)


def test_a_load_out_of_reach_is_not_taken() -> None:
    sky = Sky()
    sky.ask(Release())
    sky.view = sky.view._replace(x_load=(2.0, 0.0, 0.02))
    verdict = sky.ask(Grab())
    assert verdict.result == DENIED
    assert verdict.text == "Gripper: the load lies 1.90 m away; must be within 0.52 m"
    for beside_m, result in ((0.65, DENIED), (0.55, ACCEPTED)):  # the vehicle stands at 0.1 m
        sky.view = sky.view._replace(x_load=(beside_m, 0.0, 0.02))
        assert sky.ask(Grab()).result == result
    assert not sky.flight.cable.released
