"""Columns of numbers as short text for a page: whole steps, second differences, deflate, base64.

`gcs/web/flight_data.js` decodes it. A flight at 125 Hz takes about a byte a number.
"""

from __future__ import annotations

import base64
import math
import zlib
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs.analysis.axes import Floats

_MAX_STEPS = float(2**30)  # steps from zero: whole numbers of 32 bits
_MISSING_FROM = 1e6  # numbers from here on belong to a lost flight and count as missing
_LEVEL = 6


class Column(NamedTuple):
    """n numbers, NaN where one is missing, and the step to whose multiples they are rounded."""

    name: str
    values: Floats
    step: float


def pack(columns: list[Column], count: int) -> dict[str, Any]:
    """JSON values: `count`, of each column its `name`, `step` and `gaps` ([first, last + 1] of each stretch
    of NaN), and `data`. Columns that contain only NaN are omitted."""
    bounded = [column._replace(values=_without_large(column.values)) for column in columns]
    known = [column for column in bounded if np.isfinite(column.values).any()]
    described, planes = [], []
    for name, values, min_step in known:
        finite = np.isfinite(values)
        step = _step(values[finite], min_step)
        described.append({"name": name, "step": step, "gaps": _gaps(finite)})
        integers = np.rint(_filled(values, finite) / step).astype(np.int32)
        second_differences = np.diff(np.diff(integers, prepend=np.int32(0)), prepend=np.int32(0))
        # bytes of the same significance are stored together: most of the upper ones are equal
        planes.append(second_differences.astype("<i4").view(np.uint8).reshape(-1, 4).T.tobytes())
    compressed = zlib.compress(b"".join(planes), _LEVEL, wbits=-zlib.MAX_WBITS)
    return {"count": count, "columns": described, "data": base64.b64encode(compressed).decode("ascii")}


def _without_large(values: Floats) -> Floats:
    return np.where(np.abs(values) < _MISSING_FROM, values, np.nan)


def _step(finite: Floats, min_step: float) -> float:
    """`min_step`, or the power of ten with which the greatest number fits into 32 bits."""
    largest = float(np.abs(finite).max())
    if largest <= min_step * _MAX_STEPS:
        return min_step
    return float(10.0 ** math.ceil(math.log10(largest / _MAX_STEPS)))


def _filled(values: Floats, finite: NDArray[np.bool_]) -> Floats:
    """Each missing number replaced by the last known one, so that no jumps have to be stored."""
    index = np.maximum.accumulate(np.where(finite, np.arange(len(values)), int(np.argmax(finite))))
    return values[index]


def _gaps(finite: NDArray[np.bool_]) -> list[list[int]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([True], finite, [True])).astype(np.int8)))
    return [[int(a), int(b)] for a, b in zip(edges[::2], edges[1::2], strict=True)]
