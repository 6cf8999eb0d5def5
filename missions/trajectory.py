"""Trajectories: the points of a mission, and how rows of times and places become points.

Recorded or computed paths have many rows, rounded to some decimals. A spline of degree 9 through all of them
would follow the rounding, and its sixth derivative, which the rotors must give, would be noise. So the points
are taken as far apart as a spline allows that passes every row within a tolerance.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import ceil
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from missions.errors import Error, PathError
from missions.limits import (
    COARSEST_TOLERANCE_M,
    FARTHEST_POINT_M,
    FINEST_TOLERANCE_M,
    LONGEST_S,
    MAX_POINTS,
    SHORTEST_POINT_S,
)
from missions.model import ORIGIN, TOLERANCE_M, ZERO_AT_ENDS, Trajectory
from missions.path_rows import path_rows
from missions.toml_files import format_value
from missions.writing import plain_value

Array = NDArray[np.float64]
Vec3 = tuple[float, float, float]

_ZERO = (0.0, 0.0, 0.0)
COLUMNS = ("t_s", "east_m", "north_m", "altitude_m")
_DEGREE = 9
# intervals of the spline (s), one after the other until it fits
_INTERVALS_S = (4.0, 2.8, 2.0, 1.4, 1.0, 0.7, 0.5, 0.35, 0.25, 0.2, 0.15, 0.12, SHORTEST_POINT_S)
_ROWS_PER_INTERVAL = 2.0  # at least, so that each point follows from rows
_DECIMALS = 7  # of a point, in m
_ROUNDING_S = 1e-9  # of times that are whole milliseconds
_ROWS_HINT = "closer rows, as of a computed path, belong in a file (in Python: Trajectory.through)"
_END_ROWS, _END_S = 5, 0.1  # by which the speed at an end is found
_AT_REST_M_S, _SPEED_SIGMAS = 0.05, 5.0


def through_points(points: Iterable[Sequence[float]]) -> Trajectory:
    """The trajectory that passes exactly these points of time (s), east, north and altitude (m); times and
    places count from the first. PathError if the points make no path."""
    table, first_m = _checked(points)
    if len(table) > MAX_POINTS:
        raise PathError(f"has {len(table)} points; must be {MAX_POINTS} at most; {_ROWS_HINT}")
    gaps = np.diff(table[:, 0])
    if gaps.min() < SHORTEST_POINT_S - _ROUNDING_S:
        index = int(np.flatnonzero(gaps < SHORTEST_POINT_S - _ROUNDING_S)[0])
        text = f"comes {gaps[index]:.3g} s after the one before; must be {SHORTEST_POINT_S:g} s at least"
        raise PathError(f"{text}; {_ROWS_HINT}", index + 1)
    return _trajectory(table[:, 0].round(3), table[:, 1:], first_m)


def through_rows(rows: Iterable[Sequence[float]], tolerance_m: float = TOLERANCE_M) -> Trajectory:
    """The smoothest trajectory through rows of time (s), east, north and altitude (m), from rest to rest.

    Times increase from any beginning, and places count from that of the first row. The path passes each row
    within `tolerance_m`; rows that are too far apart for a fit are its points themselves. PathError if there
    is no such path.
    """
    within_m, finest_m, coarsest_m = plain_value(tolerance_m), FINEST_TOLERANCE_M, COARSEST_TOLERANCE_M
    if not isinstance(within_m, float) or not finest_m <= within_m <= coarsest_m:
        raise Error(f"tolerance_m = {tolerance_m!r}; must be {finest_m:g} ... {coarsest_m:g} m")
    table, first_m = _checked(rows)
    times, places = table[:, 0], table[:, 1:]
    gaps = np.diff(times)
    nearest: tuple[float, int] | None = None
    for interval_s in _INTERVALS_S:
        count = max(ceil(times[-1] / interval_s - _ROUNDING_S), 1)
        if interval_s < _ROWS_PER_INTERVAL * gaps.max() or count >= MAX_POINTS:
            break
        knots = np.linspace(0.0, times[-1], count + 1).round(3)
        if np.diff(knots).min() < SHORTEST_POINT_S - _ROUNDING_S:
            break
        points, distances = _fit(knots, times, places)
        if distances.max() <= within_m:
            return _trajectory(knots, points.round(_DECIMALS), first_m)
        if nearest is None or distances.max() < nearest[0]:
            nearest = float(distances.max()), int(distances.argmax())
    if gaps.min() >= SHORTEST_POINT_S - _ROUNDING_S and len(times) <= MAX_POINTS:
        return _trajectory(times.round(3), places, first_m)
    raise _no_fit(table, nearest, within_m)


def _checked(rows: Any) -> tuple[Array, Vec3]:
    """The rows (n, 4), each counted from the first, and the place of the first; PathError if they make no
    path."""
    found = [[plain_value(value) for value in row] for row in path_rows(rows, COLUMNS, "rows")]
    if len(found) < 2:
        raise PathError(f"has {len(found)} rows; must be two at least")
    for index, row in enumerate(found):
        for name, value in zip(COLUMNS, row, strict=True):
            if not isinstance(value, float):
                raise PathError(f"has {name} = {format_value(value)}; must be a number", index)
    table = np.array(found, dtype=np.float64)
    if not np.isfinite(table).all():
        index = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])
        raise PathError("contains a value that is not a number", index)
    backward = np.flatnonzero(np.diff(table[:, 0]) <= 0.0)
    if len(backward):
        index = int(backward[0]) + 1
        before, after = table[index - 1 : index + 1, 0]
        raise PathError(f"is at {after:g} s, and the one before at {before:g} s; times must increase", index)
    _, east, north, altitude = table[0].tolist()
    if (east, north, altitude) != _ZERO and table[:, 3].min() < 0.0:
        index = int(table[:, 3].argmin())
        text = f"has altitude_m = {table[index, 3]:g}; must be >= 0: it counts upwards from home"
        raise PathError(f"{text}, or from a first row of zeros", index)
    table -= table[0]
    duration_s = table[-1, 0]
    if not SHORTEST_POINT_S <= duration_s <= LONGEST_S:
        raise PathError(f"lasts {duration_s:g} s; must be {SHORTEST_POINT_S:g} ... {LONGEST_S:g} s")
    if np.abs(table[:, 1:]).max() > FARTHEST_POINT_M:
        raise PathError(f"leads further than {FARTHEST_POINT_M:g} m from the first")
    return table, (east, north, altitude)


def _fit(knots: Array, times: Array, places: Array) -> tuple[Array, Array]:
    """Of all paths through points at the knots (n,), the nearest to the places, from the first one on: its
    points (n, 3), and its distances (m) from the places."""
    zero = [(order, np.zeros(len(knots))) for order in ZERO_AT_ENDS]
    cardinal = scipy.interpolate.make_interp_spline(knots, np.eye(len(knots)), _DEGREE, bc_type=(zero, zero))
    basis = scipy.interpolate.BSpline.design_matrix(np.minimum(times, knots[-1]), cardinal.t, _DEGREE)
    coefficients = cardinal.c[:, 1:]  # those of the first point, which is at zero, are left out
    normal = coefficients.T @ ((basis.T @ basis) @ coefficients)
    points = np.zeros((len(knots), 3))
    points[1:] = scipy.linalg.lstsq(normal, coefficients.T @ (basis.T @ places), lapack_driver="gelsy")[0]
    return points, np.linalg.norm(basis @ (cardinal.c @ points) - places, axis=1)


def _trajectory(times: Array, places: Array, first_m: Vec3) -> Trajectory:
    rows = zip(times[1:].tolist(), places[1:].tolist(), strict=True)
    return Trajectory((ORIGIN, *((t, *place) for t, place in rows)), None if first_m == _ZERO else first_m)


def _no_fit(table: Array, nearest: tuple[float, int] | None, tolerance_m: float) -> PathError:
    """Why there is no path through the rows; `nearest` has the distance of the nearest one, and its row."""
    times = table[:, 0]
    if nearest is None:
        widest_s = max(_INTERVALS_S) / _ROWS_PER_INTERVAL
        close = np.diff(times).min() < SHORTEST_POINT_S
        apart = f"has {len(times)} rows, up to {np.diff(times).max():.3g} s apart"
        limits = f"at most {widest_s:g} s" if close else f"{MAX_POINTS} at most that are as far"
        return PathError(f"{apart}; must be {limits} apart")
    for index, end, what in ((0, table, "begins"), (len(times) - 1, table[::-1], "ends")):
        speed = _end_speed(end)
        if speed > _AT_REST_M_S:
            return PathError(
                f"is where the path {what} at {speed:.2f} m/s; must be at rest: add a run-up", index
            )
    distance_m, index = nearest
    return PathError(
        f"at {times[index]:g} s is {1e3 * distance_m:.2f} mm beside the nearest smooth path; must be "
        f"{1e3 * tolerance_m:g} mm at most: smooth the rows, or allow more (tolerance_m)",
        index,
    )


def _end_speed(table: Array) -> float:
    """Speed (m/s) of the path at the first of its rows (n, 4), as far as their noise tells."""
    since = np.abs(table[:, 0] - table[0, 0])
    count = max(_END_ROWS, int(np.count_nonzero(since <= _END_S)))
    if count > len(table):
        return 0.0
    places = table[:count, 1:] - table[0, 1:]
    slopes = np.polyfit(since[:count], places, 2)[1]
    covariance = np.polyfit(since[:count], np.linalg.norm(places, axis=1), 2, cov=True)[1]
    return float(np.linalg.norm(slopes)) - _SPEED_SIGMAS * float(np.sqrt(covariance[1, 1]))


class Rows(NamedTuple):
    """The rows of a file, and the number of the line of each."""

    rows: list[list[float]]
    lines: list[int]


def read_rows(text: str) -> Rows:
    """The rows of a CSV text whose first line names its columns: `COLUMNS`, in any order and among others. It
    may begin with #, as NumPy writes it; other lines that do, and empty lines, are left out. ValueError,
    which names the line, if a number is missing."""
    import csv

    reader = csv.reader(text.splitlines())
    found = Rows([], [])
    wanted: list[int] | None = None
    for cells in reader:
        is_comment = bool(cells) and cells[0].lstrip().startswith("#")
        if wanted is None:
            names = [cell.strip().lstrip("# ") for cell in cells]
            missing = [name for name in COLUMNS if name not in names]
            if not missing:
                wanted = [names.index(name) for name in COLUMNS]
            elif not is_comment and any(names):
                raise ValueError(f"line {reader.line_num} {_heading_problem(missing, ','.join(cells))}")
            continue
        if is_comment or not any(cell.strip() for cell in cells):
            continue
        values = []
        for name, column in zip(COLUMNS, wanted, strict=True):
            cell = cells[column].strip() if column < len(cells) else ""
            try:
                values.append(float(cell))
            except ValueError:
                problem = f"{name} = {cell!r}" if cell else f"{name} is missing"
                raise ValueError(f"line {reader.line_num}: {problem}; must be a number") from None
        found.rows.append(values)
        found.lines.append(reader.line_num)
    return found


def _heading_problem(missing: Sequence[str], line: str) -> str:
    """What is wrong with the first line of a file."""
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if separator in line:
            return f"has {name}; numbers must be separated by commas, with a decimal point"
    return f"has no column {missing[0]}; the first line must name the columns {','.join(COLUMNS)}"
