"""Rows that are missing from a recording, found by the distance that the vehicle moved meanwhile.

A step several times as long as its neighbours means that the tracker stalled and caught up, or that rows are
missing. A polynomial through the rows on both sides shows which, and how many; where none fits, the duration
is unknown and the recording is broken there: the rows after it are estimated anew.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcs.recorded.smoothing import Floats

UNKNOWN = 30  # missing rows assumed where their number is unknown: about a second

_LONG = 2.2  # usual steps
_LEAST_M = 0.05
_SIDE = 9  # rows on each side
_MOST = 15  # greatest number of missing rows that is tried
_DEGREE = 4
_BETTER = 5.0  # factor by which a gap must fit better than an even grid
_FITS_ROWS = 0.6  # greatest root mean square that counts as a fit, in usual steps


def gaps(position: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """How many rows are missing before each row (n,), and where the recording is broken (n,)."""
    n = len(position)
    missing = np.zeros(n)
    broken = np.zeros(n, dtype=np.bool_)
    way = np.linalg.norm(np.diff(position, axis=0), axis=1)
    for k in np.flatnonzero(way > _LEAST_M) + 1:
        if not _SIDE <= k <= n - _SIDE:
            continue
        rows = position[k - _SIDE : k + _SIDE]
        usual = float(np.median(way[k - _SIDE : k + _SIDE - 1]))
        if way[k - 1] < _LONG * usual:
            continue
        fresh = np.append(True, way[k - _SIDE : k + _SIDE - 1] > 0.0)
        left = [_misfit(rows, fresh, count) for count in range(_MOST + 1)]
        best = int(np.argmin(left))
        if left[best] * _BETTER > left[0]:
            best = 0
        speed = max(usual, way[k - 1] / (best + 1))
        broken[k] = np.sqrt(left[best]) > _FITS_ROWS * speed or best == _MOST
        missing[k] = UNKNOWN if broken[k] else best
    return missing, broken


def _misfit(rows: Floats, fresh: NDArray[np.bool_], count: int) -> float:
    """Mean square distance of fresh rows from a smooth course if `count` rows are missing in their middle."""
    index = np.arange(len(rows), dtype=np.float64)
    index[_SIDE:] += count
    middle = 0.5 * (index[0] + index[-1])
    base = np.vander((index - middle) / middle, _DEGREE + 1)
    found = np.linalg.lstsq(base[fresh], rows[fresh], rcond=None)[0]
    return float(np.mean(np.sum((rows - base @ found)[fresh] ** 2, axis=1)))
