"""Paths through waypoints: through every point, smooth, of least snap, and within the requested limits."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import cos, dist, inf, nextafter, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from autopilot.geometry.linear import Vec3
from autopilot.trajectory.minimum_snap import (
    REST,
    ROTATION_TIME_S,
    ROTOR_TIME_S,
    MinimumSnap,
    NoPathError,
    Section,
)
from autopilot.trajectory.peaks import Body, survey_transfer
from autopilot.trajectory.prepare import REFUSE, PathLimits, prepare
from autopilot.trajectory.rotor_demand import COS_TILT, TENSION, Bounds, demand, rotor_commands
from autopilot.trajectory.splines import Array, evaluate_path
from autopilot.trajectory.steady_lines import SteadyLines
from autopilot.trajectory.timeline import min_move_duration
from autopilot.trajectory.transfer import pace
from autopilot.trajectory.waypoint_path import (
    PathSegment,
    optimal_time_shares,
    plan_waypoint_path,
    ride,
    ride_through,
    sample_path,
)
from missions.model import Land, Speed, Step, Takeoff, Waypoint

BODY = Body(0.4, 0.1, 0.7, (2.23e-3, 2.99e-3, 4.8e-3), 9.81, 0.126, 0.016, 0.02, 0.012)
BOUNDS = Bounds(0.294, 1.666, 0.294, cos(radians(45.0)), 0.02)
LIMITS = PathLimits(BODY, BOUNDS, True, 0.05, REFUSE, 1.5, 1.5, False)
SQUARE: tuple[Vec3, ...] = ((0.0, 0.0, 2.0), (4.0, 0.0, 2.0), (4.0, 4.0, 3.0), (0.0, 4.0, 3.0))
# samples of the search are 10 ms apart
PEAK = 5e-3
# metres, of positions of a few metres through a linear system
ROUNDING_M = 1e-9
# s: the times at points are whole microseconds
CLOCK_S = 0.5e-6

places = st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0), st.floats(1.0, 6.0))


def apart(points: list[Vec3]) -> bool:
    return all(dist(a, b) > 0.5 for a, b in pairwise(points))


def assert_within(jets: Array, spacing: float) -> None:
    found = demand(jets, BODY)
    asked = rotor_commands(found, spacing, BOUNDS.rotor_tau)
    assert asked.max() <= BOUNDS.rotor_high + 0.02
    assert asked.min() >= BOUNDS.rotor_low - 0.02
    assert found[:, TENSION].min() >= BOUNDS.tension_low
    assert found[:, COS_TILT].min() >= BOUNDS.cos_tilt - 0.01


@settings(max_examples=15, deadline=None)
@given(points=st.lists(places, min_size=3, max_size=6).filter(apart), quick=st.booleans())
# its greatest demand was in its last millisecond
@example(points=[(0.0, 0.0, 1.0), (0.0, 0.0, 2.0), (0.0, 3.0, 1.0)], quick=True)
def test_every_point_is_passed_at_its_time_within_the_bounds(points: list[Vec3], quick: bool) -> None:
    path, times = plan_waypoint_path(points, 2.0, 1.5, BODY, BOUNDS, quick)
    table = path.table()
    for point, time in zip(points, times, strict=True):
        assert evaluate_path(table, float(time))[0] == pytest.approx(point, abs=ROUNDING_M + 2.0 * CLOCK_S)
    fine = np.arange(0.0, times[-1], 2e-3)
    jets = sample_path(table, fine)
    assert_within(jets, 2e-3)
    if not quick:
        assert np.linalg.norm(jets[1], axis=1).max() <= 2.0 * (1.0 + PEAK)
        assert np.linalg.norm(jets[2], axis=1).max() <= 1.5 * (1.0 + PEAK)


def test_a_path_is_smooth_to_the_sixth_derivative_and_rests_at_its_ends() -> None:
    path, times = plan_waypoint_path(SQUARE, 2.0, 1.5, BODY, BOUNDS, False)
    table = path.table()
    spacing = table[0, 1] - table[0, 0]
    for t in table[:, 0]:
        before, after = (np.array(evaluate_path(table, s)) for s in (nextafter(t, -inf), t))
        rounding = 1e-13 * 4.0 / spacing ** np.arange(7)
        assert (np.abs(after - before).max(axis=1) <= rounding + 1e-9).all(), t
    for t in (0.0, float(times[-1])):
        assert np.abs(np.array(evaluate_path(table, t))[1:]).max() < 1e-6


def test_the_path_is_that_of_a_dense_programme() -> None:
    """The integral by Gauss's rule, exact for these polynomials, minimised in the points' null space."""
    points = np.array(SQUARE)
    times = np.array([0.0, 3.0, 4.5, 8.0])
    path = MinimumSnap(Section(points, times, REST))
    basis = path.basis
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = 0.5 * basis.spacing
    at = (basis.breaks[:-1, None] + half * (1.0 + nodes)).ravel()
    values, first = basis.band(at, 8)
    dense = np.zeros((8, len(at), basis.count))
    for i, begin in enumerate(first):
        dense[:, i, begin : begin + 10] = values[:, i]
    weight = np.tile(half * weights, basis.intervals)[:, None]
    four, six, seven = (dense[n].T @ (weight * dense[n]) for n in (4, 6, 7))
    H = four + ROTATION_TIME_S**4 * (six + ROTOR_TIME_S**2 * seven)
    point_values, point_first = basis.band(times[1:-1], 1)
    A = np.zeros((2, basis.count))
    for i, begin in enumerate(point_first):
        A[i, begin : begin + 10] = point_values[0, i]
    fixed = path.coefficients.copy()
    fixed[basis.free] = 0.0
    free = basis.free
    particular = np.linalg.lstsq(A[:, free], points[1:-1] - points[0] - A @ fixed, rcond=None)[0]
    null = np.linalg.svd(A[:, free])[2][2:].T
    rest = fixed.copy()
    rest[free] = particular
    y = np.linalg.solve(null.T @ H[free, free] @ null, -null.T @ (H @ rest)[free])
    rest[free] = particular + null @ y
    dense_cost = float(np.sum(rest * (H @ rest)))
    # the samples of the programme against the exact integral
    assert float(np.sum(path.coefficients * (H @ path.coefficients))) <= dense_cost * (1.0 + 1e-3)
    assert path.coefficients == pytest.approx(rest, abs=2e-3)


def test_times_between_points_are_better_than_equal_ones() -> None:
    points = np.array([(0.0, 0.0, 2.0), (1.0, 0.0, 2.0), (9.0, 0.0, 2.0), (9.0, 3.0, 2.0)])
    times = 10.0 * np.concatenate([[0.0], np.cumsum(optimal_time_shares(points, 10.0))])
    equal = np.linspace(0.0, times[-1], 4)
    costs = [MinimumSnap(Section(points, at, REST)).cost for at in (times, equal)]
    assert costs[0] < 0.5 * costs[1]


def test_a_path_leaves_the_lines_where_that_is_much_quicker() -> None:
    """Lines of 20 m are long enough for 1.5 m/s, but not for 8."""
    points: list[Vec3] = [(x, y, 10.0) for x, y in ((0, 0), (20, 0), (20, 20), (0, 20), (0, 0))]
    along, _ = plan_waypoint_path(points, 1.5, 1.5, BODY, BOUNDS, False)
    assert any(spline.section.is_steady for spline in along.splines)
    smooth, times = plan_waypoint_path(points, 8.0, 1.5, BODY, BOUNDS, False)
    assert len(smooth.splines) == 1
    lines = SteadyLines(np.array(points), 8.0, 1.5, 2.0)
    assert 1.05 * times[-1] < lines.sections[-1].times[-1]


def test_time_optimal_is_quicker_and_at_a_bound() -> None:
    _, slow = plan_waypoint_path(SQUARE, 2.0, 1.5, BODY, BOUNDS, False)
    path, quick = plan_waypoint_path(SQUARE, 2.0, 1.5, BODY, BOUNDS, True)
    # measured 13.9 s and 6.1 s
    assert quick[-1] < 0.6 * slow[-1]
    _, hasty = plan_waypoint_path(SQUARE, 2.0, 1.5, BODY, replace_rotor(1.3), True)
    assert hasty[-1] > 1.1 * quick[-1], "a weaker rotor takes longer: the rotors are what binds"
    fine = np.arange(0.0, quick[-1], 0.01)
    assert_within(sample_path(path.table(), fine), 0.01)


def replace_rotor(high: float) -> Bounds:
    return BOUNDS._replace(rotor_high=high)


def test_points_sampled_from_a_curve_are_flown_at_the_speed_asked_for() -> None:
    """However close they are: only the ends of the path are slow."""
    angles = np.linspace(0.0, 2.0 * np.pi, 41)
    circle = [(2.0 * float(np.sin(a)), 2.0 - 2.0 * float(np.cos(a)), 2.0) for a in angles]
    path, times = plan_waypoint_path(circle, 1.0, 1.5, BODY, BOUNDS, False)
    middle = sample_path(path.table(), np.linspace(times[8], times[-9], 400))
    assert np.linalg.norm(middle[1], axis=1).min() > 0.95


def test_a_ride_takes_the_time_of_the_lines_between_its_ends() -> None:
    points = np.column_stack([np.arange(0.0, 10.01, 0.1), np.zeros(101), np.full(101, 2.0)])
    ride = ride_through(points, 1.0, 1.5, 2.0)
    durations = np.diff(ride.times)
    assert np.array_equal(ride.points, points), "there are no turns"
    assert durations == pytest.approx(durations[::-1])
    assert durations[40:60] == pytest.approx(np.full(20, 0.1)), "at the speed asked for"
    assert durations[0] > 4.0 * durations[50]


def test_a_ride_divides_a_line_that_is_long_beside_the_turn_at_its_end() -> None:
    points = np.array([(0.0, 0.0, 2.0), (60.0, 0.0, 2.0), (60.0, 3.0, 2.0), (57.0, 3.0, 2.0)])
    ride = ride_through(points, 1.5, 1.5, 2.0)
    assert np.array_equal(ride.points[ride.waypoints], points)
    between = ride.points[1 : ride.waypoints[1]]
    assert (between[:, 1:] == points[0, 1:]).all(), "on the line"
    parts_s = np.diff(ride.times[: ride.waypoints[1] + 1])[::-1]
    # two thirds of the acceleration are for speeding up; the circle through the turn has half of 3 m
    turn_speed = sqrt(sqrt(1.0 - 4.0 / 9.0) * 1.5 * 1.5)
    assert parts_s[0] == pytest.approx(1.2 * 2.0 * turn_speed / 1.5), "a little longer than the turn"
    assert parts_s[1:-1] == pytest.approx(1.2 * parts_s[:-2])
    assert parts_s[-2] <= parts_s[-1] <= 2.5 * parts_s[-2], "at rest nothing is divided"


# m; with the times of a ride at constant speed, paths of least snap left such routes by up to 535 m, and took
# up to seven times as long
ROUTES = {
    "a long way to a zigzag": [(0, 0), *((200 + 10 * (i % 2), 5 * i) for i in range(10))],
    "lines of a survey": [(30 * ((i + 1) // 2 % 2), 5 * (i // 2)) for i in range(12)],
    "a zigzag": [(8 * (i % 2), 7.5 * i) for i in range(21)],
    "a straight line": [(10 * i, 0) for i in range(40)],
    "a circle": [(20 * sin(0.3 * i), 20 - 20 * cos(0.3 * i)) for i in range(40)],
}
# the greatest way beside the lines (m), and the duration over that of a ride at constant speed, at 1.5 and at
# 8 m/s: measured, and a tenth more
FLOWN = {
    "a long way to a zigzag": ((0.1, 1.15), (0.15, 1.7)),
    "lines of a survey": ((0.1, 1.2), (0.8, 1.7)),
    "a zigzag": ((0.13, 1.25), (2.0, 2.4)),
    "a straight line": ((1e-5, 1.1), (1e-5, 0.95)),
    "a circle": ((0.1, 1.15), (0.3, 1.1)),
}


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("fast", [False, True])
def test_many_waypoints_are_flown_near_the_lines_between_them(route: str, fast: bool) -> None:
    points: list[Vec3] = [(float(x), float(y), 4.0) for x, y in ROUTES[route]]
    speed, (beside_m, slowness) = (8.0 if fast else 1.5), FLOWN[route][fast]
    path, times = plan_waypoint_path(points, speed, 1.5, BODY, BOUNDS, False)
    jets = sample_path(path.table(), np.arange(0.0, times[-1], 0.01))
    assert np.linalg.norm(jets[1], axis=1).max() <= speed * (1.0 + PEAK)
    assert np.linalg.norm(jets[2], axis=1).max() <= 1.5 * (1.0 + PEAK)
    assert_within(jets, 0.01)
    for point, time in zip(points, times, strict=True):
        assert evaluate_path(path.table(), float(time))[0] == pytest.approx(point, abs=1e-6 + speed * CLOCK_S)
    flown = jets[0]
    lines = [(np.array(a), np.subtract(b, a)) for a, b in pairwise(points)]
    offsets = [
        flown - a - np.clip((flown - a) @ line / (line @ line), 0.0, 1.0)[:, None] * line for a, line in lines
    ]
    assert np.linalg.norm(offsets, axis=2).min(axis=0).max() < beside_m
    assert times[-1] < slowness * ride(sum(dist(a, b) for a, b in pairwise(points)), speed, 1.5)[2]


def test_a_path_that_would_be_slower_than_stops_is_flown_with_stops() -> None:
    """Of one that is a thousand times as long as one of its lines, the spline has no place for this line."""
    near = [(0.1 * i, 0.1 * (i % 2), 4.0) for i in range(10)]
    far: list[Vec3] = [*near, (3000.0, 0.0, 4.0), (0.0, 0.0, 4.0)]
    with pytest.raises(NoPathError, match="with a stop"):
        plan_waypoint_path(far, 1.5, 1.5, BODY, BOUNDS, False)
    steps = (Takeoff(4.0), *(Waypoint(*place) for place in far[1:]), Land())
    assert not any(isinstance(path, PathSegment) for path in prepare(steps, range(len(steps)), LIMITS).paths)


@pytest.mark.parametrize("spacing_m", [0.06, 0.5])
def test_a_path_that_does_not_come_near_its_speed_is_told(spacing_m: float) -> None:
    """Mission items carry places on a grid of 11 mm, so that a row of close waypoints is crooked."""
    steps: list[Step] = [Takeoff(2.0), Speed(1.0)]
    steps += [Waypoint(spacing_m * i, 0.011 * (i % 2), 2.0) for i in range(1, 31)]
    found = prepare(steps, range(len(steps)), LIMITS)
    assert bool(found.notes) == bool(found.slow_paths) == (spacing_m < 0.1)
    if found.notes:
        assert found.notes[0].startswith("Items 2 to 31 take ")
        assert found.notes[0].endswith(": too close together, or turns too sharp, for 1 m/s")
        assert (found.slow_paths[0].first, found.slow_paths[0].last) == (2, 31)
    assert not prepare(steps, range(len(steps)), LIMITS._replace(time_optimal=True)).notes


def test_drag_binds_at_speed() -> None:
    """At 14 m/s the drag is half the weight: a vehicle without drag is far quicker."""
    far = ((0.0, 0.0, 5.0), (80.0, 0.0, 5.0), (160.0, 0.0, 5.0))
    _, in_air = plan_waypoint_path(far, 14.0, 10.0, BODY, BOUNDS, True)
    _, in_vacuum = plan_waypoint_path(
        far, 14.0, 10.0, BODY._replace(drag_linear=0.0, drag_quadratic=0.0), BOUNDS, True
    )
    assert in_air[-1] > 1.2 * in_vacuum[-1]


def made_of(*steps: Step) -> list[bool]:
    found = prepare((Takeoff(2.0), *steps, Land()), range(len(steps) + 2), LIMITS).paths
    return [isinstance(made, PathSegment) for made in found][1:-1]


def test_waypoints_in_a_row_are_one_passage() -> None:
    a, b, c = (Waypoint(x, y, 2.0) for x, y in ((3.0, 0.0), (3.0, 3.0), (0.0, 3.0)))
    assert made_of(a, b, c) == [True, True, True]
    assert made_of(a) == [False], "a single one is flown to from rest to rest"
    assert made_of(a, replace(b, hold_s=1.0), c) == [True, True, False]
    assert made_of(a, Speed(1.0), b) == [False, False, False]
    assert made_of(a, a, b, c) == [False, False, True, True], "a point twice is a stop there"


def test_a_single_transfer_takes_longer_where_a_bound_binds() -> None:
    steps = (
        Takeoff(5.0),
        Speed(15.0),
        Waypoint(400.0, 0.0, 5.0, hold_s=1.0),
        Waypoint(395.0, 0.0, 5.0),
        Land(),
    )
    gentle = prepare(steps, range(5), LIMITS._replace(accel_m_s2=1.0))
    assert gentle.min_durations_s == (0.0,) * 5
    weak = LIMITS._replace(bounds=BOUNDS._replace(rotor_high=1.35))
    least = prepare(steps, range(5), weak).min_durations_s
    usual = pace(400.0, 15.0, 1.5, min_move_duration(BODY.cable_length, BODY.gravity))
    assert least[2] > 1.05 * usual.duration_s
    along = survey_transfer((0.0, 0.0, 5.0), (400.0, 0.0, 5.0), usual.stretched(least[2]), BODY)
    assert along.rotor_high.value <= 1.35
    assert least[4] == 0.0


def test_the_stretches_of_a_passage_join() -> None:
    steps = (Takeoff(2.0), *(Waypoint(x, 1.0 * x, 2.0) for x in (2.0, 4.0, 5.0)), Land())
    made = [m for m in prepare(steps, range(5), LIMITS).paths if isinstance(m, PathSegment)]
    assert made[0].begin_s == 0.0
    assert all(x.end_s == y.begin_s and x.table is y.table for x, y in pairwise(made))
    assert made[-1].end_s == made[-1].table[-1, 1]


@pytest.mark.parametrize("total_s", [0.2, 4.0])
def test_each_end_of_a_path_has_a_sample_next_to_it(total_s: float) -> None:
    times, jets = MinimumSnap(Section(np.array(SQUARE), np.linspace(0.0, total_s, 4), REST)).jets()
    gaps = np.diff(times)
    assert (times[0], times[-1]) == (0.0, total_s) and (gaps > 0.0).all()
    assert max(gaps[0], gaps[-1]) < 0.11 * gaps[2:-2].min()
    assert jets.shape[1] == len(times)


def test_a_flight_of_days_is_judged_by_no_more_samples_than_one_of_minutes() -> None:
    points = np.array([[0.0, 0.0, 2.0], [1000.0, 0.0, 2.0], [-1000.0, 0.0, 2.0]])
    times, _ = MinimumSnap(Section(points, np.array([0.0, 1e5, 3e5]), REST)).jets()
    assert len(times) == 20_003
