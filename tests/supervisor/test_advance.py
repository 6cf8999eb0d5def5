"""The supervisor from tick to tick: whole flights in a world that does as it is told, and what ends one."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import (
    LOAD_POSITION,
    Brake,
    Creep,
    Hold,
    PathResume,
    SignalRun,
    Swing,
    SwingDamping,
)
from autopilot.guidance.setpoint_follower import PositionSetpoint, SetpointStream
from autopilot.onboard.snapshot import flight_status
from autopilot.services.requests import (
    Arm,
    ChangeSpeed,
    Continue,
    Land,
    Pause,
    Reposition,
    ReturnHome,
    SetCurrent,
    SetHome,
    StartMission,
)
from autopilot.services.requests import Takeoff as TakeoffRequest
from autopilot.supervisor.advance import advance
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.state import (
    CRITICAL,
    IN_AIR,
    LANDING,
    ON_GROUND,
    Flight,
    MissionPlan,
    MissionProgress,
    Phase,
    Setpoints,
    View,
)
from autopilot.trajectory.slack_cable import tauten_duration_s
from autopilot.wire.dialect import plumbline as mavlink
from missions import model
from missions.model import (
    AttitudeRun,
    Delay,
    LoadPath,
    Signals,
    Sine,
    Speed,
    Takeoff,
    Term,
    Trajectory,
    Waypoint,
)
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, Sky, entered, hanging, view

STEPS = (Takeoff(2.0), Waypoint(3.0, 0.0, 2.0, hold_s=1.0), model.Land())
# m: setpoints on both sides of a join; a tick of 20 ms at 1.5 m/s is 30 mm
CONTINUOUS = 1e-9
JUMP_PER_TICK = 0.05

# ---- whole missions

SIGNALS = Signals(4.0, (Term("x", 0.5, 0.5, 0.5, 1.0, 0.5, (Sine(1.0),)),))
RUN = AttitudeRun("vehicle", 0.1, 0.0, 1.5)
EVERY_STEP = (
    Takeoff(2.0),
    Delay(1.0),
    Speed(0.8),
    Waypoint(1.0, 2.0, 2.5, hold_s=0.5),
    SIGNALS,
    RUN,
    AttitudeRun("vehicle", -0.1, 0.0, 1.5),
    Delay(0.5),
    AttitudeRun("load", 0.1, 0.0, 1.0),
    model.ReturnHome(),
    model.Land(),
)
TAKES_TIME = [i for i, step in enumerate(EVERY_STEP) if not isinstance(step, Speed | model.Land)]


def start(*steps: model.Step) -> Sky:
    sky = Sky(*steps)
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    return sky


def test_a_mission_of_every_step_runs_from_the_ground_to_the_ground() -> None:
    sky = start(*EVERY_STEP)
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    P = Phase
    assert sky.phases == [P.TAUTEN, P.LIFT, P.MISSION, P.LOWER, P.SET_DOWN, P.DISARMED]
    assert sky.flight.mission.done
    assert (sky.flight.mission.step, sky.flight.mission.active) == (0, False)
    assert sky.view.x_load[2] < 0.03
    assert sky.view.x_quad[2] < 0.07
    assert norm(sub(sky.view.x_quad, sky.view.x_load)) > 0.2, "the vehicle stands beside its load"


def test_reached_numbers_are_those_of_the_items_a_step_ends_with() -> None:
    """Signals with one term of one factor are three items on the wire; a waypoint may be two."""
    sky = start(*EVERY_STEP)
    sequence = sky.flight.mission.plan.sequence
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.reached == list(sequence)
    assert sequence[-1] == sky.flight.mission.plan.item_count - 1
    assert sequence[4] - sequence[3] == 3, "term, factor, run"


def test_a_mission_without_landing_holds_in_the_end() -> None:
    sky = start(Takeoff(2.0), Delay(0.5))
    sky.run(lambda s: s.flight.phase == Phase.HOLD)
    assert sky.flight.mission.done
    assert "Mission complete, holding" in sky.texts
    assert sky.reached == [0, 1]


@pytest.mark.parametrize("end", [model.ReturnHome(), model.Land(), Delay(0.5)])
def test_a_complete_mission_is_at_its_last_item_until_the_vehicle_stands_disarmed(end: model.Step) -> None:
    sky = start(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), end)
    said: list[int] = []

    def is_over(sky: Sky) -> bool:
        said.append(flight_status(sky.flight, 3).mission_current)
        return sky.flight.mission.done and sky.flight.phase in (Phase.HOLD, Phase.DISARMED)

    sky.run(is_over)
    on_ground = sky.flight.phase == Phase.DISARMED
    assert said[-1] == (0 if on_ground else 2)
    in_air = said[:-1] if on_ground else said
    assert in_air == sorted(in_air)
    assert in_air[-1] == 2


def test_a_complete_mission_that_is_to_begin_again_is_not_complete() -> None:
    sky = start(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), model.Land())
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert flight_status(sky.flight, 3).mission_state == mavlink.MISSION_STATE_COMPLETE
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert flight_status(sky.flight, 3).mission_state == mavlink.MISSION_STATE_NOT_STARTED
    waiting = replace(sky.flight, phase=Phase.ARMED, mission=replace(sky.flight.mission, waiting=True))
    assert flight_status(waiting, 3).mission_state == mavlink.MISSION_STATE_NOT_STARTED
    sky.ask(Arm(arm=True, force=False))
    assert flight_status(sky.flight, 3).mission_state == mavlink.MISSION_STATE_ACTIVE


def test_a_complete_mission_stays_at_its_first_item_in_a_flight_without_it() -> None:
    sky = start(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), model.Land())
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    said = set()
    sky.ask(TakeoffRequest(2.0))
    sky.ask(Arm(arm=True, force=False))
    while sky.flight.phase != Phase.HOLD:
        sky.tick()
        status = flight_status(sky.flight, 3)
        said.add((status.mission_current, status.mission_state))
    assert said == {(0, mavlink.MISSION_STATE_COMPLETE)}


def test_a_mission_that_is_interrupted_while_it_takes_off_is_paused() -> None:
    sky = start(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), model.Land())
    sky.run(lambda s: s.flight.phase == Phase.LIFT)
    assert sky.ask(Pause()).result == ACCEPTED
    sky.wait(1.0)
    assert flight_status(sky.flight, 3).mission_state == mavlink.MISSION_STATE_PAUSED
    sky.flight = with_plan(sky.flight, sky.flight.mission.plan)
    assert flight_status(sky.flight, 3).mission_state == mavlink.MISSION_STATE_NOT_STARTED


def test_a_speed_is_changed_back() -> None:
    sky = Sky()
    for asked, flown in ((0.7, 0.7), (None, sky.settings.motion.speed_m_s)):
        assert sky.ask(ChangeSpeed(asked)).result == ACCEPTED
        assert sky.flight.mission.speed_m_s == flown


def test_steps_that_take_no_time_do_not_stop_the_clock() -> None:
    """However many there are, and even if they are repeated without end."""
    sky = Sky(Takeoff(2.0), Delay(0.0), Speed(1.0))
    sky.flight = with_plan(sky.flight, replace(sky.flight.mission.plan, loops={2: 1}))
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.run(lambda s: len(s.reached) > 100)
    assert sky.reached[:5] == [0, 1, 2, 1, 2]
    assert sky.ask(ReturnHome()).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)


def test_an_item_of_several_steps_is_reached_with_its_last_one_each_time_it_is_flown() -> None:
    """A circle: to its centre, then the turns; and the jump behind it leads back to it."""
    sky = Sky(
        Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), Delay(1.0), Waypoint(1.0, 0.0, 2.0), Delay(1.0), model.Land()
    )
    sky.flight = with_plan(sky.flight, replace(sky.flight.mission.plan, sequence=(0, 1, 1, 1, 1, 2)))
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.reached == [0, 1, 1, 2]


def test_a_mission_without_end_goes_on_until_it_is_told_otherwise() -> None:
    sky = Sky(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), Waypoint(0.0, 0.0, 2.0))
    sky.flight = with_plan(sky.flight, replace(sky.flight.mission.plan, loops={2: 1}))
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.run(lambda s: len(s.reached) == 8)
    assert sky.reached == [0, 1, 2, 1, 2, 1, 2, 1]
    assert sky.flight.mission.active
    assert not sky.flight.mission.done
    assert sky.ask(ReturnHome()).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)


def test_an_item_behind_what_is_flown_is_refused_with_the_reason() -> None:
    sky = Sky(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0)).airborne()
    sky.flight = with_plan(sky.flight, replace(sky.flight.mission.plan, item_count=5))
    verdict = sky.ask(SetCurrent(4))
    text = "Mission item 4 denied: nothing is flown from there"
    assert (verdict.result, verdict.text) == (mavlink.MAV_RESULT_DENIED, text)


def test_arming_an_armed_vehicle_is_accepted_and_changes_nothing() -> None:
    sky = Sky().airborne()
    before = sky.flight
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert sky.flight == before


def test_a_mission_that_ends_with_a_return_lands() -> None:
    sky = start(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), model.ReturnHome())
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.flight.mission.done
    assert "Home reached, landing" in sky.texts
    assert sky.reached == [0, 1, 2]
    assert norm(sub(sky.view.x_load, (0.0, 0.0, 0.02))) < 0.03


def test_a_pause_in_the_landing_after_a_return_does_not_begin_the_mission_again() -> None:
    sky = start(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), model.ReturnHome())
    sky.run(lambda s: s.flight.phase == Phase.LOWER)
    sky.wait(1.0)
    assert sky.ask(Pause()).result == ACCEPTED
    sky.wait(3.0)
    assert sky.flight.phase == Phase.HOLD
    assert sky.ask(Continue()).result == ACCEPTED
    highest = sky.view.x_load[2]
    sky.run(lambda s: s.flight.phase == Phase.DISARMED or s.view.x_load[2] > highest + 0.1)
    assert sky.flight.phase == Phase.DISARMED
    assert sky.reached == [0, 1, 2]


def test_a_return_that_is_asked_for_again_flies_on_or_to_a_home_that_has_moved() -> None:
    sky = Sky().airborne()
    sky.ask(Reposition(8.0, 0.0, 2.0, True))
    sky.run(lambda s: s.view.x_load[0] > 7.9)
    assert sky.ask(ReturnHome()).result == ACCEPTED
    sky.wait(2.0)
    before = sky.flight
    assert sky.ask(ReturnHome()).result == ACCEPTED
    assert sky.flight == before
    sky.ask(SetHome((3.0, 4.0, 0.0)))
    assert sky.flight.legs == before.legs
    assert sky.ask(ReturnHome()).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert norm(sub(sky.view.x_load, (3.0, 4.0, 0.02))) < 0.03


def test_a_mission_that_does_not_begin_with_a_takeoff_is_lifted_all_the_same() -> None:
    sky = start(Waypoint(1.0, 0.0, 2.0), model.Land())
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.reached == [0, 1]


@pytest.mark.parametrize("step", TAKES_TIME)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_pause_in_any_step_stops_and_continuing_finishes_the_mission(step: int, share: float) -> None:
    sky = start(*EVERY_STEP)
    sky.run(
        lambda s: s.flight.mission.active and s.flight.mission.step == step and s.flight.phase != Phase.TAUTEN
    )
    leg = sky.flight.legs[0]
    sky.wait(min(share * leg.duration_s, 2.0))
    assert sky.ask(Pause()).result == ACCEPTED
    sky.run(lambda s: isinstance(s.flight.legs[0], Hold))
    assert sky.flight.phase == Phase.HOLD
    resting = sky.view.x_load
    sky.wait(1.0)
    assert sky.view.x_load == pytest.approx(resting, abs=1e-6)
    assert sky.flight.mission.step == step
    assert sky.ask(Continue()).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.reached == list(sky.flight.mission.plan.sequence)


TRAJECTORY = Trajectory([(0.0,) * 4, (2.0, 1.0, 0.5, 0.2), (4.0, 0.5, 1.0, 0.0), (7.0, 0.0, 0.0, 0.1)])


@pytest.mark.parametrize("path", [SIGNALS, TRAJECTORY])
@pytest.mark.parametrize("away", [False, True])
def test_a_path_that_is_paused_continues_where_it_stopped(path: LoadPath, away: bool) -> None:
    sky = start(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), path, model.Land())
    sky.run(lambda s: bool(s.flight.legs) and isinstance(s.flight.legs[0], SignalRun))
    run = sky.flight.legs[0]
    assert isinstance(run, SignalRun)
    sky.wait(1.2)
    for _ in range(2):  # once more while it is resumed
        sky.ask(Pause())
        sky.run(lambda s: isinstance(s.flight.legs[0], Hold))
        place = sky.view.x_load
        if away:
            assert sky.ask(Reposition(3.0, 3.0, 3.0, True)).result == ACCEPTED
            sky.wait(9.0)
        assert sky.ask(Continue()).result == ACCEPTED
        sky.run(lambda s: isinstance(s.flight.legs[0], PathResume))
        assert sky.view.x_load == pytest.approx(place, abs=1e-3)
        sky.wait(0.9)
    resumed = sky.flight.legs[0]
    assert isinstance(resumed, PathResume)
    assert resumed.run == run
    assert resumed.begin_s > 1.2
    sky.run(lambda s: s.flight.mission.step == 3)
    assert sky.view.x_load == pytest.approx(run.jet(run.duration_s)[0], abs=1e-3)
    assert sky.flight.mission.stopped_run is None


def test_a_path_that_is_chosen_anew_after_a_pause_begins_anew() -> None:
    sky = start(Takeoff(2.0), SIGNALS, model.Land())
    sky.run(lambda s: bool(s.flight.legs) and isinstance(s.flight.legs[0], SignalRun))
    sky.wait(1.2)
    sky.ask(Pause())
    sky.run(lambda s: isinstance(s.flight.legs[0], Hold))
    place = sky.view.x_load
    assert sky.ask(SetCurrent(sky.flight.mission.plan.sequence[1])).result == ACCEPTED
    sky.ask(Continue())
    sky.run(lambda s: isinstance(s.flight.legs[0], SignalRun))
    assert sky.flight.legs[0].anchor == pytest.approx(place, abs=1e-3)


def test_two_attitude_runs_follow_each_other_without_a_stop_and_the_last_is_calmed() -> None:
    sky = start(*EVERY_STEP)
    kinds: list[type] = []
    while sky.flight.phase != Phase.LOWER:
        sky.tick()
        if sky.flight.legs and (not kinds or kinds[-1] is not type(sky.flight.legs[0])):
            kinds.append(type(sky.flight.legs[0]))
    first = kinds.index(Swing)
    assert kinds[first : first + 4] == [Swing, SwingDamping, Brake, Hold]
    assert kinds.count(Swing) == 2, "the pair is one motion"


@pytest.mark.parametrize("request_", [Land(), ReturnHome(), Pause()])
@pytest.mark.parametrize("at_s", [0.3, 1.0, 2.0])
def test_interrupting_a_transfer_leaves_no_jump_in_the_setpoint(request_: object, at_s: float) -> None:
    sky = Sky(Takeoff(2.0), Waypoint(3.0, 0.0, 2.0), model.Land())
    sky.ask(StartMission(None))
    sky.ask(Arm(True, False))
    sky.run(lambda s: s.flight.phase == Phase.MISSION)
    sky.wait(at_s)
    before = sky.flight.legs[0].jet((sky.now_us - sky.flight.leg_start_us) * 1e-6)
    assert norm(before[1]) > 0.0
    assert sky.ask(request_).result == ACCEPTED
    after = sky.flight.legs[0].jet(0.0)
    for order in range(3):
        assert after[order] == pytest.approx(before[order], abs=CONTINUOUS), order
    sky.setpoints.clear()
    sky.wait(8.0)
    load = [jet for _, mode, jet in sky.setpoints if mode == LOAD_POSITION]
    assert max(norm(sub(b[0], a[0])) for a, b in pairwise(load)) < JUMP_PER_TICK


@pytest.mark.parametrize("request_", [Land(), ReturnHome()])
@pytest.mark.parametrize("step", range(len(EVERY_STEP) - 1))
def test_landing_and_returning_end_on_the_ground_from_any_step(request_: object, step: int) -> None:
    sky = start(*EVERY_STEP)
    sky.run(
        lambda s: s.flight.mission.active and s.flight.mission.step >= step and s.flight.phase != Phase.TAUTEN
    )
    sky.wait(0.4)
    assert sky.ask(request_).result == ACCEPTED
    assert not sky.flight.mission.active
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert "Landed, disarmed" in sky.texts
    if isinstance(request_, ReturnHome):
        assert math.hypot(*sky.view.x_load[:2]) < 0.01
    assert not sky.flight.mission.done


@pytest.mark.parametrize(("far", "highest"), [(3.0, 4.0), (0.5, 2.0)])
def test_a_return_climbs_first_where_home_is_not_near(far: float, highest: float) -> None:
    settings = replace(SETTINGS, motion=replace(SETTINGS.motion, return_altitude_m=4.0))
    sky = Sky(Takeoff(2.0), Waypoint(far, 0.0, 2.0), settings=settings)
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.HOLD)
    assert sky.ask(ReturnHome()).result == ACCEPTED
    heights, away = [], []
    while sky.flight.phase == Phase.RETURN:
        sky.tick()
        heights.append(sky.view.x_load[2])
        away.append(sky.view.x_load[0] if heights[-1] < highest - 0.01 else far)
    assert max(heights) == pytest.approx(highest, abs=1e-6)
    # a waypoint is known to 1e-7 degrees
    assert away[:-1] == pytest.approx([far] * len(away[:-1]), abs=6e-3), "straight up, then home"


def test_holding_low_over_the_ground_rises_clear_of_it() -> None:
    sky = Sky().airborne()
    sky.ask(Land())
    sky.run(lambda s: isinstance(s.flight.legs[0], Creep))
    assert sky.ask(Pause()).result == ACCEPTED
    sky.run(lambda s: isinstance(s.flight.legs[0], Hold))
    assert sky.view.x_load[2] == pytest.approx(0.3)


# ---- jumping within a mission


def test_setting_the_current_item_in_flight_goes_there_at_once() -> None:
    sky = start(Takeoff(2.0), Waypoint(9.0, 0.0, 2.0), Speed(0.5), Waypoint(0.0, 1.0, 2.0), model.Land())
    sky.run(lambda s: s.flight.phase == Phase.MISSION)
    sky.wait(1.0)
    speed_item, land_item = sky.flight.mission.plan.sequence[2], sky.flight.mission.plan.sequence[4]
    assert sky.ask(SetCurrent(speed_item)).result == ACCEPTED
    assert sky.flight.mission.speed_m_s == 0.5, "a speed that is jumped to is a speed set"
    sky.run(lambda s: s.flight.mission.step == 3)
    sky.wait(3.0)
    assert sky.ask(SetCurrent(land_item)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.reached[-1] == land_item


def test_a_speed_that_is_left_open_is_the_usual_one() -> None:
    sky = start(
        Takeoff(2.0), Speed(0.5), Waypoint(1.0, 0.0, 2.0), Speed(), Waypoint(0.0, 1.0, 2.0), model.Land()
    )
    sky.run(lambda s: s.flight.mission.step == 2)
    assert sky.flight.mission.speed_m_s == 0.5
    sky.run(lambda s: s.flight.mission.step == 4)
    assert sky.flight.mission.speed_m_s == SETTINGS.motion.speed_m_s != 0.5


def test_a_landing_that_is_called_off_by_another_item_is_called_off() -> None:
    sky = start(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), model.Land())
    sky.run(lambda s: s.flight.phase == Phase.LOWER)
    assert sky.ask(SetCurrent(1)).result == ACCEPTED
    assert sky.flight.phase == Phase.MISSION
    sky.run(lambda s: s.flight.phase == Phase.SET_DOWN)
    assert sky.ask(SetCurrent(1)).result != ACCEPTED, "a load that lies is not lifted again in passing"
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.reached == [0, 1, 1, 2]


# ---- touchdown

BOBBING_M, BOBBING_US = 0.1, 1_600_000  # amplitude and period of a vehicle in a gust


def lowering(phase: Phase) -> Flight:
    """A flight in the last leg of its landing."""
    flight = entered(
        Flight(phase=Phase.HOLD, mission=MissionProgress(speed_m_s=1.0)), Phase.LOWER, hanging(), SETTINGS
    )
    if phase == Phase.SET_DOWN:
        flight = entered(flight, phase, hanging(x=(0.0, 0.0, 0.02)), SETTINGS)
    return Flight(phase=phase, legs=flight.legs[-1:], leg_start_us=0)


def test_the_load_is_down_when_it_no_longer_follows_and_not_before() -> None:
    flight = lowering(Phase.LOWER)
    creep = flight.legs[0]
    for k in range(1, 200):
        now = k * STEP_US
        target = creep.jet(now * 1e-6)[0]
        height = max(target[2], 0.02)
        flight, _ = advance(flight, hanging(now, (target[0], target[1], height)), SETTINGS)
        if flight.phase == Phase.SET_DOWN:
            break
        assert not target[2] < 0.02 - 0.05 - 0.2 * 0.3, "long down"
    assert flight.phase == Phase.SET_DOWN
    assert target[2] < 0.02 - 0.05


def test_a_gust_that_holds_the_vehicle_up_is_no_landing() -> None:
    flight = lowering(Phase.SET_DOWN)
    creep = flight.legs[0]
    start_height = creep.jet(0.0)[0][2]
    for k in range(1, 400):
        now = k * STEP_US
        phase = 2.0 * math.pi * now / BOBBING_US
        bobbing = (creep.jet(0.0)[0][0], 0.0, start_height + BOBBING_M * math.sin(phase))
        speed = BOBBING_M * 2e6 * math.pi / BOBBING_US * math.cos(phase)
        flight, _ = advance(flight, view(now, x_quad=bobbing, v_quad=(0.0, 0.0, speed)), SETTINGS)
    assert flight.phase == Phase.SET_DOWN
    for k in range(400, 420):
        flight, report = advance(flight, view(k * STEP_US, x_quad=bobbing), SETTINGS)
        if flight.phase == Phase.DISARMED:
            break
    assert flight.phase == Phase.DISARMED, "it stands still for 0.2 s: landed"
    assert report.texts[0][1] == "Landed, disarmed"


def test_a_vehicle_that_trembles_on_the_ground_has_landed() -> None:
    flight = lowering(Phase.SET_DOWN)
    creep = flight.legs[0]
    start_height = creep.jet(0.0)[0][2]
    for k in range(1, 400):
        now = k * STEP_US
        depth = start_height - creep.jet(now * 1e-6)[0][2]
        height, speed = start_height + (0.008 if k % 2 else -0.008), 0.3 if k % 2 else -0.3
        trembling = view(now, x_quad=(0.0, 0.0, height), v_quad=(0.0, 0.0, speed))
        flight, report = advance(flight, trembling, SETTINGS)
        if flight.phase == Phase.DISARMED:
            break
    assert flight.phase == Phase.DISARMED
    assert report.texts[0][1] == "Landed, disarmed"
    assert 0.24 < depth < 0.27, (
        "half a second, in which the setpoint sinks by 0.1 m, after it is 0.15 m below"
    )


@pytest.mark.parametrize("released", [False, True])
def test_a_landing_from_high_above_is_quick_but_for_the_last_metres(released: bool) -> None:
    steps = (Takeoff(2.0), *((model.Release(),) if released else ()), Speed(3.0), Waypoint(0.0, 0.0, 30.0))
    sky = start(*steps, model.Land())
    sky.run(lambda s: s.flight.phase == Phase.LOWER)
    began = len(sky.setpoints)
    sky.run(lambda s: isinstance(s.flight.legs[0], Creep))
    descent = [jet for _, _, jet in sky.setpoints[began:]]
    assert len(descent) * STEP_US * 1e-6 < 36.0
    high = [jet[1][2] for jet in descent if jet[0][2] > 4.0]
    last = [jet[1][2] for jet in descent if jet[0][2] < 3.0]
    assert min(high) == pytest.approx(-1.5)
    assert min(last) == pytest.approx(-0.45)  # 3 m in 10 s, as slowly as ways without ramps take as long
    heights = [jet[0][2] for jet in descent]
    assert all(-1e-9 <= before - after < 1.51 * STEP_US * 1e-6 for before, after in pairwise(heights))
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.texts[-1] == "Landed, disarmed"


# ---- what ends a flight

HERE = (1.0, 0.0, 2.0)
NAN3 = (math.nan, 0.0, 0.0)
TROUBLES: dict[str, tuple[dict[str, Any], str]] = {
    "tilt": ({"tilt_rad": math.radians(121.0)}, "tilt 121.0 deg exceeds FS_TILT_DEG 120"),
    "tilt is no number": ({"tilt_rad": math.nan}, "the estimate is not a number"),
    "nothing to land by": (
        {"estimate_loss": "no reading of the inertial unit"},
        "no reading of the inertial unit",
    ),
    "x_quad is no number": ({"x_quad": NAN3}, "the estimate is not a number"),
    "v_quad is no number": ({"v_quad": NAN3}, "the estimate is not a number"),
    "x_load is no number": ({"x_load": NAN3}, "the estimate is not a number"),
    "v_load is infinite": ({"v_load": (math.inf, 0.0, 0.0)}, "the estimate is not a number"),
}


def under_way(phase: Phase) -> Flight:
    """A flight at the beginning of a phase, over (1, 0, 2)."""
    plan = MissionPlan(STEPS, (0, 1, 2), 3)
    held = Flight(
        phase=Phase.HOLD,
        mission=MissionProgress(plan=plan, step=1, takeoff_altitude_m=4.0, speed_m_s=1.0),
        setpoints=Setpoints(offboard=SetpointStream(PositionSetpoint(HERE), 0)),
    )
    return entered(held, phase, hanging(x=HERE), SETTINGS)


@pytest.mark.parametrize("trouble", TROUBLES)
@pytest.mark.parametrize("phase", sorted(IN_AIR))
def test_trouble_in_the_air_ends_in_failsafe_and_says_why(phase: Phase, trouble: str) -> None:
    changes, why = TROUBLES[trouble]
    flight = under_way(phase)
    assert advance(flight, hanging(STEP_US, HERE), SETTINGS)[0].phase == phase, "well before"
    after, report = advance(flight, hanging(STEP_US, HERE)._replace(**changes), SETTINGS)
    assert after.phase == Phase.FAILSAFE
    assert not after.legs
    assert report.texts[0][1] == f"Flight given up: {why}"
    later, _ = advance(after, hanging(4_000_000, HERE), SETTINGS)
    assert later.phase == Phase.DISARMED


@pytest.mark.parametrize("phase", sorted(IN_AIR - LANDING))
def test_readings_that_are_missing_in_the_air_lead_to_a_landing(phase: Phase) -> None:
    flight = under_way(phase)
    blind = hanging(STEP_US, HERE)._replace(estimate_problems=("no load position from a tracker",))
    after, report = advance(flight, blind, SETTINGS)
    assert after.phase == (Phase.SET_DOWN if phase == Phase.TAUTEN else Phase.LOWER)
    assert not after.mission.active
    assert report.texts == ((CRITICAL, "Failsafe: no load position from a tracker, landing"),)
    held = entered(after, Phase.HOLD, hanging(2 * STEP_US, HERE), SETTINGS)
    again = advance(held, blind._replace(now_us=3 * STEP_US), SETTINGS)[0]
    assert again.phase == Phase.LOWER, "nothing else is flown while they are missing"


@pytest.mark.parametrize("phase", sorted(LANDING))
def test_a_landing_goes_on_while_readings_are_missing(phase: Phase) -> None:
    blind = hanging(STEP_US, HERE)._replace(estimate_problems=("no load position from a tracker",))
    after, report = advance(under_way(phase), blind, SETTINGS)
    assert (after.phase, report.texts) == (phase, ())


@pytest.mark.parametrize("phase", sorted(ON_GROUND))
def test_trouble_on_the_ground_ends_nothing(phase: Phase) -> None:
    after, report = advance(Flight(phase=phase), view(STEP_US, estimate_problems=("no pose",)), SETTINGS)
    assert (after.phase, report.texts) == (phase, ())


def test_an_armed_vehicle_that_is_asked_for_nothing_disarms() -> None:
    sky = Sky()
    sky.ask(Arm(True, False))
    sky.run(lambda s: s.flight.phase == Phase.DISARMED, limit_s=10.1)
    assert sky.now_us > 10_000_000


def test_a_cable_that_never_comes_taut_ends_the_climb() -> None:
    sky = Sky()
    sky.ask(Arm(True, False))
    assert sky.ask(TakeoffRequest(2.0)).result == ACCEPTED
    never = Sky.obey
    sky.obey = lambda: never(sky)._replace(taut=False)
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    (text,) = [text for text in sky.texts if "never taut" in text]
    assert "VEH_CABLE_LEN" in text and "VEH_LOAD_MASS" in text  # a light load does not pull enough
    assert max(jet[0][2] for _, _, jet in sky.setpoints) < 0.02 + 1.35 * SETTINGS.cable_length_m


def test_a_load_that_swings_unnoticed_ends_the_climb() -> None:
    """The vehicle is moved over it again and again, and each move begins the climb anew."""
    sky = Sky()
    sky.ask(Arm(True, False))
    assert sky.ask(TakeoffRequest(2.0)).result == ACCEPTED
    ideal = sky.obey

    def hanging_light() -> View:
        seen = ideal()._replace(taut=False, pull_n=0.1 * SETTINGS.load_weight_n)
        x, y, z = seen.x_quad
        swing = 0.2 * math.sin(2.0 * sky.now_us * 1e-6)
        return seen._replace(x_load=(x + swing, y, max(z - SETTINGS.cable_length_m, 0.02)))

    sky.obey = hanging_light  # type: ignore[method-assign]
    sky.run(lambda s: s.flight.phase != Phase.TAUTEN and s.now_us > 1_000_000, limit_s=60.0)
    assert sky.flight.phase == Phase.SET_DOWN
    assert sky.texts[-1] == "Cable never taut, landing; check VEH_CABLE_LEN, VEH_LOAD_MASS and VEH_QUAD_MASS"


def with_long_cable(cable_m: float) -> Sky:
    """A vehicle that takes off beside a load on a long cable."""
    sky = Sky(settings=replace(SETTINGS, cable_length_m=cable_m))
    sky.view = sky.view._replace(x_quad=(-0.5 * cable_m, 0.0, sky.view.x_quad[2]))
    sky.ask(Arm(True, False))
    assert sky.ask(TakeoffRequest(2.0)).result == ACCEPTED
    return sky


def test_a_long_cable_is_flown_along_and_its_end_crept() -> None:
    sky, cable_m, creep_m_s = with_long_cable(60.0), 60.0, SETTINGS.motion.taut_speed_m_s
    sky.run(lambda s: s.flight.phase == Phase.LIFT)
    begin_s = sky.setpoints[0][0]
    taut_s = sky.setpoints[-1][0] - begin_s
    assert taut_s == pytest.approx(tauten_duration_s(cable_m, creep_m_s), abs=2.0)
    last = [jet for time_s, _, jet in sky.setpoints if taut_s - 50.0 < time_s - begin_s < taut_s - 0.5]
    assert {jet[1] for jet in last} == {(0.0, 0.0, creep_m_s)}


def test_what_a_camera_sees_of_a_load_far_below_does_not_keep_the_vehicle_moving_over_it() -> None:
    """Its noise of 3 mrad is 0.1 m on 30 m; each move began the climb anew, and the cable never came taut."""
    sky, noise = with_long_cable(30.0), random.Random(1)
    ideal = sky.obey

    def seen() -> View:
        told = ideal()
        beside = (noise.gauss(0.0, 0.06), noise.gauss(0.0, 0.06), told.x_load[2])
        return told if told.taut else told._replace(x_load=beside, load_tracked=False)

    sky.obey = seen  # type: ignore[method-assign]
    sky.run(lambda s: s.flight.phase in (Phase.LIFT, Phase.SET_DOWN))
    taut_s = sky.setpoints[-1][0] - sky.setpoints[0][0]
    assert taut_s == pytest.approx(tauten_duration_s(30.0, SETTINGS.motion.taut_speed_m_s), abs=5.0)


def test_a_gust_may_hide_the_pull_of_a_load_without_a_tracker() -> None:
    """The pull alone shows that its cable is taut: the setpoint rises for 2 s more."""

    def highest(tracked: bool) -> float:
        sky = Sky()
        sky.ask(Arm(True, False))
        sky.ask(TakeoffRequest(2.0))
        never = sky.obey
        sky.obey = lambda: never()._replace(taut=False, load_tracked=tracked)
        sky.run(lambda s: s.flight.phase == Phase.DISARMED)
        return max(jet[0][2] for _, _, jet in sky.setpoints)

    rise = 2.0 * SETTINGS.motion.taut_speed_m_s
    assert highest(tracked=False) - highest(tracked=True) == pytest.approx(rise, abs=0.01)


def test_a_cable_that_pulls_but_is_too_short_to_count_as_taut_is_named() -> None:
    """The vehicle is above its load and can rise no further."""
    sky = Sky()
    sky.ask(Arm(True, False))
    assert sky.ask(TakeoffRequest(2.0)).result == ACCEPTED
    ideal, short_m = Sky.obey, 0.97 * SETTINGS.cable_length_m

    def held() -> View:
        seen = ideal(sky)._replace(taut=False)
        x, y, z = seen.x_quad
        if z < short_m + 0.02:
            return seen
        at = (x, y, short_m + 0.02)
        return seen._replace(x_quad=at, x_load=(x, y, 0.02), pull_n=SETTINGS.load_weight_n)

    sky.obey = held  # type: ignore[method-assign]
    sky.run(lambda s: s.flight.phase != Phase.TAUTEN and s.now_us > 1_000_000)
    assert sky.texts[-1] == f"Cable pulls at {short_m:.2f} m, landing; check VEH_CABLE_LEN"


def test_a_load_that_hangs_on_a_shorter_cable_than_is_believed_ends_the_climb() -> None:
    """The load swings out from under the vehicle, which would keep moving to stay above it."""
    sky = Sky()
    sky.ask(Arm(True, False))
    assert sky.ask(TakeoffRequest(2.0)).result == ACCEPTED
    ideal, short_m = Sky.obey, 0.5 * SETTINGS.cable_length_m

    def hanging_short() -> View:
        seen = ideal(sky)._replace(taut=False)
        if seen.x_quad[2] < short_m:
            return seen
        swing = 0.2 * math.sin(3.0 * sky.now_us * 1e-6)
        load = (seen.x_quad[0] + swing, seen.x_quad[1], seen.x_quad[2] - short_m)
        return seen._replace(x_load=load, pull_n=SETTINGS.load_weight_n)

    sky.obey = hanging_short  # type: ignore[method-assign]
    sky.run(lambda s: s.flight.phase != Phase.TAUTEN and s.now_us > 1_000_000)
    assert sky.flight.phase in (Phase.LOWER, Phase.SET_DOWN)
    assert sky.texts[-1].startswith("Cable pulls at 0.") and "VEH_CABLE_LEN" in sky.texts[-1]
