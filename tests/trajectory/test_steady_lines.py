"""Paths along straight lines: steady on each, round in the turns, quick, and without a jump anywhere."""

from __future__ import annotations

from contextlib import suppress
from itertools import pairwise
from math import cos, dist, inf, nextafter, radians, sin

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from autopilot.geometry.linear import Vec3
from autopilot.trajectory import steady_lines
from autopilot.trajectory.minimum_snap import JoinedPath, NoPathError
from autopilot.trajectory.splines import Array, PieceTable, evaluate_path
from autopilot.trajectory.steady_lines import SteadyLines
from autopilot.trajectory.timeline import min_move_duration
from autopilot.trajectory.transfer import pace
from autopilot.trajectory.waypoint_path import MIN_WAYPOINT_DISTANCE_M, plan_waypoint_path, sample_path
from tests.trajectory.test_waypoint_path import BODY, BOUNDS, CLOCK_S, PEAK, apart

ACCEL = 1.5
LEAST_S = 2.0
SQUARE: list[Vec3] = [(0.0, 0.0, 6.0), (60.0, 0.0, 6.0), (60.0, 60.0, 9.0), (0.0, 60.0, 9.0), (0.0, 0.0, 6.0)]
places = st.tuples(st.floats(-300.0, 300.0), st.floats(-300.0, 300.0), st.floats(5.0, 60.0))
speeds = st.floats(0.5, 12.0)


def planned(points: list[Vec3], speed: float) -> tuple[PieceTable, Array]:
    path, times = plan_waypoint_path(points, speed, ACCEL, BODY, BOUNDS, False)
    return path.table(), times


def assert_joined(table: PieceTable) -> None:
    """Position and six derivatives are the same at both sides of each break, but for rounding."""
    for t in table[1:, 0]:
        before, after = (np.array(evaluate_path(table, s)) for s in (nextafter(t, -inf), t))
        assert np.abs(after - before)[:5].max() < 1e-6, t
        assert np.abs(after - before)[5:].max() < 1e-3, t


@settings(max_examples=20, deadline=None)
@given(points=st.lists(places, min_size=3, max_size=6).filter(apart), speed=speeds)
def test_a_path_through_far_points_is_smooth_and_never_slower_than_stops(
    points: list[Vec3], speed: float
) -> None:
    assume(min(dist(a, b) for a, b in pairwise(points)) > 5.0)
    table, times = planned(points, speed)
    for point, time in zip(points, times, strict=True):
        assert evaluate_path(table, float(time))[0] == pytest.approx(point, abs=1e-6 + speed * CLOCK_S)
    jets = sample_path(table, np.arange(0.0, times[-1], 0.01))
    assert np.linalg.norm(jets[1], axis=1).max() <= speed * (1.0 + PEAK)
    assert np.linalg.norm(jets[2], axis=1).max() <= ACCEL * (1.0 + PEAK)
    assert_joined(table)
    assert times[-1] <= sum(pace(dist(a, b), speed, ACCEL, LEAST_S).duration_s for a, b in pairwise(points))


@pytest.mark.parametrize(("side_m", "speed"), [(10.0, 2.0), (100.0, 5.0), (1000.0, 5.0), (5000.0, 15.0)])
def test_each_turn_of_a_square_costs_less_than_the_ramps_at_its_ends(side_m: float, speed: float) -> None:
    """A turn of 90 degrees takes 0.78 speed / accel longer than the lines to and from its corner, and the two
    ramps together 2.18 of them."""
    points = [(x * side_m, y * side_m, 6.0) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))]
    table, times = planned(points, speed)
    unit = speed / ACCEL
    assert times[-1] == pytest.approx(4.0 * side_m / speed + (2.18 + 3.0 * 0.78) * unit, abs=1.2 * unit)
    flown = sample_path(table, np.linspace(0.0, times[-1], 20_000))[0]
    low, high = flown[:, :2].min(axis=0), flown[:, :2].max(axis=0)
    beside = np.minimum(np.abs(flown[:, :2] - low), np.abs(flown[:, :2] - high)).min(axis=1).max()
    assert beside < 0.075 * speed * unit, "it hardly leaves the lines"


def test_lines_are_flown_at_a_steady_speed() -> None:
    lines = SteadyLines(np.array(SQUARE), 3.0, ACCEL, LEAST_S)
    assert lines.is_steady
    steady = [section for section in lines.sections if section.is_steady]
    assert len(steady) == 4
    for section, (a, b) in zip(steady, pairwise(np.array(SQUARE)), strict=True):
        direction = (b - a) / np.linalg.norm(b - a)
        assert section.velocities == pytest.approx(np.vstack([3.0 * direction] * 2))
        along = (section.points - a) @ direction
        assert section.points == pytest.approx(a + along[:, None] * direction)
    assert all(first.times[-1] == then.times[0] for first, then in pairwise(lines.sections))
    assert all((first.points[-1] == then.points[0]).all() for first, then in pairwise(lines.sections))


def test_short_lines_are_flown_more_slowly() -> None:
    """Two turns of 90 degrees share a line of 2 m: one metre is the way of each."""
    points = np.array([(0.0, 0.0, 6.0), (40.0, 0.0, 6.0), (40.0, 2.0, 6.0), (0.0, 2.0, 6.0)])
    lines = SteadyLines(points, 4.0, ACCEL, 0.0)
    assert not lines.is_steady
    turns = [section for section in lines.sections if len(section.points) == 3]
    for turn in turns:
        speed = float(np.linalg.norm(turn.velocities[0]))
        assert speed == pytest.approx(float(np.linalg.norm(turn.velocities[1])))
        assert 0.9 < speed < 1.5
        assert np.linalg.norm(turn.points[1] - turn.points[0]) == pytest.approx(1.0, abs=1e-3)
    steady = [section for section in lines.sections if section.is_steady]
    assert [float(np.linalg.norm(section.velocities[0])) for section in steady] == pytest.approx([4.0, 4.0])


def test_waypoints_on_a_line_do_not_slow_it_down() -> None:
    """The path through a row of waypoints is the one through its ends, and passes the others."""
    row: list[Vec3] = [(float(x), 0.5 * x, 6.0) for x in (0, 1, 3, 30, 31, 60)]
    table, times = planned(row, 4.0)
    # a path through two points is none, so one in the middle stays
    _, alone = planned([row[0], row[3], row[-1]], 4.0)
    assert times[-1] == alone[-1]
    for point, time in zip(row, times, strict=True):
        assert evaluate_path(table, float(time))[0] == pytest.approx(point, abs=1e-6 + 4.0 * CLOCK_S)
    assert (np.diff(times) > 0.0).all()


@given(
    length=st.floats(0.2, 300.0),
    shares=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=4, unique=True),
    speed=speeds,
)
def test_a_waypoint_on_a_line_never_makes_the_flight_along_it_quicker(
    length: float, shares: list[float], speed: float
) -> None:
    """And not slower either where the line is long enough for two ramps."""
    row: list[Vec3] = [
        (0.6 * length * share, -0.8 * length * share, 6.0) for share in (0.0, *sorted(shares), 1.0)
    ]
    assume(min(dist(a, b) for a, b in pairwise(row)) >= MIN_WAYPOINT_DISTANCE_M)
    least_s = min_move_duration(BODY.cable_length, BODY.gravity)
    alone = pace(length, speed, ACCEL, least_s)
    with suppress(NoPathError):
        _, times = planned(row, speed)
        assert times[-1] >= alone.duration_s - CLOCK_S
        if alone.ramp_s > 0.0:
            assert times[-1] == pytest.approx(alone.duration_s, rel=1e-6, abs=CLOCK_S)


def test_a_turn_leaves_a_waypoint_beside_it_on_the_line() -> None:
    points: list[Vec3] = [(0.0, 0.0, 6.0), (58.0, 0.0, 6.0), (60.0, 0.0, 6.0), (60.0, 60.0, 6.0)]
    lines = SteadyLines(np.array(points), 4.0, ACCEL, LEAST_S)
    (turn,) = (section for section in lines.sections if len(section.points) == 3)
    assert turn.points[0, 0] >= 58.0
    path = JoinedPath(lines.sections)
    for point, time in zip(points, lines.passes(path), strict=True):
        assert evaluate_path(path.table(), float(time))[0] == pytest.approx(point, abs=1e-6 + 4.0 * CLOCK_S)


@pytest.mark.parametrize("angle_deg", [10, 30, 60, 90, 150])
@pytest.mark.parametrize("between_m", [4.0, 15.0, 60.0])
@pytest.mark.parametrize("speed", [1.5, 8.0])
def test_with_no_other_shape_of_its_turns_is_a_path_quicker(
    angle_deg: int, between_m: float, speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two turns, with a line between them, but for two hundredths: each is chosen as if alone."""
    east, north = cos(radians(angle_deg)), sin(radians(angle_deg))
    corner = (between_m * east, between_m * north, 6.0)
    points = np.array([(-80.0, 0.0, 6.0), (0.0, 0.0, 6.0), corner, (corner[0] + 80.0, corner[1], 6.0)])

    def duration_s() -> float:
        return float(SteadyLines(points, speed, ACCEL, LEAST_S).sections[-1].times[-1])

    chosen_s, shapes = duration_s(), steady_lines.turn_shapes(angle_deg)
    for shape in shapes:
        monkeypatch.setattr(steady_lines, "turn_shapes", lambda _, shape=shape: (shape,))
        assert chosen_s <= 1.02 * duration_s()


def test_no_ramp_and_no_turn_is_shorter_than_the_least_time() -> None:
    lines = SteadyLines(np.array(SQUARE), 0.3, ACCEL, LEAST_S)
    moving = [section.times[-1] - section.times[0] for section in lines.sections if not section.is_steady]
    assert moving == pytest.approx([LEAST_S] * 5)
