"""Plain functions that kernels may call, marked without loading numba: programs without kernels need none.

numba takes half a second to import, which is most of what a command like `gcs status` would take.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

_pending: list[Callable[..., Any]] = []  # until numba is loaded
_register_jitable: list[Callable[[Any], Any]] = []  # numba's own decorator, once numba is loaded


def jitable(function: F) -> F:
    """Mark a function that kernels may call; it stays a plain function."""
    if _register_jitable:
        _register_jitable[0](function)
    else:
        _pending.append(function)
    return function


def register_with(register: Callable[[Any], Any]) -> None:
    """Pass all functions marked so far, and all marked later, to numba's `register_jitable`."""
    _register_jitable[:] = [register]
    while _pending:
        register(_pending.pop())
