"""A vehicle or load far off its path: out of control, too weak for its path, or too weak for the wind."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from autopilot.geometry.linear import IDENTITY, ZERO, Mat3, Vec3, add, norm, scale, sub
from autopilot.guidance.legs import LagWait
from autopilot.guidance.setpoint_follower import UNSPECIFIED
from autopilot.services import identity
from autopilot.services.requests import FollowSetpoint, Pause, Release, Reposition, SetMode
from autopilot.supervisor.advance import advance
from autopilot.supervisor.state import CARRYING, Flight, MissionPlan, MissionProgress, Phase, Report, View
from autopilot.supervisor.watches.failsafe import OUT_OF_CONTROL_US
from autopilot.wire.dialect.plumbline import MAV_SEVERITY_EMERGENCY, MAV_SEVERITY_ERROR
from missions import model
from missions.model import Signals, Sine, Speed, Step, Takeoff, Term, Waypoint
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, HeadWind, Sky, entered, hanging
from tests.supervisor.test_advance import start

HERE = (1.0, 0.0, 2.0)
LIMIT_M = SETTINGS.failsafe.load_error_limit_m
OUTWARD = (1.0, 0.0, 0.0)  # m/s
FAR = (HERE[0] + LIMIT_M + 0.1, HERE[1], HERE[2])
AT_REST = (Phase.LIFT, Phase.HOLD, Phase.MISSION)


def at_rest(phase: Phase = Phase.HOLD) -> Flight:
    """A flight in which the load should rest at HERE."""
    plan = MissionPlan((Takeoff(2.0), model.Delay(9.0)), (0, 1), 2)
    progress = MissionProgress(plan=plan, step=1, active=True, takeoff_altitude_m=HERE[2], speed_m_s=1.0)
    return entered(Flight(phase=phase, mission=progress), phase, hanging(x=HERE), SETTINGS)


def leaning(x: float) -> Mat3:
    """Attitude of a vehicle whose thrust leans 0.5 rad, eastward for x = 1 and westward for x = -1."""
    c, s = math.cos(0.5), x * math.sin(0.5)
    return ((c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c))


@pytest.mark.parametrize("phase", AT_REST)
def test_one_that_is_carried_off_where_it_should_rest_lands(phase: Phase) -> None:
    after, report = advance(at_rest(phase), hanging(STEP_US, FAR, OUTWARD), SETTINGS)
    assert after.phase == Phase.LOWER
    assert not after.mission.active
    assert after.is_failsafe
    assert report.texts == (
        (MAV_SEVERITY_ERROR, "Failsafe: load 5.1 m off its path (FS_LOAD_ERR 5), landing"),
    )
    assert after.legs[0].jet(0.0)[:2] == (FAR, OUTWARD), "from where it is, as it moves"
    on, report = advance(after, hanging(2 * STEP_US, add(FAR, scale(9.0, OUTWARD)), OUTWARD), SETTINGS)
    assert (on.phase, report.texts) == (Phase.LOWER, ()), "the landing continues"


@pytest.mark.parametrize(("climb_m_s", "lands"), [(-4.0, True), (-1.0, False)])
def test_one_that_sinks_far_below_its_path_lands_before_the_path_has_stopped(
    climb_m_s: float, lands: bool
) -> None:
    plan = MissionPlan((Takeoff(20.0), Waypoint(90.0, 0.0, 20.0)), (0, 1), 2)
    progress = MissionProgress(plan=plan, step=1, active=True, takeoff_altitude_m=20.0, speed_m_s=5.0)
    begun = hanging(x=(0.0, 0.0, 20.0))
    flight = entered(Flight(phase=Phase.MISSION, mission=progress), Phase.MISSION, begun, SETTINGS)
    x, v = flight.legs[0].jet(10.0)[:2]
    below = (x[0] - 1.0, x[1], x[2] - LIMIT_M - 0.1)
    after, report = advance(flight, hanging(10_000_000, below, add(v, (0.0, 0.0, climb_m_s))), SETTINGS)
    (text,) = (text for _, text in report.texts)
    if lands:
        assert after.phase == Phase.LOWER
        assert text == "Failsafe: load 5.2 m off its path (FS_LOAD_ERR 5), sinking, landing"
    else:
        assert after.phase == Phase.MISSION
        assert text == "Path waits: load 5.2 m off its path (FS_LOAD_ERR 5)"


def test_one_that_comes_back_is_waited_for() -> None:
    flight = at_rest()
    after, report = advance(flight, hanging(STEP_US, FAR, (-1.0, 0.0, 0.0)), SETTINGS)
    assert (after, report.texts) == (flight, ())


def advance_for(time_us: int, flight: Flight, seen: View) -> tuple[Flight, Report]:
    """Advance with the same view until `time_us` after it; nothing is told before the last tick."""
    for now_us in range(seen.now_us, seen.now_us + time_us, STEP_US):
        flight, report = advance(flight, seen._replace(now_us=now_us), SETTINGS)
        assert report.texts == ()
    return advance(flight, seen._replace(now_us=seen.now_us + time_us), SETTINGS)


LOST: dict[str, dict[str, object]] = {
    "tilted": {"tilt_rad": math.radians(76.0)},
    "the load flies beside it": {"x_quad": (FAR[0] + 1.0, 0.0, FAR[2] + 0.2)},
    "the load flies above it": {"x_quad": (FAR[0], 0.0, FAR[2] - 1.0)},
}


@pytest.mark.parametrize("how", LOST)
@pytest.mark.parametrize("phase", sorted(CARRYING - {Phase.GUIDED}))
def test_one_that_is_out_of_control_is_given_up(phase: Phase, how: str) -> None:
    seen = hanging(STEP_US, FAR, OUTWARD)._replace(**LOST[how])
    after, report = advance_for(OUT_OF_CONTROL_US, at_rest(phase), seen)
    assert after.phase == Phase.FAILSAFE
    text = "Flight given up: load 5.1 m off its path (FS_LOAD_ERR 5), out of control"
    assert report.texts == ((MAV_SEVERITY_EMERGENCY, text),)


@pytest.mark.parametrize("how", LOST)
def test_one_that_is_out_of_control_for_a_moment_only_is_not_given_up(how: str) -> None:
    """Again and again for 50 ms, as in a gust."""
    flight, calm = at_rest(), hanging(STEP_US, FAR, (-1.0, 0.0, 0.0))
    for _ in range(10):
        flight, report = advance_for(50_000, flight, calm._replace(**LOST[how]))
        assert (flight.phase, report.texts) == (Phase.HOLD, ())
        flight, report = advance_for(50_000, flight, calm)
        assert (flight.phase, report.texts) == (Phase.HOLD, ())


def test_one_that_leans_far_against_a_strong_wind_is_not() -> None:
    """A `heavy` at 15 m/s against 17 m/s of wind leans by 61 degrees, and slows down as soon as it may."""
    seen = hanging(STEP_US, FAR, OUTWARD, tilt_rad=math.radians(61.0))
    after, _ = advance(at_rest(), seen, SETTINGS)
    assert after.phase == Phase.LOWER


@pytest.mark.parametrize(
    ("distance_m", "attitude", "v", "controlled"),
    [
        (10.1, leaning(1.0), OUTWARD, False),
        (10.1, leaning(1.0), (-1.0, 0.0, 0.0), True),
        (10.1, leaning(-1.0), OUTWARD, True),
        (10.1, IDENTITY, OUTWARD, True),
        (9.9, leaning(1.0), OUTWARD, True),
    ],
    ids=["pushes itself away", "brakes as it comes back", "pushes back", "level", "near"],
)
def test_one_that_pushes_itself_farther_and_farther_away_is_given_up(
    distance_m: float, attitude: Mat3, v: Vec3, controlled: bool
) -> None:
    far = (HERE[0] + distance_m, HERE[1], HERE[2])
    seen = hanging(STEP_US, far, v, attitude=attitude, tilt_rad=math.radians(45.0))
    after, report = advance_for(OUT_OF_CONTROL_US, at_rest(Phase.LOWER), seen)
    assert after.phase == (Phase.LOWER if controlled else Phase.FAILSAFE)
    assert ("out of control" in str(report.texts)) is not controlled


def head_wind(*steps: Step, most_m_s: float = 2.0) -> HeadWind:
    """One that lifts its load and flies these steps."""
    sky = HeadWind(*steps)
    sky.flight = start(*steps).flight
    sky.most_m_s = most_m_s
    return sky


FAST = (Takeoff(3.0), Speed(5.0), Waypoint(60.0, 0.0, 3.0), Waypoint(60.0, 30.0, 3.0))
SWING = Signals(40.0, (Term("x", 20.0, 0.5, 0.5, 39.0, 0.5, (Sine(20.0),)),))
WAITING = {
    "waypoints": (*FAST, model.Land()),
    "return": (*FAST, model.ReturnHome(), model.Land()),
    "released": (Takeoff(3.0), model.Release(), *FAST[1:], model.ReturnHome(), model.Land()),
    "signals": (Takeoff(3.0), SWING, model.Land()),
}


@pytest.mark.parametrize("name", WAITING)
def test_a_path_waits_for_one_that_is_too_slow_for_it(name: str) -> None:
    sky = head_wind(*WAITING[name])
    furthest = 0.0
    while sky.flight.phase != Phase.DISARMED:
        sky.tick()
        assert sky.now_us < 500_000_000, sky.texts
        if sky.flight.legs and sky.flight.phase == Phase.MISSION:
            place = sky.view.x_quad if sky.flight.cable.released else sky.view.x_load
            furthest = max(furthest, norm(sub(place, sky.setpoints[-1][2][0])))
    assert sky.reached == list(sky.flight.mission.plan.sequence)
    body = "vehicle" if name == "released" else "load"
    waits = [text for text in sky.texts if text.startswith(f"Path waits: {body} 5.0 m off its path")]
    assert waits
    assert sky.texts.count("Landed, disarmed") == 1
    assert ("Near the path again, flying on" in sky.texts) == (name == "signals")
    assert LIMIT_M < furthest < 5.0 * LIMIT_M


def test_a_path_that_waited_is_flown_more_slowly() -> None:
    sky = head_wind(*WAITING["waypoints"])
    sky.run(lambda s: s.flight.legs != () and isinstance(s.flight.legs[0], LagWait))
    sky.run(lambda s: s.flight.legs != () and not isinstance(s.flight.legs[0], LagWait))
    assert sky.texts[-1] == "Near the path again, flying on at 3.5 m/s"
    assert sky.flight.mission.speed_m_s == pytest.approx(3.5)
    assert sky.flight.mission.requested_speed_m_s == pytest.approx(5.0)
    assert norm(sub(sky.view.x_load, sky.setpoints[-2][2][0])) <= 0.5 * LIMIT_M
    assert sky.flight.mission.step == 2, "the same step"
    jets = [jet for _, _, jet in sky.setpoints]
    steps = [norm(sub(b[0], a[0])) for a, b in pairwise(jets)]
    assert max(steps[-400:]) < 5.1 * STEP_US * 1e-6, "without a jump"


def test_one_that_waits_can_be_paused() -> None:
    sky = head_wind(*WAITING["waypoints"])
    sky.run(lambda s: s.flight.legs != () and isinstance(s.flight.legs[0], LagWait))
    sky.ask(Pause())
    sky.run(lambda s: norm(sub(s.view.x_load, s.flight.legs[-1].jet(99.0)[0])) < 0.1)
    assert sky.flight.phase == Phase.HOLD
    assert not any(text.startswith("Near the path") for text in sky.texts)


def test_a_place_that_was_requested_is_not_flown_to_any_more() -> None:
    sky = HeadWind()
    sky.take_off()
    assert sky.ask(Reposition(60.0, 0.0, 3.0, True, speed_m_s=5.0)).result == ACCEPTED
    sky.run(lambda s: any("Failsafe" in text for text in s.texts))
    assert sky.texts[-1] == "Failsafe: load 5.0 m off its path (FS_LOAD_ERR 5), holding"
    sky.wait(30.0)
    assert sky.flight.phase == Phase.HOLD
    assert sum("Failsafe" in text for text in sky.texts) == 1
    assert sky.view.v_load == ZERO


def test_setpoints_are_not_followed_any_more() -> None:
    sky = HeadWind()
    sky.take_off()
    east = FollowSetpoint(UNSPECIFIED, (5.0, 0.0, 0.0), UNSPECIFIED, False)
    assert sky.ask(east).result == ACCEPTED
    assert sky.ask(SetMode(identity.OFFBOARD, 0)).result == ACCEPTED
    while sky.flight.phase == Phase.GUIDED:
        assert sky.now_us < 60_000_000
        sky.ask(east)
        sky.tick()
    assert sky.texts[-1] == "Failsafe: load 5.0 m off its path (FS_LOAD_ERR 5), holding"
    sky.wait(20.0)
    assert (sky.flight.phase, sky.view.v_load) == (Phase.HOLD, ZERO)


def test_a_vehicle_alone_is_judged_by_itself() -> None:
    sky = Sky().airborne()
    sky.ask(Release())
    sky.wait(1.0)
    x = sky.view.x_quad
    off = sky.view._replace(x_quad=(x[0] + 5.1, x[1], x[2]), v_quad=OUTWARD, now_us=sky.now_us + STEP_US)
    after, report = advance(sky.flight, off, SETTINGS)
    assert after.phase == Phase.LOWER
    assert report.texts[0][1] == "Failsafe: vehicle 5.1 m off its path (FS_LOAD_ERR 5), landing"
