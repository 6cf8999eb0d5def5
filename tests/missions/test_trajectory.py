"""Trajectories: rows of times and places become the points of a smooth path."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from autopilot.trajectory.load_path import evaluate_load_path, path_tables
from missions.fileformat import MissionFileError, load_mission, parse_mission
from missions.limits import MAX_POINTS, SHORTEST_POINT_S
from missions.model import ORIGIN, Trajectory
from missions.trajectory import COLUMNS, TOLERANCE_M, rows_of, through_points, through_rows
from missions.writing import mission_table, write_toml

Array = NDArray[np.float64]


def smooth_share(u: Array) -> Array:
    """From 0 to 1, at rest up to the third derivative at both ends."""
    return u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)


def eight(duration_s: float, spacing_s: float, laps: int = 2) -> Array:
    """Rows of a figure of eight at 1.5 m, which begins 3 m east of home."""
    times = np.arange(0.0, duration_s + 0.5 * spacing_s, spacing_s)
    phase = 2.0 * np.pi * laps * smooth_share(times / times[-1])
    return np.column_stack([times, 3.0 + 2.0 * np.sin(phase), np.sin(2.0 * phase), np.full_like(times, 1.5)])


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
        ([], " has 0 entries; must be two at least"),
        ([(0.0, 0.0, 0.0)], "[0] has 3 numbers; must be t_s, east_m, north_m, altitude_m"),
        ([(0.0,) * 4, (1.0, np.nan, 0.0, 0.0)], "[1] contains a value that is not a number"),
        ([(0.0,) * 4, (1.0,) * 4, (1.0,) * 4], "[2]: 1 s comes after 1 s; times must increase"),
        ([(0.0,) * 4, (0.05, 0.0, 0.0, 0.0)], " lasts 0.05 s; must be 0.1 ... 3600 s"),
        ([(0.0,) * 4, (9.0, 1001.0, 0.0, 0.0)], " leads further than 1000 m from its first place"),
        (MOVING, "must be at rest where it begins and ends; must be 0.001 m at most"),
        (
            SPIKE,
            "[900], at 9 s, is 0.0",
        ),
        ([(0.01 * k, 0.0, 0.0, 0.0) for k in range(9)] + [(3.0,) * 4], "make them equally far apart"),
        (eight(1200.0, 0.4, laps=200), " lasts 1200 s; must be 1000 s at most: divide it"),
        (
            eight(600.0, 0.6, laps=150),
            " has 1001 rows too far apart for a fit; must be 1000 at most: divide it",
        ),
        (eight(600.0, 0.4, laps=150), "smooth path through the rows; must be"),
    ],
)
def test_rows_through_which_no_smooth_path_leads_are_refused(rows: Array, text: str) -> None:
    with pytest.raises(ValueError, match=re.escape(text)):
        through_rows(rows)


@pytest.mark.parametrize(
    ("points", "text"),
    [
        ([[0.0] * 4, [0.05, 0.1, 0.0, 0.0], [1.0] * 4], "points[1] is 0.05 s after the point before"),
        ([[0.1 * k, 0.0, 0.0, 0.0] for k in range(MAX_POINTS + 1)], "points has 1001 entries; must be 1000"),
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
        ('file = "p.csv"', "", 'file = "p.csv": has 0 entries'),
        (
            'file = "p.csv"',
            "t,x,y,z\n0,0,0,0",
            'file = "p.csv": line 1: has no column t_s; its first',
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
            "row[1]: 0 s comes after 0 s; times must",
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
    assert list(rows_of(text)) == [[1.0, 2.0, 3.0, 4.0]]
