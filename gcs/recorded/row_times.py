"""The times at which the rows of a recording were measured, if it does not contain them.

The recorder ran evenly, but each row holds the latest pose that the tracker had sent: the times of the poses
scatter about an even grid, and the scatter does not accumulate. The motion of the vehicle reveals it: a pose
that is 5 ms late lies 5 mm further along a course of 1 m/s. Course and times are estimated in turn, the times
by one step of Gauss-Newton with the even grid as prior. While the vehicle stands still the times cannot be
inferred, and nothing depends on them. Where rows are missing (`gaps`), the grid leaves room for them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs.recorded.gaps import gaps
from gcs.recorded.smoothing import Course, Floats, smooth

_ROUNDS = 30
_COARSE_ROUNDS = 9  # in which the poses are assumed less precise, so that times far off can be reached
_OUTLIER = 5.0  # standard deviations beyond which a row is weighted down
_STALE = 1e-6  # weight of a row that repeats the one before
_SILENCE_S = 1.0
_LEAST_STEP_S = 2e-3  # between rows


class RowTimes(NamedTuple):
    """Times of rows, and what they were inferred from."""

    time_s: Floats  # (n,)
    offset_s: Floats  # (n,) from the even grid
    sure: Floats  # (n,) weight of the row's pose: 1, or less if it fits no smooth course
    broken: NDArray[np.bool_]  # (n,) where the time since the row before is not known
    course: Course


def infer_times(
    position: Floats,
    rate_hz: float,
    *,
    jitter_s: float,
    noise_m: float,
    jerk_density: float = 400.0,
) -> RowTimes:
    """Times of rows with `position` (n, 3), recorded at `rate_hz` on average with a jitter of `jitter_s`."""
    n = len(position)
    missing, broken = gaps(position)
    grid = (np.arange(n) + np.cumsum(missing)) / rate_hz
    offset = np.zeros(n)
    fresh = np.append(True, np.any(np.diff(position, axis=0) != 0.0, axis=1))
    sure = np.where(fresh, 1.0, _STALE)
    for k in range(_ROUNDS):
        noise = noise_m * max(1.0, 2.0 * (_COARSE_ROUNDS - k))
        time = _increasing(grid + offset)
        course = smooth(time, position, noise**2 / sure, jerk_density)
        left = position - course.position
        speed2 = np.sum(course.velocity**2, axis=1)
        prior = noise**2 / (sure * jitter_s**2)
        offset = offset + (np.sum(course.velocity * left, axis=1) - prior * offset) / (speed2 + prior)
        along = np.sum(course.velocity * left, axis=1) ** 2 / np.maximum(speed2, 1e-12)
        across = np.sqrt(np.maximum(np.sum(left**2, axis=1) - np.where(speed2 > 1e-4, along, 0.0), 0.0))
        sure = np.minimum(1.0, (_OUTLIER * noise / np.maximum(across, 1e-9)) ** 2)
        sure = np.where(fresh, np.maximum(sure, _STALE), _STALE)
    time = _increasing(grid + offset)
    return RowTimes(time, offset, sure, broken, smooth(time, position, noise_m**2 / sure, jerk_density))


def known_times(time_s: Floats, position: Floats, noise_m: float, jerk_density: float) -> RowTimes:
    """The same for rows with given times; broken where more than a second is missing."""
    n = len(time_s)
    broken = np.append(False, np.diff(time_s) > _SILENCE_S)
    course = smooth(time_s, position, noise_m**2, jerk_density)
    return RowTimes(time_s, np.zeros(n), np.ones(n), broken, course)


def _increasing(time: Floats) -> Floats:
    """The same times, each at least the shortest step after the one before."""
    floor = np.arange(len(time)) * _LEAST_STEP_S
    rising: Floats = np.maximum.accumulate(time - floor) + floor
    return rising
