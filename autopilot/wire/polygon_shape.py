"""Whether corners make a polygon with an inside: they are not on one line, and no two sides meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

EastNorth = tuple[float, float]  # east, north, m

# Corners are given to 11 mm (1e-7 degrees): corners on a line may leave it by that much
MIN_WIDTH_M = 0.05


class ShapeProblem(NamedTuple):
    """What is wrong with a polygon, and the number of the corner at which it is found."""

    number: int
    text: str


def shape_problem(corners: Sequence[EastNorth], first: int) -> ShapeProblem | None:
    """Why the corners, numbered from `first` on, make no polygon, or None.

    A corner given twice in a row is no mistake: some tools repeat the first corner as the last.
    """
    kept = [i for i in range(len(corners)) if corners[i] != corners[i - 1]]
    if len(kept) < 3:
        return ShapeProblem(first, "the corners of the polygon are fewer than three places")
    places = np.array([corners[i] for i in kept])
    if _width_m(places) < MIN_WIDTH_M:
        return ShapeProblem(first, "the polygon has no area: its corners lie on a line")
    meeting = _meeting_sides(places)
    if meeting is None:
        return None
    one, other = (f"{first + kept[side]}-{first + kept[(side + 1) % len(kept)]}" for side in meeting)
    text = f"the polygon crosses or touches itself: sides {one} and {other}"
    return ShapeProblem(first + kept[meeting[1]], text)


def _width_m(places: Any) -> float:
    """How far (n, 2) places extend across the direction from the first to the farthest of them."""
    steps = places - places[0]
    distances = np.hypot(steps[:, 0], steps[:, 1])
    farthest = int(np.argmax(distances))
    return float(np.ptp(_cross(steps, steps[farthest] / distances[farthest])))


def _meeting_sides(places: Any) -> tuple[int, int] | None:
    """The first two sides that have a point in common and are not neighbours; side i begins at place i."""
    starts, ends = places, np.roll(places, -1, axis=0)
    west, south = np.ascontiguousarray(np.minimum(starts, ends).T)
    east, north = np.ascontiguousarray(np.maximum(starts, ends).T)
    last = len(places) - 1
    for i in range(last - 1):
        # the last side is a neighbour of the first
        to = last if i == 0 else last + 1
        near = (
            (west[i + 2 : to] <= east[i])
            & (east[i + 2 : to] >= west[i])
            & (south[i + 2 : to] <= north[i])
            & (north[i + 2 : to] >= south[i])
        )
        others = i + 2 + np.flatnonzero(near)
        if not others.size:
            continue
        here, there = ends[i] - starts[i], ends[others] - starts[others]
        across = _cross(here, starts[others] - starts[i]) * _cross(here, ends[others] - starts[i])
        along = _cross(there, starts[i] - starts[others]) * _cross(there, ends[i] - starts[others])
        meeting = others[(across <= 0.0) & (along <= 0.0)]
        if meeting.size:
            return i, int(meeting[0])
    return None


def _cross(a: Any, b: Any) -> Any:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
