"""Builds Arrow arrays from buffers, and names files for Arrow.

`pyarrow.array`, `table`, `read_table`, `to_numpy` and the sorting functions import pandas if it is installed,
which takes as long as a report.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pyarrow


def path_for_arrow(path: Path) -> Path:
    """The path by which Arrow opens a file: absolute, because a relative one with a colon is taken for a URI.
    Arrow must not be given a file object of Python: the threads that read it may abort the process as it
    ends."""
    return path.absolute()


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
