"""The timeline of a mission agrees with the flight; by it, missions are refused before flight."""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate
from math import cos, dist, sin
from typing import Any

import pytest

from autopilot.core.flight_core import with_cable_now
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.services.requests import Arm, Pause, ReplaceMission, Reposition, SetCurrent, StartMission
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.state import Phase
from autopilot.trajectory.prepare import prepare
from autopilot.trajectory.timeline import MissionState, state_after, timeline
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.fence import Disc, Fence, Polygon
from autopilot.wire.items import LocatedStep
from missions.model import (
    AttitudeRun,
    Axis,
    Delay,
    Land,
    Release,
    ReturnHome,
    Signals,
    Speed,
    Step,
    Takeoff,
    Term,
    Trajectory,
    Waypoint,
    Winch,
)
from tests.doubles.sky import ACCEPTED, LOAD_RADIUS, SETTINGS, Sky

DENIED = m.MAV_RESULT_DENIED
HOME, RALLY = (2.0, -1.0, 0.0), ((3.0, 1.0, 0.0),)
STOOD_AT = (0.5, 0.25, LOAD_RADIUS)
AWAY = Signals(5.0, (Term("x", -1.5, 0.0, 4.0, None, 0.0),))
RUN = AttitudeRun("load", 0.1, 0.0, 1.5)

# ---- the timeline agrees with the flight

FLOWN: dict[str, tuple[Step, ...]] = {
    "waypoints and a return": (
        Takeoff(2.0),
        Waypoint(3.0, 0.0, 2.0, 1.0),
        Speed(2.0),
        Waypoint(3.0, 2.0, 3.0),
        Waypoint(1.0, 3.0, 2.5),
        Waypoint(0.0, 2.0, 2.0),
        ReturnHome(),
        Delay(0.5),
        Land(),
    ),
    "signals that lead away": (
        Takeoff(2.0),
        Delay(1.0),
        AWAY,
        AWAY,
        Waypoint(0.0, 0.0, 2.0),
        AWAY,
        ReturnHome(),
    ),
    "up in the air": (Takeoff(2.0), Waypoint(2.0, 0.0, 2.0), Takeoff(4.0), Delay(0.2), ReturnHome(), Land()),
    "the winch": (
        Takeoff(2.0),
        Winch(0.5),
        Waypoint(2.0, 0.0, 2.0),
        Winch(0.3, 0.2),
        ReturnHome(),
        Winch(-0.6),
        Land(),
    ),
    "a delivery": (
        Takeoff(2.0),
        Waypoint(2.0, 0.0, 2.0),
        Winch(0.6),
        Release(),
        Delay(0.5),
        ReturnHome(),
        Waypoint(-1.0, 0.0, 3.0),
        Land(),
    ),
    "attitude runs": (Takeoff(2.0), RUN, RUN, Waypoint(1.0, 0.0, 2.0), ReturnHome(), Land()),
}


def flown(sky: Sky) -> list[Vec3]:
    """Where each step of a mission ends, according to the legs of the flight."""
    plan = sky.flight.mission.plan
    found: list[Vec3] = []
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    while len(found) < len(plan.steps):
        before = sky.flight
        sky.tick()
        sky.flight = with_cable_now(sky.flight, sky.now_us)
        if sky.flight.cable.length_m is not None:
            sky.settings = replace(sky.settings, cable_length_m=sky.flight.cable.length_m)
        here = sky.view.x_quad if before.cable.released else sky.view.x_load
        last = before.legs[-1] if before.legs else None
        ended = here if last is None or last.duration_s > 1e6 else last.jet(last.duration_s)[0]
        # of several steps that end in one tick, all but the first take no time
        found += [ended] * (len(sky.reached) - len(found))
        assert sky.now_us < 400e6, (sky.flight.phase, sky.flight.mission.step)
    return found


@pytest.mark.parametrize("steps", FLOWN.values(), ids=FLOWN)
def test_every_step_ends_where_the_timeline_says(steps: tuple[Step, ...]) -> None:
    sky = Sky(*steps)
    area = replace(sky.flight.area, home=HOME, rally=RALLY)
    plan = sky.flight.mission.plan
    prepared = prepare(plan.steps, plan.sequence, SETTINGS.limits, HOME)
    sky.flight = replace(with_plan(sky.flight, replace(plan, prepared=prepared)), area=area)
    sky.view = sky.view._replace(x_load=STOOD_AT)
    start = MissionState(STOOD_AT, cable_m=SETTINGS.cable_length_m)
    expected = list(timeline(plan.steps, start, HOME))
    drifted = list(accumulate(isinstance(step, AttitudeRun) for step in plan.steps))
    compared = 0
    for entry, there, runs in zip(expected, flown(sky), drifted, strict=True):
        lands = isinstance(entry.step, Land) or (entry is expected[-1] and isinstance(entry.step, ReturnHome))
        if lands:
            apart = 0.5 * SETTINGS.cable_length_m + 0.1 if entry.after.released else 1e-6
            assert there[:2] == pytest.approx(entry.end[:2], abs=apart)
        elif entry.after.position is not None or not runs:
            assert there == pytest.approx(entry.end, abs=1e-6), entry
            compared += 1
    assert compared >= 3
    if any(isinstance(step, Winch) for step in steps):
        assert sky.settings.cable_length_m == pytest.approx(expected[-1].after.cable_m, abs=1e-9)


# ---- the fence before flight

# a square, and in it a disc to the north of home
SQUARE = Polygon(True, ((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)))
FENCE = Fence((SQUARE, Disc(False, (0.0, 3.0), 1.0)))
AROUND = (Takeoff(2.0), Waypoint(3.0, 0.0, 2.0), Waypoint(3.0, 4.5, 2.0), Waypoint(0.0, 4.5, 2.0))
ZONE, OUTSIDE = "into an exclusion zone of the fence", "outside the fence"


def fenced(*steps: Step, home: Vec3 = ZERO, fence: Fence = FENCE, **changes: Any) -> Sky:
    settings = replace(SETTINGS, fence=replace(SETTINGS.fence, **changes))
    sky = Sky(*steps, settings=settings)
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=fence, home=home))
    return sky


def uploaded(sky: Sky, *steps: Step) -> str | None:
    """The text that answers an upload of the steps."""
    located = tuple(LocatedStep(i, i, step) for i, step in enumerate(steps))
    return sky.ask(ReplaceMission(len(steps), located)).text


@pytest.mark.parametrize(
    ("home", "why"),
    [
        (ZERO, ZONE),  # straight through the disc
        ((0.5, 2.5, 0.0), ZONE),  # into it
        ((-8.0, 4.5, 0.0), OUTSIDE),
        ((4.0, 4.0, 0.0), ""),
    ],
)
def test_a_return_over_the_fence_is_refused_at_upload_and_at_start(home: Vec3, why: str) -> None:
    for end in ((), (Land(),)):
        sky = fenced(*AROUND, ReturnHome(), *end, home=home)
        text = f"Mission denied: item 4 leads {why}" if why else None
        assert (uploaded(sky, *AROUND, ReturnHome(), *end) or None) == text
        sky.ask(Arm(True, False))
        verdict = sky.ask(StartMission(None))
        assert (verdict.result, verdict.text or None) == (DENIED if why else ACCEPTED, text)


@pytest.mark.parametrize(
    ("steps", "problem"),
    [
        ((Takeoff(0.02), Land()), "item 0: load height 0.02 m, min 0.3 m"),
        ((Takeoff(2.0), Waypoint(1.0, 0.0, 0.29), Land()), "item 1: load height 0.29 m, min 0.3 m"),
        ((Takeoff(0.3), Waypoint(1.0, 0.0, 0.3), Land()), ""),
        ((Takeoff(2.0), Release(), Waypoint(1.0, 0.0, 0.2), Land()), ""),  # of the vehicle, without the load
    ],
)
def test_no_item_leads_lower_than_another_request_may(steps: tuple[Step, ...], problem: str) -> None:
    sky = Sky(*steps)
    text = f"Mission denied: {problem}" if problem else None
    assert (uploaded(sky, *steps) or None) == text
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    verdict = sky.ask(StartMission(None))  # of a mission that was stored before
    assert (verdict.result, verdict.text or None) == (DENIED if problem else ACCEPTED, text)


def test_a_return_among_the_steps_leads_home_past_a_nearer_rally_point() -> None:
    """As in flight: only a return by mode leads to a rally point."""
    sky = fenced(*AROUND, ReturnHome())
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, rally=((1.0, 4.5, 0.0),)))
    assert uploaded(sky, *AROUND, ReturnHome()) == f"Mission denied: item 4 leads {ZONE}"


def test_no_return_is_refused_where_no_fence_is_heeded() -> None:
    sky = fenced(*AROUND, ReturnHome(), action=0)
    assert not uploaded(sky, *AROUND, ReturnHome())


def test_the_way_begins_where_the_load_stands() -> None:
    steps = (Takeoff(2.0), Waypoint(-3.0, 3.0, 2.0), Land())
    sky = fenced(*steps)
    assert not uploaded(sky, *steps)
    sky.view = sky.view._replace(x_load=(3.0, 3.0, LOAD_RADIUS), x_quad=(3.1, 3.0, 0.06))
    assert uploaded(sky, *steps) == f"Mission denied: item 1 leads {ZONE}"
    assert sky.ask(StartMission(None)).text == f"Mission denied: item 1 leads {ZONE}"
    # an estimate that is not available yet is not used
    sky.view = sky.view._replace(estimate_problems=("position not settled",))
    assert not uploaded(sky, *steps)


def test_the_paths_of_signals_and_trajectories_are_checked_and_the_next_way_begins_at_their_end() -> None:
    """North of home are a zone of radius 1 m at 3 m and the end of the square at 5 m."""

    def signals(*terms: tuple[Axis, float, float | None]) -> Signals:
        return Signals(20.0, tuple(Term(axis, m, 0.0, 4.0, hold_s, 4.0) for axis, m, hold_s in terms))

    def through(*places: tuple[float, float]) -> Trajectory:
        return Trajectory([(3.0 * k, *place, 0.0) for k, place in enumerate(((0.0, 0.0), *places))])

    for path, why in (
        (signals(("y", 4.5, None)), ZONE),  # ends behind the zone
        (signals(("y", 4.5, 2.0)), ZONE),  # ends at home
        (signals(("x", 6.0, 2.0)), OUTSIDE),
        (signals(("x", 4.0, 2.0), ("y", 1.5, None)), ""),
        (through((0.0, 4.5), (0.0, 0.0)), ZONE),
        (through((0.0, -6.0), (0.0, 0.0)), OUTSIDE),
        (through((2.0, 3.0), (0.0, 4.5)), ""),
    ):
        text = uploaded(fenced(), Takeoff(2.0), path, Land())
        assert (text or "").startswith(f"Mission denied: item 1 leads {why} after " if why else "")
        assert bool(text) == bool(why)
    beside = through((2.0, 3.0), (0.0, 4.5))
    text = uploaded(fenced(), Takeoff(2.0), beside, Waypoint(0.0, 1.0, 2.0), Land())
    assert text == f"Mission denied: item 2 leads {ZONE}"


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        (
            {"fence": Fence((Disc(True, (0.0, 0.0), 2.9),))},
            "outside the fence after 3.9 s; worst at 6.0 s: 1.10 m from its edge",
        ),
        (
            {"fence": Fence((Polygon(False, ((-9.0, 1.9), (9.0, 1.9), (9.0, 9.0), (-9.0, 9.0))),))},
            "into an exclusion zone of the fence after 3.0 s; worst at 6.0 s: 2.10 m from its edge",
        ),
        (
            {"fence": Fence(), "radius_m": 2.9},
            "beyond the fence, GF_MAX_HOR_DIST 2.9 m from home after 3.9 s; worst at 6.0 s: 4.00 m from home",
        ),
        (
            {"fence": Fence(), "height_m": 3.0},
            "beyond the fence, GF_MAX_VER_DIST 3 m above home after 2.3 s; worst at 6.0 s: vehicle at 3.70 m",
        ),
    ],
    ids=["out", "in", "far", "high"],
)
def test_a_path_beyond_the_fence_is_told_with_when_and_where_it_is_worst(
    limits: dict[str, Any], told: str
) -> None:
    """4 m north and 1 m up within 6 s, and back: along half a cosine it has gone the share s of the way after
    6 acos(1 - 2 s) / pi s, which the check sees within the next 0.1 s."""
    out_and_back = Signals(12.0, (Term("y", 4.0, 0.0, 6.0, 0.0, 6.0), Term("z", 1.0, 0.0, 6.0, 0.0, 6.0)))
    text = uploaded(fenced(**limits), Takeoff(2.0), Waypoint(0.0, 0.0, 2.0), out_and_back, Land())
    assert text == f"Mission denied: item 2 leads {told}, load at N 4.0 E 0.0, 3.0 m up"


@pytest.mark.parametrize(
    "zone", [Disc(True, (1.0, 2.0), 3.0), Polygon(True, ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0)))]
)
def test_the_edge_of_a_zone_is_as_near_as_its_nearest_point(zone: Disc | Polygon) -> None:
    turns = [0.001 * k for k in range(6284)]
    shares = [0.0005 * k for k in range(2001)]
    edge = (
        [(1.0 + 3.0 * cos(turn), 2.0 + 3.0 * sin(turn)) for turn in turns]
        if isinstance(zone, Disc)
        else [
            (x + share * (u - x), y + share * (v - y))
            for (x, y), (u, v) in zip(zone.corners, zone.corners[1:] + zone.corners[:1], strict=True)
            for share in shares
        ]
    )
    for place in ((5.0, 5.0), (1.0, 1.0), (2.0, 1.0), (-3.0, 0.5), (3.0, -7.0)):
        nearest = min(dist(place, other) for other in edge)
        assert zone.distance_to_edge(*place) == pytest.approx(nearest, abs=2e-3)


BEYOND = "Mission denied: item 2 leads beyond the fence, GF_MAX_VER_DIST 3 m above home"


def test_a_longer_cable_needs_more_height_and_a_released_load_less() -> None:
    """A fence height of 3 m applies to the vehicle, which is 0.7 m above the load."""
    high = Waypoint(1.0, 0.0, 2.2)
    low = {"height_m": 3.0, "fence": Fence()}
    assert not uploaded(fenced(**low), Takeoff(2.0), high, Land())
    text = uploaded(fenced(**low), Takeoff(2.0), Winch(0.5), high, Land())
    assert text.startswith(f"{BEYOND} (vehicle at 3.")
    alone = Waypoint(1.0, 0.0, 2.9)
    assert uploaded(fenced(**low), Takeoff(2.0), alone) is not None
    assert not uploaded(fenced(**low), Takeoff(2.0), Release(), alone, ReturnHome())
    text = uploaded(fenced(**low), Takeoff(2.0), Release(), Waypoint(1.0, 0.0, 3.1))
    assert text.startswith(f"{BEYOND} (vehicle at 3.")


def test_in_the_air_the_way_from_here_counts_at_the_start_and_not_at_the_upload() -> None:
    steps = (Waypoint(0.0, 4.5, 2.0), Land())
    sky = fenced(*steps).airborne()
    assert not uploaded(sky, *steps)
    before = sky.flight
    assert sky.ask(StartMission(None)).text == f"Mission denied: item 0 leads {ZONE}"
    assert sky.flight == before
    assert sky.ask(Reposition(3.0, 0.0, 2.0, True)).result == ACCEPTED
    sky.wait(8.0)
    assert sky.ask(Reposition(3.0, 4.5, 2.0, True)).result == ACCEPTED
    sky.wait(8.0)
    assert sky.ask(StartMission(None)).result == ACCEPTED


def test_a_mission_that_begins_outside_may_lead_back() -> None:
    sky = fenced(Waypoint(1.0, 0.0, 2.0), Land()).airborne()
    beyond = Fence((Disc(True, (4.0, 0.0), 3.5),))
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=beyond))
    assert sky.ask(StartMission(None)).result == ACCEPTED


def test_another_item_is_not_jumped_to_over_the_fence() -> None:
    steps = (*AROUND, Waypoint(3.0, 4.5, 2.0), Waypoint(3.0, 0.0, 2.0), Waypoint(0.0, 0.0, 2.0), Land())
    sky = fenced(*steps)
    sky.ask(StartMission(None))
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.run(lambda s: s.flight.mission.step == 4)
    before = sky.flight
    verdict = sky.ask(SetCurrent(6))
    assert (verdict.result, verdict.text) == (DENIED, f"Mission item 6 denied: item 6 leads {ZONE}")
    assert sky.flight == before
    assert sky.ask(SetCurrent(7)).result == ACCEPTED, "to land where it is"


@pytest.mark.parametrize("phase", [Phase.TAUTEN, Phase.LIFT])
def test_while_it_takes_off_another_item_is_checked_like_the_mission(phase: Phase) -> None:
    steps = (*AROUND, Waypoint(3.0, 4.5, 2.0), Waypoint(3.0, 0.0, 2.0), Waypoint(0.0, 0.0, 2.0), Land())
    sky = fenced(*steps)
    sky.ask(StartMission(None))
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == phase)
    before = sky.flight
    verdict = sky.ask(SetCurrent(3))
    assert (verdict.result, verdict.text) == (DENIED, f"Mission item 3 denied: item 3 leads {ZONE}")
    assert sky.flight == before
    assert sky.ask(SetCurrent(5)).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.MISSION)
    assert sky.flight.mission.step == 5


# ---- winch and release before flight


def test_a_winch_that_would_leave_the_load_too_low_from_here_is_refused() -> None:
    sky = Sky(Takeoff(2.0), Winch(1.2), Land()).airborne()
    assert sky.ask(Reposition(None, None, 1.0, True)).result == ACCEPTED
    sky.wait(8.0)
    verdict = sky.ask(StartMission(1))
    assert verdict.result == DENIED
    assert verdict.text == "Mission denied: item 1: load height -0.20 m, min 0.3 m"
    assert sky.ask(StartMission(0)).result == ACCEPTED, "the take-off lifts it again"


def test_a_winch_that_is_taken_up_again_counts_with_what_is_left_of_it() -> None:
    """Paused on the way from 0.7 m to 2.2 m; another 1.5 m from there would be too long."""
    sky = Sky(Takeoff(3.0), Winch(1.5), Land())
    sky.ask(StartMission(None))
    assert sky.ask(Arm(True, False)).result == ACCEPTED

    def tick() -> None:
        sky.tick()
        sky.flight = with_cable_now(sky.flight, sky.now_us)
        length = sky.flight.cable.length_m or SETTINGS.cable_length_m
        sky.settings = replace(sky.settings, cable_length_m=length)

    while sky.settings.cable_length_m < 1.8:
        tick()
    assert sky.ask(Pause()).result == ACCEPTED
    for _ in range(250):
        tick()
    assert sky.flight.phase == Phase.HOLD
    assert sky.settings.cable_length_m + 1.5 > sky.settings.winch.max_length_m
    assert sky.ask(StartMission(None)).result == ACCEPTED


def test_what_swings_a_load_that_a_step_before_it_releases_is_refused() -> None:
    steps = (Takeoff(2.0), Release(), Winch(0.3), Land())
    sky = Sky(Takeoff(2.0))
    plan = sky.flight.mission.plan
    for late, text in ((Winch(0.3), "item 2 needs the load"), (RUN, "item 2 needs the load")):
        changed = (*steps[:2], late, steps[3])
        sky.flight = with_plan(sky.flight, replace(plan, steps=changed, sequence=(0, 1, 2, 3), item_count=4))
        assert text in str(sky.ask(StartMission(None)).text)


def test_a_leg_asks_the_timeline_where_it_leads() -> None:
    """It leads to the home in force, not to the origin."""
    sky = Sky(Takeoff(2.0), ReturnHome())
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, home=HOME))
    sky.ask(StartMission(None))
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.run(lambda s: s.flight.mission.step == 1)
    end = sky.flight.legs[-1].jet(1e3)[0]
    assert end == state_after(ReturnHome(), MissionState((0.0, 0.0, 2.0)), HOME).expected
