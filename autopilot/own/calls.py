"""The present call of user code, for a shell that watches how long it takes.

No clock is read here: in real time, where a slow law flies late, the shell gives its clock to `USER_CALL`;
or it watches `USER_CALL` from a separate thread.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from math import inf


class TooSlow(Exception):
    """A call took longer than allowed."""

    def __str__(self) -> str:
        return f"no answer within {USER_CALL.max_call_s:g} s: an endless loop, or too much work for one call"


@dataclass
class UserCall:
    """The present call, and the number of calls so far."""

    count: int = 0
    in_progress: bool = False
    clock: Callable[[], float] | None = None  # s
    max_call_s: float = inf  # after which a call is broken off

    def begin(self) -> float:
        """Note that a call begins; return the time in s, or 0 without a clock."""
        self.count += 1
        self.in_progress = True
        return self.clock() if self.clock is not None else 0.0

    def end(self, start_s: float) -> float:
        """Note that the call has ended; return how long it took in s, or 0 without a clock."""
        self.in_progress = False
        return self.clock() - start_s if self.clock is not None else 0.0

    def abort(self, thread: int) -> None:
        """Raise TooSlow in the present call, which runs in this thread (only Python code can be stopped)."""
        if self.in_progress:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(TooSlow))


USER_CALL = UserCall()
