"""The call that goes on in what somebody has brought, for a shell that watches how long it takes.

No clock is read here: a shell that has one gives it to `CALL`, in real time, where a law that is too slow is
one that flies late; or looks at `CALL` from a thread of its own.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass


class TooSlow(Exception):
    """A call took longer than it may."""

    def __str__(self) -> str:
        return "no answer in time"


@dataclass
class Call:
    """The present call, and how many there were."""

    count: int = 0
    going_on: bool = False
    clock: Callable[[], float] | None = None  # s

    def begin(self) -> float:
        """A call begins; when that is, if there is a clock."""
        self.count += 1
        self.going_on = True
        return self.clock() if self.clock is not None else 0.0

    def end(self, began_s: float) -> float:
        """It is over; how long it took, s."""
        self.going_on = False
        return self.clock() - began_s if self.clock is not None else 0.0

    def break_off(self, thread: int) -> None:
        """Raise TooSlow in the call that goes on in a thread (of Python code alone)."""
        if self.going_on:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(TooSlow))


CALL = Call()
