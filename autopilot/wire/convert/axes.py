"""The changes of axes of `autopilot.geometry.frames` for messages that are built in Python.

They are the same functions as plain Python, because calling machine code costs more than converting three
numbers. Kernels may call them as well.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.extending import register_jitable

from autopilot.geometry import frames
from autopilot.geometry.linear import Vec3


def _in_python(compiled: Any) -> Any:
    return register_jitable(getattr(compiled, "py_func", compiled))


ned_from_enu: Callable[[Vec3], Vec3] = _in_python(frames.ned_from_enu)
frd_from_flu: Callable[[Vec3], Vec3] = _in_python(frames.frd_from_flu)
