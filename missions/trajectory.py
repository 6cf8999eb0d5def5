"""Trajectories: the points of a mission, and how rows of times and places become points.

Recorded or computed paths have many rows, rounded to some decimals. A spline of degree 9 through all of them
would follow the rounding, and its sixth derivative, which the rotors must give, would be noise. So the points
are taken as far apart as a spline allows that passes every row within `TOLERANCE_M`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import ceil

import numpy as np
import scipy
from numpy.typing import NDArray

from missions.limits import FARTHEST_M, LONGEST_S, MAX_POINTS, SHORTEST_POINT_S
from missions.model import ORIGIN, Trajectory

Array = NDArray[np.float64]

COLUMNS = ("t_s", "east_m", "north_m", "altitude_m")
TOLERANCE_M = 1e-3
_DEGREE = 9
_AT_REST = 5  # coefficients at each end: position and four derivatives that are zero
# intervals of the spline (s), one after the other until it fits
_INTERVALS_S = (1.0, 0.7, 0.5, 0.35, 0.25, 0.2, 0.15, 0.12, SHORTEST_POINT_S)
_ROWS_PER_INTERVAL = 2.0  # at least, so that each coefficient follows from rows
_DECIMALS = 7  # of a point, in m
_ROUNDING_S = 1e-9  # of times that are whole milliseconds
_ROWS_HINT = "closer rows, as of a computed path, belong in a file (in Python: Trajectory.through)"
_END_S = 0.5  # a spline that misses rows this near to an end does so because the path is not at rest there


def through_points(points: Iterable[Sequence[float]]) -> Trajectory:
    """The trajectory that passes exactly these points of time (s), east, north and altitude (m); times and
    places count from the first. ValueError if the points make no path."""
    table = _checked(points)
    if len(table) > MAX_POINTS:
        raise ValueError(f" has {len(table)} entries; must be {MAX_POINTS} at most; {_ROWS_HINT}")
    gaps = np.diff(table[:, 0])
    if gaps.min() < SHORTEST_POINT_S - _ROUNDING_S:
        index = int(np.flatnonzero(gaps < SHORTEST_POINT_S - _ROUNDING_S)[0])
        raise ValueError(
            f"[{index + 1}] is {gaps[index]:.3g} s after the point before; must be {SHORTEST_POINT_S:g} s at "
            f"least; {_ROWS_HINT}"
        )
    return _trajectory(table[:, 0].round(3), table[:, 1:])


def through_rows(rows: Iterable[Sequence[float]]) -> Trajectory:
    """The trajectory through rows of time (s), east, north and altitude (m), from rest to rest.

    Times increase from any beginning, and places count from that of the first row. The path passes each row
    within `TOLERANCE_M`; rows that are too far apart for a fit are its points themselves. ValueError if there
    is no such path.
    """
    table = _checked(rows)
    times, places = table[:, 0], table[:, 1:]
    gaps = np.diff(times)
    best: tuple[float, int] | None = None
    for interval_s in _INTERVALS_S:
        count = max(ceil(times[-1] / interval_s - _ROUNDING_S), 1)
        if interval_s < _ROWS_PER_INTERVAL * gaps.max() or count >= MAX_POINTS:
            break
        knots = np.linspace(0.0, times[-1], count + 1).round(3)
        if np.diff(knots).min() < SHORTEST_POINT_S - _ROUNDING_S:
            break
        points, errors = _fit(knots, times, places)
        if errors.max() <= TOLERANCE_M:
            return _trajectory(knots, points.round(_DECIMALS))
        if best is None or errors.max() < best[0]:
            best = float(errors.max()), int(errors.argmax())
    if gaps.min() >= SHORTEST_POINT_S - _ROUNDING_S and len(times) <= MAX_POINTS:
        return _trajectory(times.round(3), places)
    raise ValueError(_no_fit_text(best, times))


def _checked(rows: Iterable[Sequence[float]]) -> Array:
    """The rows (n, 4), each counted from the first; ValueError if they make no path."""
    found = [list(row) for row in rows]
    for index, row in enumerate(found):
        if len(row) != len(COLUMNS):
            raise ValueError(f"[{index}] has {len(row)} numbers; must be {', '.join(COLUMNS)}")
    if len(found) < 2:
        raise ValueError(f" has {len(found)} entries; must be two at least")
    table = np.array(found, dtype=np.float64)
    if not np.isfinite(table).all():
        index = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])
        raise ValueError(f"[{index}] contains a value that is not a number")
    backward = np.flatnonzero(np.diff(table[:, 0]) <= 0.0)
    if len(backward):
        index = int(backward[0]) + 1
        before, after = table[index - 1 : index + 1, 0]
        raise ValueError(f"[{index}]: {after:g} s comes after {before:g} s; times must increase")
    table -= table[0]
    duration_s = table[-1, 0]
    if not SHORTEST_POINT_S <= duration_s <= LONGEST_S:
        raise ValueError(f" lasts {duration_s:g} s; must be {SHORTEST_POINT_S:g} ... {LONGEST_S:g} s")
    if np.abs(table[:, 1:]).max() > FARTHEST_M:
        raise ValueError(f" leads further than {FARTHEST_M:g} m from its first place")
    return table


def _fit(knots: Array, times: Array, places: Array) -> tuple[Array, Array]:
    """The spline with these knots (n,) that is nearest to the places, from rest at the first to rest at the
    last one: its places at the knots (n, 3), and its distances (m,) from the given ones."""
    ends = np.ones(_DEGREE)
    full = np.concatenate([knots[0] * ends, knots, knots[-1] * ends])
    basis = scipy.interpolate.BSpline.design_matrix(np.minimum(times, knots[-1]), full, _DEGREE)
    count = basis.shape[1]
    coefficients = np.zeros((count, 3))
    coefficients[-_AT_REST:] = places[-1]
    free = slice(_AT_REST, count - _AT_REST)
    if count > 2 * _AT_REST:
        columns = basis[:, free]
        rest = places - basis @ coefficients
        normal = (columns.T @ columns).toarray()
        coefficients[free] = scipy.linalg.lstsq(normal, columns.T @ rest)[0]
    errors = np.linalg.norm(basis @ coefficients - places, axis=1)
    return scipy.interpolate.BSpline(full, coefficients, _DEGREE)(knots), errors


def _trajectory(times: Array, places: Array) -> Trajectory:
    rows = zip(times[1:].tolist(), places[1:].tolist(), strict=True)
    return Trajectory((ORIGIN, *((t, *place) for t, place in rows)))


def _no_fit_text(best: tuple[float, int] | None, times: Array) -> str:
    """Why there is no path through the rows; `best` has the distance of the nearest one, and its row."""
    if best is None and times[-1] > MAX_POINTS * max(_INTERVALS_S):
        return f" lasts {times[-1]:g} s; must be {MAX_POINTS * max(_INTERVALS_S):g} s at most: divide it"
    if best is None and len(times) > MAX_POINTS and np.diff(times).min() >= SHORTEST_POINT_S:
        return f" has {len(times)} rows too far apart for a fit; must be {MAX_POINTS} at most: divide it"
    if best is None:
        widest_s = max(_INTERVALS_S) / _ROWS_PER_INTERVAL
        return (
            f" has rows less than {SHORTEST_POINT_S:g} s apart, and others more than {widest_s:g} s apart; "
            "make them equally far apart"
        )
    distance_m, row = best
    text = f"[{row}], at {times[row]:g} s, is {distance_m:.3f} m beside every smooth path through the rows"
    if min(times[row], times[-1] - times[row]) < _END_S:
        text += "; the path must be at rest where it begins and ends"
    return f"{text}; must be {TOLERANCE_M:g} m at most: smooth the rows"


def rows_of(text: str) -> Iterator[list[float]]:
    """The rows of a CSV text whose first line names its columns: `COLUMNS`, in any order and among others.
    Empty lines and lines that begin with # are left out. ValueError, which names the line, if
    a number is missing."""
    import csv

    reader = csv.reader(text.splitlines())
    wanted: list[int] | None = None
    for cells in reader:
        if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
            continue
        if wanted is None:
            names = [cell.strip() for cell in cells]
            missing = [name for name in COLUMNS if name not in names]
            if missing:
                names_text = f"its first line must name the columns {','.join(COLUMNS)}"
                raise ValueError(f"line {reader.line_num}: has no column {missing[0]}; {names_text}")
            wanted = [names.index(name) for name in COLUMNS]
            continue
        values = []
        for name, column in zip(COLUMNS, wanted, strict=True):
            cell = cells[column].strip() if column < len(cells) else ""
            try:
                values.append(float(cell))
            except ValueError:
                found = f"{name} = {cell!r}" if cell else f"{name} is missing"
                raise ValueError(f"line {reader.line_num}: {found}; must be a number") from None
        yield values
