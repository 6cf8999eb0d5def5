"""Rows that are missing from a recording, found by the distance that the vehicle moved meanwhile.

A step several times as long as its neighbours means that the tracker stalled and caught up, or that rows are
missing. A polynomial through the rows on both sides shows which, and how many; where none fits, the duration
is unknown and the recording is broken there: the rows after it are estimated anew.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcs.recorded.smoothing import Floats

UNKNOWN_GAP_ROWS = 30  # missing rows assumed where their number is unknown: about a second

_LONG_STEPS = 2.2  # usual steps
_MIN_STEP_M = 0.05
_ROWS_PER_SIDE = 9  # rows on each side
_MAX_MISSING = 15  # greatest number of missing rows that is tried
_DEGREE = 4
_IMPROVEMENT = 5.0  # factor by which a gap must fit better than an even grid
_MAX_RMS_STEPS = 0.6  # greatest root mean square that counts as a fit, in usual steps


def find_gaps(position: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """How many rows are missing before each row (n,), and where the recording is broken (n,)."""
    n = len(position)
    missing = np.zeros(n)
    broken = np.zeros(n, dtype=np.bool_)
    step_m = np.linalg.norm(np.diff(position, axis=0), axis=1)
    for k in np.flatnonzero(step_m > _MIN_STEP_M) + 1:
        if not _ROWS_PER_SIDE <= k <= n - _ROWS_PER_SIDE:
            continue
        rows = position[k - _ROWS_PER_SIDE : k + _ROWS_PER_SIDE]
        typical_m = float(np.median(step_m[k - _ROWS_PER_SIDE : k + _ROWS_PER_SIDE - 1]))
        if step_m[k - 1] < _LONG_STEPS * typical_m:
            continue
        new_pose = np.append(True, step_m[k - _ROWS_PER_SIDE : k + _ROWS_PER_SIDE - 1] > 0.0)
        misfits = [_misfit(rows, new_pose, count) for count in range(_MAX_MISSING + 1)]
        best = int(np.argmin(misfits))
        if misfits[best] * _IMPROVEMENT > misfits[0]:
            best = 0
        speed = max(typical_m, step_m[k - 1] / (best + 1))
        broken[k] = np.sqrt(misfits[best]) > _MAX_RMS_STEPS * speed or best == _MAX_MISSING
        missing[k] = UNKNOWN_GAP_ROWS if broken[k] else best
    return missing, broken


def _misfit(rows: Floats, new_pose: NDArray[np.bool_], count: int) -> float:
    """Mean square distance of fresh rows from a smooth course if `count` rows are missing in their middle."""
    index = np.arange(len(rows), dtype=np.float64)
    index[_ROWS_PER_SIDE:] += count
    middle = 0.5 * (index[0] + index[-1])
    base = np.vander((index - middle) / middle, _DEGREE + 1)
    found = np.linalg.lstsq(base[new_pose], rows[new_pose], rcond=None)[0]
    return float(np.mean(np.sum((rows - base @ found)[new_pose] ** 2, axis=1)))
