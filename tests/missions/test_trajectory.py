"""Trajectories: rows of times and places become the points of a smooth path."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas
import pytest
from numpy.typing import NDArray

from autopilot.trajectory.load_path import evaluate_load_path, path_tables
from missions.fileformat import MissionFileError, load_mission, mission_of, parse_mission
from missions.limits import MAX_POINTS, SHORTEST_POINT_S
from missions.model import (
    ORIGIN,
    TOLERANCE_M,
    AttitudeRun,
    Delay,
    Land,
    ReturnHome,
    Speed,
    Step,
    Takeoff,
    Trajectory,
    Waypoint,
    Winch,
)
from missions.trajectory import COLUMNS, read_rows, through_points, through_rows
from missions.writing import mission_table, write_toml
from plumbline import Error, Mission

Array = NDArray[np.float64]


def smooth_share(u: Array) -> Array:
    """From 0 to 1, at rest up to the third derivative at both ends."""
    return u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)


def eight(duration_s: float, spacing_s: float, laps: int = 2) -> Array:
    """Rows of a figure of eight over home, at 1 m."""
    times = np.arange(0.0, duration_s + 0.5 * spacing_s, spacing_s)
    phase = 2.0 * np.pi * laps * smooth_share(times / times[-1])
    return np.column_stack([times, 2.0 * np.sin(phase), np.sin(2.0 * phase), np.full_like(times, 1.0)])


def places_at(trajectory: Trajectory, times: Array) -> Array:
    tables = path_tables(trajectory)
    return np.array([evaluate_load_path(tables, float(t))[0] for t in times])


@pytest.mark.parametrize("decimals", [3, 4, 9])
@pytest.mark.parametrize("spacing_s", [0.004, 0.01, 0.05])
def test_rows_become_few_points_whose_path_passes_each_within_a_millimetre(
    spacing_s: float, decimals: int
) -> None:
    rows = eight(20.0, spacing_s).round(decimals)
    found = through_rows(rows + np.array([7.0, 0.0, 0.0, 0.0]))  # times count from the first
    assert found.points[0] == ORIGIN
    assert found.duration_s == 20.0
    assert len(found.points) < 100
    assert np.diff([point.t_s for point in found.points]).min() >= SHORTEST_POINT_S - 1e-9
    off_m = np.linalg.norm(places_at(found, rows[:, 0]) - (rows[:, 1:] - rows[0, 1:]), axis=1)
    assert off_m.max() <= TOLERANCE_M + 1e-5  # the points are rounded


def test_rounded_rows_are_as_smooth_as_exact_ones() -> None:
    """A spline through all rows would have a sixth derivative of 1e9 m/s^6 from the rounding."""

    def sixth(rows: Array) -> Array:
        tables = path_tables(through_rows(rows))
        return np.array([evaluate_load_path(tables, t)[6] for t in np.linspace(1.0, 19.0, 500)])

    exact, rounded = sixth(eight(20.0, 0.01)), sixth(eight(20.0, 0.01).round(3))
    assert np.abs(rounded - exact).max() < 0.2 * np.abs(exact).max()


def test_rows_that_are_far_apart_are_the_points() -> None:
    rows = [(0.0, 1.0, 1.0, 1.0), (2.0, 2.0, 1.0, 1.0), (4.5, 1.0, 1.5, 1.25)]
    expected = Trajectory([ORIGIN, (2.0, 1.0, 0.0, 0.0), (4.5, 0.0, 0.5, 0.25)])
    assert Trajectory.through(rows) == through_points(rows) == expected


BEGIN = """title = "t"
[[items]]
type = "takeoff"
altitude_m = 1.0

[[items]]
type = "trajectory"
"""
END = """
[[items]]
type = "land"
"""
HEAD = ",".join(COLUMNS)
SPIKE = eight(20.0, 0.01) + np.outer(np.arange(2001) == 900, [0.0, 0.02, 0.0, 0.0])
MOVING = np.column_stack([np.arange(0.0, 5.0, 0.01)] * 2 + [np.zeros(500)] * 2)


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([], "path has 0 rows; must be two at least"),
        ([(0.0, 0.0, 0.0)], "rows[0] has 3 numbers; must be t_s, east_m, north_m, altitude_m"),
        ([(0.0,) * 4, (1.0, np.nan, 0.0, 0.0)], "rows[1] contains a value that is not a number"),
        ([(0.0,) * 4, (1.0,) * 4, (1.0,) * 4], "rows[2] is at 1 s, and the one before at 1 s; times must"),
        ([(0.0,) * 4, (0.05, 0.0, 0.0, 0.0)], "path lasts 0.05 s; must be 0.1 ... 3600 s"),
        ([(0.0,) * 4, (9.0, 1001.0, 0.0, 0.0)], "path leads further than 1000 m from the first"),
        (
            [(0.0, 0.0, 0.0, 1.0), (9.0, 0.0, 0.0, -1.5)],
            "rows[1] has altitude_m = -1.5; must be >= 0: it counts up",
        ),
        (MOVING, "rows[0] is where the path begins at 1.00 m/s; must be at rest: add a run-up"),
        (
            MOVING[::-1] * [-1.0, 1.0, 1.0, 1.0],
            "rows[0] is where the path begins at 1.00 m/s; must be at rest",
        ),
        (SPIKE, "rows[900] at 9 s is 1"),
        (
            SPIKE,
            "mm beside the nearest smooth path; must be 1 mm at most: smooth the rows, or allow more (tol",
        ),
        (
            [(0.01 * k, 0.0, 0.0, 0.0) for k in range(9)] + [(9.0,) * 4],
            "path has 10 rows, up to 8.92 s apart; must be at most 2 s apart",
        ),
        (
            eight(2500.0, 2.49, laps=99),
            "path has 1005 rows, up to 2.49 s apart; must be 1000 at most that are as far",
        ),
    ],
)
def test_rows_through_which_no_smooth_path_leads_are_refused(rows: Array, text: str) -> None:
    with pytest.raises(Error, match=re.escape(text)) as refusal:
        through_rows(rows)
    assert isinstance(refusal.value, ValueError), "scripts may catch it as such"


ROWS = [[0.0, 0.0, 0.0, 1.0], [9.0, 1.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Trajectory.through(None), "path = None; must be rows of t_s, east_m"),  # type: ignore[arg-type]
        (lambda: Trajectory.through("0,0,0,1"), "path = '0,0,0,1'; must be rows of"),  # type: ignore[arg-type]
        (lambda: Trajectory.through(np.zeros(4)), "rows[0] = np.float64(0.0); must be t_s, east_m"),
        (lambda: Trajectory.through([["0", 0.0, 0.0, 1.0], ROWS[1]]), 'rows[0] has t_s = "0"; must be a num'),  # type: ignore[list-item]
        (lambda: Trajectory.through(np.array(ROWS, complex)), "rows[0] has t_s = 0j; must be a number"),
        (lambda: Trajectory.through(ROWS, -1.0), "tolerance_m = -1.0; must be 0.0001 ... 1 m"),
        (lambda: Trajectory.through(ROWS, "fine"), "tolerance_m = 'fine'; must be 0.0001 ... 1 m"),  # type: ignore[arg-type]
        (lambda: Trajectory([row[:3] for row in ROWS]), "points[0] has 3 numbers; must be t_s, east_m"),
        (lambda: Trajectory(5), "path = 5; must be rows of t_s, east_m, north_m, up_m"),  # type: ignore[arg-type]
    ],
)
def test_what_are_no_rows_is_an_error_of_one_line(make: Callable[[], Trajectory], text: str) -> None:
    with pytest.raises(Error, match=re.escape(text)):
        make()


@pytest.mark.parametrize(
    ("points", "text"),
    [
        ([[0.0] * 4, [0.05, 0.1, 0.0, 0.0], [1.0] * 4], "points[1] comes 0.05 s after the one before"),
        (
            [[0.1 * k, 0.0, 0.0, 0.0] for k in range(MAX_POINTS + 1)],
            "path has 1001 points; must be 1000 at most",
        ),
        ([[0.0] * 4, [1.0] * 3], "points[1] = [1.0, 1.0, 1.0]; must be a list of at least 4"),
        ([[0.0] * 4, [1.0, "a", 0.0, 0.0]], 'points[1][1] = "a"; must be a number'),
    ],
)
def test_points_of_a_file_are_passed_exactly_or_refused(points: list[list[float]], text: str) -> None:
    text_of_file = f"{BEGIN}points = {points}\n{END}"
    with pytest.raises(MissionFileError) as refusal:
        parse_mission(text_of_file, "t", "t.toml")
    (line,) = refusal.value.problems
    assert line.startswith("t.toml:6: items[1]")
    assert text in line


def mission_with(item: str, folder: Path) -> Path:
    path = folder / "flight.toml"
    path.write_text(f"{BEGIN}{item}\n{END}")
    return path


def test_a_file_of_rows_is_found_beside_the_mission_and_saved_as_points(tmp_path: Path) -> None:
    rows = eight(12.0, 0.01).round(4)
    (tmp_path / "paths").mkdir()
    names = ",".join(("note", *reversed(COLUMNS)))
    lines = [f"x,{up},{north},{east},{t}" for t, east, north, up in rows.tolist()]
    (tmp_path / "paths" / "eight.csv").write_text("\n".join(["# a comment", "", names, *lines]))
    mission = load_mission(mission_with('file = "paths/eight.csv"', tmp_path))
    assert mission.steps[1] == through_rows(rows)
    saved = tmp_path / "saved.toml"
    write_toml(saved, mission_table(mission.title, "", (), mission.steps))
    assert load_mission(saved).steps == mission.steps


@pytest.mark.parametrize(
    ("item", "csv", "text"),
    [
        ('file = "no.csv"', "", 'items[1].file = "no.csv": no such file'),
        ('file = "p.csv"', "", 'file = "p.csv": has 0 rows; must be two'),
        (
            'file = "p.csv"',
            "t,x,y,z\n0,0,0,0",
            'file = "p.csv": line 1 has no column t_s; the first',
        ),
        (
            'file = "p.csv"',
            f"{HEAD}\n0,0,0,0\n1,0,a,0",
            "line 3: north_m = 'a'; must be a number",
        ),
        ('file = "p.csv"', f"{HEAD}\n0,0,0,0\n1,0,0", "line 3: altitude_m is missing; must be"),
        (
            'file = "p.csv"',
            f"{HEAD}\n0,0,0,0\n0,0,0,0",
            "line 3 is at 0 s, and the one before at 0 s; times must",
        ),
        (
            'file = "p.csv"',
            HEAD.replace(",", ";"),
            "line 1 has semicolons; numbers must be separated by commas",
        ),
        ('file = "p.csv"', HEAD.replace(",", "\t"), "line 1 has tabs; numbers must be separated by commas"),
        ('file = "p.csv"\nscale = 2.0', "", "items[1].scale: unknown key"),
        ('file = "p.csv"\ntolerance_m = -1.0', "", "items[1].tolerance_m = -1.0; must be >= 0.0001 and <= 1"),
        (
            "points = [[0, 0, 0, 0], [1, 1, 0, 0]]\ntolerance_m = 0.1",
            "",
            "has tolerance_m and points, which are",
        ),
        ("", "", "items[1] has no file and no points; must have one of them"),
        ('file = "p.csv"\npoints = []', "", "items[1] has both a file and points; must have one of them"),
        ("file = 3", "", "items[1].file = 3; must be a text"),
    ],
)
def test_what_is_wrong_with_a_file_of_rows_is_told_in_a_line(
    item: str, csv: str, text: str, tmp_path: Path
) -> None:
    (tmp_path / "p.csv").write_text(csv)
    with pytest.raises(MissionFileError) as refusal:
        load_mission(mission_with(item, tmp_path))
    (line,) = refusal.value.problems
    assert line.startswith(f"{tmp_path}/flight.toml:6: items[1]")
    assert text in line


def test_columns_may_stand_in_any_order_and_among_others() -> None:
    text = "altitude_m,north_m,east_m,speed,t_s\n4,3,2,9,1\n"
    assert read_rows(text) == ([[1.0, 2.0, 3.0, 4.0]], [2])
    assert read_rows(f"# note\n\n# {text}").rows == [[1.0, 2.0, 3.0, 4.0]], "as NumPy writes it"


def test_a_noisy_path_is_followed_within_its_tolerance() -> None:
    rows = eight(30.0, 0.02)
    rows[1:-1, 1:] += np.random.default_rng(1).normal(0.0, 0.003, (len(rows) - 2, 3))
    with pytest.raises(ValueError, match="mm beside the nearest smooth path"):
        Trajectory.through(rows)
    found = Trajectory.through(rows, tolerance_m=0.015)
    exact = eight(30.0, 0.02)
    off_m = np.linalg.norm(places_at(found, exact[:, 0]) - (exact[:, 1:] - exact[0, 1:]), axis=1)
    assert off_m.max() < 0.01


@pytest.mark.parametrize("profile", ["minimum jerk", "half cosine", "trapezoid"])
def test_a_path_whose_acceleration_or_jerk_jumps_at_its_ends_is_as_smooth_as_it_is(profile: str) -> None:
    """With more derivatives that are zero at the ends, a moment of 20 N m would be needed there."""
    t = np.arange(0.0, 4.0001, 0.01)
    u = t / 4.0
    shares = {
        "minimum jerk": u**3 * (10.0 - 15.0 * u + 6.0 * u**2),
        "half cosine": 0.5 - 0.5 * np.cos(np.pi * u),
        "trapezoid": np.where(u < 0.5, 2.0 * u**2, 1.0 - 2.0 * (1.0 - u) ** 2),
    }
    rows = np.column_stack([t, 2.0 * shares[profile], 0.0 * t, 0.0 * t + 1.0])
    found = through_rows(rows)
    assert np.abs(places_at(found, t)[:, 0] - rows[:, 1]).max() <= TOLERANCE_M + 1e-5
    tables = path_tables(found)
    accelerations = np.array([evaluate_load_path(tables, float(at))[2][0] for at in t])
    assert np.abs(accelerations).max() < 1.25 * np.abs(np.diff(rows[:, 1], 2)).max() / 0.01**2


def test_a_table_of_pandas_is_rows() -> None:
    rows = eight(12.0, 0.01)
    assert Trajectory.through(pandas.DataFrame(rows)) == Trajectory.through(rows)
    points = [(0.0, 0.0, 0.0, 0.0), (1.0, 0.1, 0.2, 0.3)]
    assert Trajectory(pandas.DataFrame(points)) == Trajectory(points)


@pytest.mark.parametrize(
    ("before", "first", "there"),
    [
        ((), (0.0, 0.0, 1.0), True),
        ((), (1.0, 0.0, 1.0), False),
        ((), (0.0, 0.0, 0.0), True),
        ((Waypoint(1.0, 2.0, 3.0),), (1.0, 2.0, 3.0), True),
        ((Waypoint(1.0, 2.0, 3.0), ReturnHome()), (0.0, 0.0, 3.0), True),
        ((Waypoint(1.0, 2.0, 3.0), Winch(0.5), Delay(1.0), Speed(1.0)), (1.0, 2.0, 2.5), True),
        ((Waypoint(1.0, 2.0, 3.0), Winch(0.5)), (1.0, 2.0, 3.0), False),
        ((Trajectory([ORIGIN, (5.0, 1.0, 0.0, 0.5)]),), (1.0, 0.0, 1.5), True),
        ((AttitudeRun("load", 0.1, 0.0, 1.0),), (9.0, 9.0, 9.0), True),  # nobody knows
    ],
)
def test_a_path_in_places_from_home_begins_where_the_load_hangs(
    before: tuple[Step, ...], first: tuple[float, float, float], there: bool
) -> None:
    x, y, z = first
    path = Trajectory([(0.0, x, y, z), (5.0, x + 1.0, y, z + 1.0)])
    steps = (Takeoff(1.0), *before, path, Land())
    if there:
        Mission("m", steps)
        return
    with pytest.raises(Error, match=re.escape(f"begins at {x:g}, {y:g}, {z:g} m, and the load hangs at")):
        Mission("m", steps)
    with pytest.raises(MissionFileError, match="put a waypoint at its first row before it"):
        mission_of(mission_table("t", "", (), steps), "m", "m")
