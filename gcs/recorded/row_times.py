"""The times at which the rows of a recording were measured, if it does not contain them.

The recorder ran evenly, but each row holds the latest pose that the tracker had sent: the times of the poses
scatter about an even grid, and the scatter does not accumulate. The motion of the vehicle reveals it: a pose
that is 5 ms late lies 5 mm further along a course of 1 m/s. Course and times are estimated in turn, the times
by one step of Gauss-Newton with the even grid as prior. While the vehicle stands still the times cannot be
inferred, and nothing depends on them. Where rows are missing (`find_gaps`), the grid leaves room for them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs.recorded.gaps import find_gaps
from gcs.recorded.smoothing import Floats, SmoothedMotion, smooth

_ITERATIONS = 30
_COARSE_ITERATIONS = 9  # in which the poses are assumed less precise, so that times far off can be reached
_OUTLIER = 5.0  # standard deviations beyond which a row is weighted down
_REPEATED_WEIGHT = 1e-6  # weight of a row that repeats the one before
_MAX_GAP_S = 1.0
_MIN_STEP_S = 2e-3  # between rows


class RowTimes(NamedTuple):
    """Times of rows, and what they were inferred from."""

    time_s: Floats  # (n,)
    offset_s: Floats  # (n,) from the even grid
    weight: Floats  # (n,) weight of the row's pose: 1, or less if it fits no smooth course
    broken: NDArray[np.bool_]  # (n,) where the time since the row before is not known
    smoothed: SmoothedMotion


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
    missing, broken = find_gaps(position)
    grid = (np.arange(n) + np.cumsum(missing)) / rate_hz
    offset = np.zeros(n)
    new_pose = np.append(True, np.any(np.diff(position, axis=0) != 0.0, axis=1))
    weight = np.where(new_pose, 1.0, _REPEATED_WEIGHT)
    for k in range(_ITERATIONS):
        noise = noise_m * max(1.0, 2.0 * (_COARSE_ITERATIONS - k))
        time = _increasing(grid + offset)
        smoothed = smooth(time, position, noise**2 / weight, jerk_density)
        residual = position - smoothed.position
        speed2 = np.sum(smoothed.velocity**2, axis=1)
        prior = noise**2 / (weight * jitter_s**2)
        offset = offset + (np.sum(smoothed.velocity * residual, axis=1) - prior * offset) / (speed2 + prior)
        along = np.sum(smoothed.velocity * residual, axis=1) ** 2 / np.maximum(speed2, 1e-12)
        across = np.sqrt(np.maximum(np.sum(residual**2, axis=1) - np.where(speed2 > 1e-4, along, 0.0), 0.0))
        weight = np.minimum(1.0, (_OUTLIER * noise / np.maximum(across, 1e-9)) ** 2)
        weight = np.where(new_pose, np.maximum(weight, _REPEATED_WEIGHT), _REPEATED_WEIGHT)
    time = _increasing(grid + offset)
    return RowTimes(time, offset, weight, broken, smooth(time, position, noise_m**2 / weight, jerk_density))


def known_times(time_s: Floats, position: Floats, noise_m: float, jerk_density: float) -> RowTimes:
    """The same for rows with given times; broken where more than a second is missing."""
    n = len(time_s)
    broken = np.append(False, np.diff(time_s) > _MAX_GAP_S)
    smoothed = smooth(time_s, position, noise_m**2, jerk_density)
    return RowTimes(time_s, np.zeros(n), np.ones(n), broken, smoothed)


def _increasing(time: Floats) -> Floats:
    """The same times, each at least the shortest step after the one before."""
    floor = np.arange(len(time)) * _MIN_STEP_S
    rising: Floats = np.maximum.accumulate(time - floor) + floor
    return rising
