"""Builds Arrow arrays from buffers.

`pyarrow.array`, `table`, `read_table`, `to_numpy` and the sorting functions import pandas if it is installed,
which takes as long as a report.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pyarrow


def array_of(values: Any, missing: Any = None) -> pyarrow.Array:
    """(n,) numbers or Booleans, null where `missing` (n,) is true."""
    import pyarrow as pa

    valid = None if missing is None or not missing.any() else pa.py_buffer(_bits(~missing))
    data = _bits(values) if values.dtype.kind == "b" else np.ascontiguousarray(values)
    kind = pa.from_numpy_dtype(values.dtype)
    return pa.Array.from_buffers(kind, len(values), [valid, pa.py_buffer(data)])


def text_array(texts: Sequence[str | None]) -> pyarrow.Array:
    """Texts, with null for None."""
    import pyarrow as pa

    coded = [(text or "").encode() for text in texts]
    ends = np.cumsum([0, *map(len, coded)], dtype=np.int32)
    missing = np.array([text is None for text in texts], dtype=np.bool_)
    valid = pa.py_buffer(_bits(~missing)) if missing.any() else None
    buffers = [valid, pa.py_buffer(ends), pa.py_buffer(b"".join(coded))]
    return pa.Array.from_buffers(pa.string(), len(coded), buffers)


def _bits(values: Any) -> Any:
    return np.packbits(values, bitorder="little")
