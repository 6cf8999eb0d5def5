"""Prepared paths in flight: shaped signals, waypoints flown through, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import Hold, PathStretch, SignalRun, requested_jet
from autopilot.services.requests import Arm, Land, Pause, Reposition, ReturnHome, SetCurrent, StartMission
from autopilot.services.requests import Takeoff as TakeOff
from autopilot.supervisor.mission import with_current_step, with_plan
from autopilot.supervisor.requests.mission_checks import mission_begin, mission_problem, remaining_timeline
from autopilot.supervisor.state import Flight, MissionPlan, Phase, jet_ahead, leg_time_s
from autopilot.trajectory.prepare import PENDING, REFUSE, SLOW_DOWN, prepare
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import Disc, Fence, Polygon
from missions import model
from missions.model import Delay, Signals, Speed, Step, Takeoff, Term, Waypoint
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, Sky

DENIED = mavlink.MAV_RESULT_DENIED
EDGE = Signals(3.0, (Term("y", 0.25, 0.0, 0.8, None, 0.0),))
ROUND = (
    Waypoint(3.0, 0.0, 2.0),
    Waypoint(3.0, 3.0, 2.5),
    Waypoint(0.0, 3.0, 2.0, hold_s=1.0),
)
PASSING_M_S = 0.1  # round corners of 90 degrees between lines of 3 m at up to 1.5 m/s
# error of the trapezoid rule over a tick, at a jerk of a few m/s^3
TRAPEZOID_M = 1e-5
LIMITS = SETTINGS.limits._replace(shape_paths=True)
prepared_once = cache(prepare)


def prepared_sky(*steps: Step, limits: object = LIMITS) -> Sky:
    sky = Sky(*steps)
    plan = sky.flight.mission.plan
    found = prepared_once(plan.steps, plan.sequence, limits)  # type: ignore[arg-type]
    sky.flight = with_plan(sky.flight, replace(plan, prepared=found))
    return sky


def started(*steps: Step, limits: object = LIMITS) -> Sky:
    sky = prepared_sky(*steps, limits=limits)
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    return sky


def start_prepared(sky: Sky) -> None:
    """Start the mission with paths from where it begins now, which it waits for."""
    assert sky.ask(StartMission(None)).result == ACCEPTED
    if sky.flight.mission.waiting:
        ahead = remaining_timeline(sky.flight, sky.view, SETTINGS)
        plan, begin = sky.flight.mission.plan, mission_begin(sky.flight, ahead, SETTINGS)
        found = prepare(plan.steps, plan.sequence, LIMITS, begin=begin)
        sky.flight = prepared(sky.flight, replace(plan, prepared=found))
        assert sky.ask(StartMission(None)).result == ACCEPTED
    assert not sky.flight.mission.waiting


def worst_jump(sky: Sky, order: int) -> float:
    """Greatest jump of a setpoint derivative from tick to tick, beyond what the next derivative explains."""
    step_s = STEP_US * 1e-6
    found = 0.0
    for (_, mode, jet), (_, mode_after, after) in pairwise(sky.setpoints):
        if mode == mode_after == mavlink.PLUMBLINE_CONTROL_LOAD_POSITION:
            middle = 0.5 * (np.array(jet[order + 1]) + np.array(after[order + 1]))
            found = max(found, float(np.abs(np.array(after[order]) - jet[order] - step_s * middle).max()))
    return found


def test_getting_ready_is_taken_from_the_delay_before() -> None:
    sky = started(Takeoff(2.0), Delay(3.0), EDGE, model.Land())
    sky.run(lambda s: s.flight.phase == Phase.MISSION)
    begun = sky.now_us
    sky.run(lambda s: bool(s.flight.legs) and isinstance(s.flight.legs[0], SignalRun))
    run = sky.flight.legs[0]
    assert isinstance(run, SignalRun)
    assert run.path.lead_s > 0.3
    assert (sky.now_us - begun) * 1e-6 == pytest.approx(3.0 - run.path.lead_s, abs=1e-6 * STEP_US)
    asked = requested_jet(run, leg_time_s(sky.flight, sky.now_us))
    assert asked == run.requested(0.0)
    assert norm(asked[1]) == 0.0


def test_the_clock_of_a_mission_loses_nothing_from_step_to_step() -> None:
    """Signals take time from the hold before them; it ends, and they begin, between two ticks."""
    sky = started(Takeoff(2.0), Delay(3.0), EDGE, Delay(1.2345), EDGE, model.Land())
    sky.run(lambda s: s.flight.phase == Phase.MISSION)
    asked_us, expected_us = [], sky.flight.leg_start_us
    for seconds in (3.0, 1.2345):
        expected_us += round(seconds * 1e6)
        leg = sky.flight.legs[0]
        sky.run(lambda s, leg=leg: s.flight.legs[0] is not leg and isinstance(s.flight.legs[0], SignalRun))
        path = sky.flight.legs[0].path
        asked_us.append(sky.flight.leg_start_us + round(path.lead_s * 1e6) - expected_us)
        expected_us += round(path.duration_s * 1e6)
    assert asked_us == pytest.approx([0, 0], abs=2)


def test_the_setpoint_looks_ahead_into_the_step_that_follows() -> None:
    sky = started(Takeoff(2.0), Delay(3.0), EDGE, model.Land())
    sky.run(lambda s: s.flight.phase == Phase.MISSION)
    hold = sky.flight.legs[0]
    assert isinstance(hold, Hold)
    (run,) = sky.flight.following
    assert isinstance(run, SignalRun)
    for ahead in (0.0, 0.1, 0.3):
        found, wanted = np.array(jet_ahead(sky.flight, hold.duration_s + ahead)), np.array(run.jet(ahead))
        # adding and subtracting 2.55 s loses the last digits of the time
        assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9)


def test_waypoints_in_a_row_are_passed_without_a_stop_and_reported() -> None:
    sky = started(Takeoff(2.0), *ROUND, model.Land())
    passed: list[tuple[int, float]] = []
    known = 0
    while sky.flight.phase != Phase.LOWER:
        sky.tick()
        assert sky.now_us < 120_000_000
        if len(sky.reached) > known:
            known = len(sky.reached)
            passed.append((sky.reached[-1], float(np.linalg.norm(sky.setpoints[-1][2][1]))))
            if sky.reached[-1] in (1, 2):
                point = sky.flight.mission.plan.steps[sky.reached[-1]]
                assert isinstance(point, Waypoint)
                there = (point.east_m, point.north_m, point.altitude_m)
                # at most a tick late, at the speed of passing, which is the least there is
                assert norm(sub(sky.setpoints[-1][2][0], there)) <= 1e-6 * STEP_US * passed[-1][1] * 1.02
    assert [item for item, _ in passed] == [0, 1, 2, 3]
    assert passed[1][1] > PASSING_M_S
    assert passed[2][1] > PASSING_M_S
    assert passed[3][1] == pytest.approx(0.0, abs=1e-9)
    assert worst_jump(sky, 0) < TRAPEZOID_M
    assert worst_jump(sky, 1) < TRAPEZOID_M / (STEP_US * 1e-6)


def test_a_load_beside_the_beginning_of_a_path_is_led_onto_it() -> None:
    sky = prepared_sky(Takeoff(2.0), *ROUND, model.Land())
    sky.view = sky.view._replace(x_load=(0.1, -0.05, 0.02), x_quad=(0.2, 0.0, 0.06))
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.LOWER)
    assert sky.reached == [0, 1, 2, 3]
    assert worst_jump(sky, 0) < TRAPEZOID_M


@pytest.mark.parametrize("item", [1, 2])
def test_a_passage_is_paused_and_gone_on_with(item: int) -> None:
    sky = started(Takeoff(2.0), *ROUND, model.Land())
    sky.run(lambda s: s.flight.mission.step == item and s.flight.phase == Phase.MISSION)
    sky.wait(0.5)
    assert isinstance(sky.flight.legs[0], PathStretch)
    assert sky.ask(Pause()).result == ACCEPTED
    sky.wait(4.0)
    start_prepared(sky)
    sky.run(lambda s: s.reached[-1] == 2)
    assert norm(sky.setpoints[-1][2][1]) > PASSING_M_S, "flown through"
    sky.run(lambda s: s.flight.phase == Phase.LOWER)
    assert sky.reached == [0, 1, 2, 3]
    assert worst_jump(sky, 0) < TRAPEZOID_M


def test_what_cannot_be_flown_is_refused_with_the_item_and_the_reason() -> None:
    hasty = Signals(3.0, (Term("z", 0.3, 0.0, 0.3, None, 0.0),))  # shaped quickly
    sky = prepared_sky(Takeoff(2.0), hasty, model.Land(), limits=LIMITS._replace(when_infeasible=REFUSE))
    verdict = sky.ask(StartMission(None))
    assert verdict.result == DENIED
    assert "item 2" in verdict.text
    slow = prepared_sky(Takeoff(2.0), hasty, model.Land(), limits=LIMITS._replace(when_infeasible=SLOW_DOWN))
    assert slow.ask(StartMission(None)).result == ACCEPTED
    assert slow.ask(Arm(True, False)).result == ACCEPTED


def pending(flight: Flight) -> Flight:
    plan = replace(flight.mission.plan, prepared=PENDING)
    return replace(flight, mission=replace(flight.mission, plan=plan))


def prepared(flight: Flight, plan: MissionPlan) -> Flight:
    return replace(flight, mission=replace(flight.mission, plan=plan))


def test_a_start_before_the_paths_are_there_waits_on_the_ground() -> None:
    sky = prepared_sky(Takeoff(2.0), *ROUND, model.Land())
    plan = sky.flight.mission.plan
    sky.flight = pending(sky.flight)
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert (sky.flight.phase, sky.flight.mission.waiting) == (Phase.ARMED, True)
    sky.flight = prepared(sky.flight, plan)
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert (sky.flight.phase, sky.flight.mission.waiting) == (Phase.TAUTEN, False)


def test_a_start_before_the_paths_are_there_holds_in_the_air() -> None:
    sky = started(Takeoff(2.0), *ROUND, model.Land())
    sky.run(lambda s: s.flight.mission.step == 2 and s.flight.phase == Phase.MISSION)
    assert sky.ask(ReturnHome()).result == ACCEPTED
    plan = sky.flight.mission.plan
    sky.flight = pending(sky.flight)
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert (sky.flight.phase, sky.flight.mission.waiting) == (Phase.HOLD, True)
    sky.wait(5.0)
    assert sky.flight.phase == Phase.HOLD
    sky.flight = prepared(sky.flight, plan)
    start_prepared(sky)
    sky.run(lambda s: s.flight.phase == Phase.LOWER)
    assert sky.reached[-1] == 3


@pytest.mark.parametrize("takeoff", [(), (Takeoff(2.0),)], ids=["waypoints alone", "with a take-off"])
def test_a_mission_that_begins_elsewhere_in_the_air_is_flown_through_as_well(
    takeoff: tuple[Step, ...],
) -> None:
    """The paths were prepared from home, so a start elsewhere waits until they are prepared from there."""
    sky = prepared_sky(*takeoff, *ROUND).airborne()
    assert sky.ask(Reposition(-2.0, 1.0, 2.0, None)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.HOLD and norm(s.view.v_load) == 0.0 and s.view.x_load[0] < -1.9)
    start_prepared(sky)
    passed: list[float] = []
    while sky.flight.mission.active:
        known = len(sky.reached)
        sky.tick()
        if len(sky.reached) > known:
            passed.append(norm(sky.setpoints[-1][2][1]))
    assert min(passed[len(takeoff) : -1]) > PASSING_M_S
    assert len(passed) == len(takeoff) + 3
    assert worst_jump(sky, 0) < TRAPEZOID_M


@pytest.mark.parametrize("first", range(1, 5))
def test_a_first_flight_may_begin_at_any_waypoint(first: int) -> None:
    """The load is lifted first, and the path begins above where it lay; nothing has been flown before."""
    sky = prepared_sky(Takeoff(2.0), *ROUND, Waypoint(1.0, 1.0, 2.0), model.Land())
    assert sky.ask(StartMission(first)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    start_prepared(sky)
    sky.run(lambda s: not s.flight.mission.active)
    assert sky.reached == list(range(first, 6))


def test_a_jump_in_flight_is_flown_through_the_remaining_waypoints_as_well() -> None:
    """It waits until their path is prepared from where the load comes to rest; the last one needs no path."""
    sky = started(Takeoff(2.0), *ROUND, model.Land())
    sky.run(lambda s: s.flight.mission.step == 3)
    verdict = sky.ask(SetCurrent(1))
    assert (verdict.result, verdict.text) == (ACCEPTED, "Mission item 1 begins when its paths are prepared")
    assert (sky.flight.phase, sky.flight.mission.waiting, sky.flight.mission.step) == (Phase.HOLD, True, 1)
    start_prepared(sky)
    sky.reached.clear()
    sky.run(lambda s: s.reached == [1])
    assert isinstance(sky.flight.legs[0], PathStretch)
    assert norm(sky.setpoints[-1][2][1]) > 0.0, "a sharp turn is slow"
    assert sky.ask(SetCurrent(3)).result == ACCEPTED
    assert (sky.flight.phase, sky.flight.mission.waiting) == (Phase.MISSION, False)
    sky.run(lambda s: s.flight.phase == Phase.LOWER)
    assert worst_jump(sky, 0) < TRAPEZOID_M


def test_a_load_that_stands_elsewhere_is_flown_through_the_waypoints_as_well() -> None:
    sky = prepared_sky(Takeoff(2.0), *ROUND)
    sky.view = sky.view._replace(x_load=(2.0, -1.0, 0.02), x_quad=(2.1, -1.0, 0.06))
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert (sky.flight.phase, sky.flight.mission.waiting) == (Phase.ARMED, True)
    start_prepared(sky)
    sky.run(lambda s: s.reached[-1:] == [1])
    assert norm(sky.setpoints[-1][2][1]) > PASSING_M_S


@pytest.mark.parametrize(
    ("fence", "item"),
    [
        (Fence((Polygon(True, ((-9.0, -9.0), (3.006, -9.0), (3.006, 9.0), (-9.0, 9.0))),)), 2),
        (Fence((Disc(False, (2.935, 3.045), 0.042),)), 3),
        (Fence((Disc(False, (1.5, -3.4), 0.2),)), None),
    ],
    ids=["out of a zone", "into a zone", "far from a zone"],
)
def test_a_curve_beyond_the_fence_is_refused(fence: Fence, item: int | None) -> None:
    """All waypoints are within the fence, and so are the straight lines between them: the load leaves them by
    14 mm in its turns."""
    sky = prepared_sky(Takeoff(2.0), *ROUND)
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=fence))
    verdict = sky.ask(StartMission(None))
    if item is None:
        assert verdict.result == ACCEPTED
        return
    assert verdict.result == DENIED
    assert verdict.text.startswith(f"Mission denied: the curve to item {item} leads ")
    # flown from rest to rest, as after a jump into the path, the lines are straight
    at_last = with_current_step(sky.flight, 3)
    ahead = remaining_timeline(at_last, sky.view, sky.settings)
    assert mission_problem(at_last, ahead, sky.settings) == ""


def test_a_mission_waits_for_paths_only_once() -> None:
    """A curve that would touch the ground between its waypoints is not flown, wherever it begins."""
    low = (Waypoint(3.0, 0.0, 0.3), Waypoint(9.0, 0.0, 0.3), Waypoint(9.5, 0.0, 9.0))
    sky = prepared_sky(Takeoff(2.0), Speed(10.0), *low).airborne()
    assert sky.ask(Reposition(-2.0, 1.0, 2.0, None)).result == ACCEPTED
    sky.wait(20.0)
    start_prepared(sky)
    assert sky.flight.mission.plan.prepared.paths == (None,) * 5


@pytest.mark.parametrize("wish", [Pause(), Land(), ReturnHome(), TakeOff(None)], ids=type)
def test_another_wish_takes_the_place_of_a_mission_that_waits(wish: object) -> None:
    sky = prepared_sky(Takeoff(2.0), *ROUND, model.Land())
    sky.flight = pending(sky.flight)
    sky.ask(StartMission(None))
    sky.ask(Arm(True, False))
    if not isinstance(wish, TakeOff | Pause):
        sky.flight = replace(sky.flight, phase=Phase.HOLD)
    assert sky.ask(wish).result == ACCEPTED
    assert not sky.flight.mission.waiting
