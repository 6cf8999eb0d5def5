"""Messages of one type as columns of numbers, decoded from all their frames in one operation."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from autopilot.wire.codec import payload_of
from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.axes import Floats
from gcs.analysis.tracks import Ints

_TYPES = {
    "char": "S1",
    "double": "<f8",
    "float": "<f4",
    **{f"{sign}int{8 * size}_t": f"<{sign or 'i'}{size}" for sign in ("", "u") for size in (1, 2, 4, 8)},
    "uint8_t_mavlink_version": "<u1",
}


@cache
def _layout(message_id: int) -> np.dtype[Any]:
    """The fields of a message in the layout of its payload, before trailing zeros are cut."""
    message: Any = mavlink.mavlink_map[message_id]
    types = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    fields = zip(message.ordered_fieldnames, message.array_lengths, strict=True)
    return np.dtype([(name, _TYPES[types[name]], (count,) if count else ()) for name, count in fields])


class Columns:
    """The fields of n frames of one message type by name: (n,), or (n, k) for arrays of k numbers."""

    def __init__(self, message_id: int, frames: Sequence[bytes]) -> None:
        """`frames` are whole and undamaged; a payload that is longer than the dialect defines is cut."""
        layout = _layout(message_id)
        size = layout.itemsize
        self._rows = np.frombuffer(
            b"".join(payload_of(frame)[:size].ljust(size, b"\0") for frame in frames), layout
        )

    def raw(self, name: str) -> np.ndarray[Any, Any]:
        """A column in the type of its field."""
        return self._rows[name]

    def __getitem__(self, names: str) -> Floats:
        """A column as float64, or several of them side by side."""
        with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN
            columns = [self._rows[name].astype(np.float64) for name in names.split()]
        return columns[0] if len(columns) == 1 else np.stack(columns, axis=-1)

    def integers(self, name: str) -> Ints:
        """A column of whole numbers."""
        return self._rows[name].astype(np.int64)
