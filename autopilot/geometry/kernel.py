"""How every kernel is compiled, and where its machine code is kept.

numba keys its disk cache by the file of the *outermost* function alone: after a change in a callee it would
go on serving the old machine code. The cache directory is therefore named by a hash over all source files
that hold kernels, so that a stale entry cannot be met.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

import numba
from platformdirs import user_cache_path

_ROOT = Path(__file__).resolve().parents[2]
_KERNEL_ROOMS = ("autopilot", "sitl", "missions", "gcs")

P = ParamSpec("P")
T = TypeVar("T")


def _source_hash() -> str:
    digest = hashlib.sha256()
    for room in _KERNEL_ROOMS:
        for path in sorted((_ROOT / room).rglob("*.py")):
            source = path.read_bytes()
            if b"@kernel" in source:
                digest.update(path.relative_to(_ROOT).as_posix().encode())
                digest.update(source)
    return digest.hexdigest()[:16]


if "NUMBA_CACHE_DIR" not in os.environ:
    # numba.config is filled from the environment; it declares no attributes to a type checker
    vars(numba.config)["CACHE_DIR"] = str(user_cache_path("plumbline") / "kernels" / _source_hash())


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile `function` to machine code with strict IEEE arithmetic and a disk cache.

    Fast-math stays off, so that CPython and machine code agree to the bit. Division by zero gives inf or nan
    as IEEE 754 says, in place of an exception.
    """
    compiled: Callable[P, T] = numba.njit(cache=True, error_model="numpy")(function)
    return compiled
