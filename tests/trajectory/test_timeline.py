"""Where the load is after each step of a mission, where that is unknown, and how long the mission should
take."""

from __future__ import annotations

from itertools import pairwise

import pytest

from autopilot.trajectory.feasibility import VehicleLimits
from autopilot.trajectory.peaks import survey_transfer
from autopilot.trajectory.prepare import prepare
from autopilot.trajectory.ramp import PEAK_RAMP_ACCEL
from autopilot.trajectory.slack_cable import set_down_duration_s
from autopilot.trajectory.timeline import (
    ANYWHERE,
    RELEASE_S,
    USUAL_CABLE_M,
    MissionState,
    VerticalSpeeds,
    expected_duration_s,
    expected_timeline,
    min_move_duration,
    return_place,
    state_after,
    timeline,
)
from autopilot.trajectory.transfer import pace, transfer_duration
from autopilot.trajectory.waypoint_path import PathSegment
from autopilot.vehicle.file import load_vehicle
from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    Mission,
    Release,
    ReturnHome,
    Signals,
    Speed,
    Step,
    Takeoff,
    Term,
    Waypoint,
    Winch,
)

HOME = (4.0, -3.0, 0.0)
HERE = MissionState(expected=(1.0, 2.0, 3.0), cable_m=0.7, speed_m_s=1.0)
AWAY = Signals(5.0, (Term("x", 2.0, 0.0, 4.0, None, 0.0), Term("z", 0.5, 0.0, 1.0, 1.0, 1.0)))
UNFINISHED = Signals(2.0, AWAY.terms)  # cut off halfway, at full speed
RUN = AttitudeRun("load", 0.1, 0.0, 1.5)


@pytest.mark.parametrize(
    ("step", "position"),
    [
        (Takeoff(5.0), (1.0, 2.0, 5.0)),
        (Waypoint(7.0, 8.0, 9.0, 1.0), (7.0, 8.0, 9.0)),
        (Delay(3.0), (1.0, 2.0, 3.0)),
        (Speed(2.0), (1.0, 2.0, 3.0)),
        (ReturnHome(), (4.0, -3.0, 3.0)),
        (AWAY, (3.0, 2.0, 3.0)),
        (Winch(0.5), (1.0, 2.0, 2.5)),
        (Winch(-0.25), (1.0, 2.0, 3.25)),
        (Land(), (1.0, 2.0, 0.0)),
        (RUN, None),
        (UNFINISHED, None),
        (Release(), None),
    ],
)
def test_where_a_step_leaves_the_load(step: Step, position: tuple[float, float, float] | None) -> None:
    assert state_after(step, HERE, HOME).position == position


@pytest.mark.parametrize(
    ("steps", "told"),
    [
        ((RUN,), "an attitude run"),
        ((UNFINISHED,), "signals that end in motion"),
        ((RUN, UNFINISHED, Delay(1.0)), "signals that end in motion"),
        ((RUN, AWAY), "an attitude run"),
        ((Release(),), "a release"),
        ((Release(), Waypoint(1.0, 1.0, 2.0), Land()), "a landing beside the load"),
        ((RUN, Waypoint(1.0, 1.0, 2.0)), ""),
    ],
)
def test_what_makes_the_position_unknown_is_named(steps: tuple[Step, ...], told: str) -> None:
    assert [entry.after.unknown_after for entry in timeline(steps, HERE)][-1] == told


def test_what_else_a_step_changes() -> None:
    assert state_after(Speed(2.0), HERE).speed_m_s == 2.0
    assert state_after(Winch(0.5), HERE).cable_m == pytest.approx(1.2)
    assert state_after(Winch(0.5), ANYWHERE).cable_m is None, "a length that was not told stays untold"
    assert [state_after(step, HERE).released for step in (Release(), Winch(0.5), Land())] == [
        True,
        False,
        False,
    ]


def test_a_release_leaves_the_vehicle_a_cable_length_above_the_load() -> None:
    steps = (Takeoff(2.0), Winch(0.5), Release(), Delay(1.0), ReturnHome(), Waypoint(5.0, 0.0, 4.0), Land())
    found = list(timeline(steps, MissionState(cable_m=0.7), HOME))
    let_go = found[2].after
    assert let_go.expected == pytest.approx((0.0, 0.0, 1.5 + 1.2))
    assert let_go.position is None, "a setpoint leads nowhere yet"
    assert (found[2].transfer_s, found[2].duration_s) == (0.0, RELEASE_S)
    assert found[4].end == pytest.approx((4.0, -3.0, 2.7))
    assert found[4].after.position is None, "at the height that it has"
    assert found[5].after.position == (5.0, 0.0, 4.0)
    assert found[6].after.position is None, "beside the load, if that lies there"


def test_the_drift_of_an_attitude_run_ends_at_the_next_waypoint() -> None:
    steps = (
        Takeoff(2.0),
        RUN,
        Delay(1.0),
        Takeoff(3.0),
        ReturnHome(),
        AWAY,
        Waypoint(1.0, 1.0, 2.0),
        Delay(1.0),
    )
    found = list(timeline(steps, MissionState(), HOME))
    assert [entry.after.position is None for entry in found] == [False, *[True] * 5, False, False]
    assert found[5].end == pytest.approx((6.0, -3.0, 3.0)), "what is expected goes on"


def test_from_an_unknown_place_only_what_names_a_place_is_known() -> None:
    for step in (ReturnHome(), Delay(1.0), AWAY, Winch(0.2), Land(), Release()):
        assert state_after(step, ANYWHERE, HOME).expected is None
    assert state_after(Takeoff(2.0), ANYWHERE, HOME).position == (0.0, 0.0, 2.0)
    assert state_after(Waypoint(1.0, 2.0, 3.0), ANYWHERE).position == (1.0, 2.0, 3.0)
    (entry,) = timeline((Waypoint(100.0, 0.0, 2.0, 4.0),), ANYWHERE)
    assert (entry.transfer_s, entry.duration_s) == (0.0, 4.0), "nobody knows how far it is"


def test_states_join_and_a_return_says_where_it_leads() -> None:
    steps = (Takeoff(2.0), Speed(0.5), Waypoint(4.0, 0.0, 2.0), ReturnHome(), Land())
    found = list(timeline(steps, MissionState(), HOME, 1.0))
    assert [entry.item for entry in found] == [0, 1, 2, 3, 4]
    assert all(a.after == b.before for a, b in pairwise(found))
    assert [entry.home for entry in found] == [None, None, None, HOME, None]
    least_s = min_move_duration(USUAL_CABLE_M, 9.81)
    assert found[2].transfer == pace(4.0, 0.5, 1.0, least_s)
    assert found[3].transfer == pace(3.0, 0.5, 1.0, least_s)


def test_a_return_by_mode_leads_to_the_nearest_of_home_and_rally_points() -> None:
    rally = ((10.0, 0.0, 0.0), (0.0, 9.0, 0.0))
    assert return_place((8.0, 1.0, 500.0), HOME, rally) == rally[0], "heights do not count"
    assert return_place((4.0, 0.0, 2.0), HOME, rally) == HOME
    assert return_place((8.0, 1.0, 2.0), HOME, ()) == HOME


# ---- the paths that are prepared

WITHOUT_DRAG = load_vehicle("bebop").model_copy(
    update={"quad_drag_n_s_m": 0.0, "quad_drag_quadratic_n_s2_m2": 0.0}
)
LIMITS = VehicleLimits(WITHOUT_DRAG).shaping
CORNERS = (Waypoint(3.0, 0.0, 2.0), Waypoint(3.0, 3.0, 2.0))


def passages(*steps: Step, home: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> list[PathSegment | None]:
    made = prepare(steps, range(len(steps)), LIMITS, home).paths
    return [one if isinstance(one, PathSegment) else None for one in made]


def test_a_path_through_waypoints_begins_at_the_home_that_is_set() -> None:
    found = passages(Takeoff(2.0), ReturnHome(), *CORNERS, home=HOME)
    assert found[2] is not None and found[2].start == (4.0, -3.0, 2.0)


def test_a_path_through_waypoints_begins_where_the_winch_left_the_load() -> None:
    found = passages(Takeoff(2.0), Winch(0.5), *CORNERS)
    assert found[2] is not None and found[2].start == (0.0, 0.0, 1.5)


@pytest.mark.parametrize("step", [RUN, Release()])
def test_a_path_through_waypoints_does_not_begin_where_nobody_knows(step: Step) -> None:
    assert passages(Takeoff(2.0), step, *CORNERS) == [None] * 4


def test_the_least_time_of_a_return_is_that_of_the_way_to_the_home_that_is_set() -> None:
    weak = LIMITS._replace(bounds=LIMITS.bounds._replace(rotor_high=1.24), accel_m_s2=2.5, speed_m_s=15.0)
    far = (20.0, 0.0, 0.0)
    least = prepare((Takeoff(5.0), ReturnHome()), range(2), weak, far).min_durations_s[1]
    usual = pace(20.0, 15.0, 2.5, min_move_duration(weak.body.cable_length, weak.body.gravity))
    assert least > usual.duration_s
    along = survey_transfer((0.0, 0.0, 5.0), (20.0, 0.0, 5.0), usual.stretched(least), weak.body)
    assert along.rotor_high.value <= 1.24
    assert prepare((Takeoff(5.0), ReturnHome()), range(2), weak).min_durations_s[1] == 0.0, (
        "there is no way to go"
    )


# ---- how long it takes


def seconds(*steps):
    return expected_duration_s(Mission("m", "", "", (), (Takeoff(2.0), *steps, Land())))


def test_what_has_a_duration_counts_with_it():
    term = Term("x", 1.0, 0.0, 5.0, None, 0.0)
    longer = seconds(Signals(50.0, (term,)), Delay(30.0)) - seconds(Signals(10.0, (term,)), Delay(3.0))
    assert longer == pytest.approx(67.0)
    held = seconds(Waypoint(5.0, 0.0, 2.0, hold_s=4.0)) - seconds(Waypoint(5.0, 0.0, 2.0))
    assert held == pytest.approx(4.0)


def test_a_long_cable_is_tautened_and_set_down_for_minutes():
    """Measured in flights of `hover` with `bebop` on longer cables: tauten and set_down, in s."""
    hover = Mission("m", "", "", (), (Takeoff(2.0), Land()))
    usual = expected_duration_s(hover)
    for cable_m, tauten_s, set_down_s in ((20.0, 58.0, 58.0), (60.0, 152.0, 150.1)):
        lift_s = 2.0 * max(transfer_duration(2.0, 0.8, 1.5), min_move_duration(cable_m, 9.81))
        assert expected_duration_s(hover, cable_m=cable_m) == pytest.approx(
            lift_s + tauten_s + set_down_s, rel=0.05
        )
    assert expected_duration_s(hover, cable_m=0.7) == usual < 40.0
    slow = expected_duration_s(hover, cable_m=10.0, vertical=VerticalSpeeds(0.02, 0.8))
    assert slow - expected_duration_s(hover, cable_m=10.0) == pytest.approx(4.0 / 0.02 - 4.0 / 0.15)


def test_a_vehicle_without_its_load_lands_at_once():
    def landing_s(*steps: Step) -> float:
        mission = Mission("m", "", "", (), (Takeoff(2.0), *steps, Waypoint(0.0, 0.0, 2.0), Land()))
        return expected_timeline(mission, cable_m=2.0)[-1].duration_s

    assert landing_s() - landing_s(Release()) == pytest.approx(set_down_duration_s(2.0))


def test_half_the_speed_takes_twice_as_long():
    """Beside the ramps, which are the shorter the slower it is."""
    there = Waypoint(1000.0, 0.0, 2.0)
    rest = seconds(Speed(1.0), Waypoint(0.0, 0.0, 2.0))
    slow, fast = (seconds(Speed(speed), there) - rest for speed in (1.0, 2.0))
    least_s = min_move_duration(USUAL_CABLE_M, 9.81)
    assert slow == pytest.approx(1000.0 + least_s)
    assert fast == pytest.approx(500.0 + PEAK_RAMP_ACCEL * 2.0 / 1.5)


def test_a_place_is_left_from_where_the_load_is():
    out_and_back = seconds(Waypoint(50.0, 0.0, 2.0), Waypoint(0.0, 0.0, 2.0))
    out_and_stay = seconds(Waypoint(50.0, 0.0, 2.0), Waypoint(50.0, 0.0, 2.0))
    assert out_and_back > out_and_stay


def test_a_speed_that_is_left_open_is_that_of_the_vehicle() -> None:
    start = MissionState(speed_m_s=2.0, usual_speed_m_s=3.0)
    slow = state_after(Speed(0.5), start)
    assert (slow.speed_m_s, state_after(Speed(), slow).speed_m_s) == (0.5, 3.0)
