"""Calls methods of custom classes, and reports what is wrong with them.

A class that raises, or returns something invalid, is not called again; `fault` says why, with file and line.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, TypeVar

from autopilot.own.brought import Brought
from autopilot.own.calls import CALL
from autopilot.own.interruption import is_interruption
from autopilot.own.source import blamed

T = TypeVar("T")

_WATCHED = 250  # number of calls over which the average duration must not exceed the available time
_SHOWN = 60  # characters of what a method returned


class Wrong(Exception):
    """A method has returned something invalid, or takes too long."""


class Guard:
    """The guard of one class in one flight. `failed` is called, perhaps amid a tick, when it has failed."""

    def __init__(self, brought: Brought, failed: Callable[[], None]) -> None:
        self.brought = brought
        self.fault = ""
        self.interrupted: BaseException | None = None  # not the class's fault: raised outside the tick
        self.why = ""  # why the last call had no answer
        self._failed = failed
        self._took: deque[float] = deque(maxlen=_WATCHED)  # s, durations of the last calls

    def call(
        self, method: str, period_s: float, answer: Callable[[], Any], checked: Callable[[Any], T]
    ) -> T | None:
        """The checked result of `answer`, which calls this method; None if there is none, and `why` says why.
        In real time, calls must not take longer than `period_s` on average."""
        self.why = ""
        began_s = CALL.begin()
        try:
            found = answer()
            took_s = CALL.end(began_s)
            right = checked(found)
            self._hold_to_time(method, took_s, period_s)
        except Wrong as wrong:
            self.why = f"{wrong} ({self.brought.line(method)})"
        except BaseException as error:
            if is_interruption(error):
                self.interrupted, self.why = error, "interrupted"
            else:
                self.why = blamed(error, self.brought.path, self.brought.line(method))
        else:
            return right
        finally:
            CALL.end(began_s)
        return None

    def fail(self, why: str) -> None:
        """Record that the class has failed."""
        self.fault = f"{self.brought.told} failed: {why}"
        self._failed()

    def raise_interruption(self) -> None:
        """Raise the exception that interrupted the class: it cannot pass through the compiled tick itself."""
        if self.interrupted is not None:
            raise self.interrupted

    def _hold_to_time(self, method: str, took_s: float, period_s: float) -> None:
        if CALL.clock is None:
            return
        self._took.append(took_s)
        mean_s = sum(self._took) / len(self._took)
        if len(self._took) == _WATCHED and mean_s > period_s:
            raise Wrong(
                f"{method} takes {1e3 * mean_s:.1f} ms, and there are {1e3 * period_s:.1f} ms: too slow"
            )


class Calling:
    """Calls the methods of an instance in plain Python, and keeps its memory."""

    def __init__(self, guard: Guard, checked: Callable[[Any, str], tuple[Any, T]]) -> None:
        self.made: Any = None  # the instance, with the present parameters
        self._guard = guard
        self._checked = checked
        self._memory: Any = None

    def call(self, method: str, now: Any, period_s: float) -> Any:
        """The answer of a method; None if there is none, and the guard has the reason."""

        def answer() -> Any:
            if now.begins:
                self._memory = self.made.start(now) if hasattr(self.made, "start") else None
            return getattr(self.made, method)(self._memory, now)

        found = self._guard.call(method, period_s, answer, lambda found: self._checked(found, method))
        if found is None:
            return None
        self._memory, answered = found
        return answered


def shown(value: Any) -> str:
    """A value as text for a message, cut if it is long."""
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."


def pair_of(answer: Any, method: str, made: str) -> tuple[Any, Any]:
    """The pair of memory and answer that a method has returned; raises Wrong if it returned anything else.
    `made` says how the answer is made."""
    if not (isinstance(answer, tuple) and len(answer) == 2):
        raise Wrong(f"{method} returned {shown(answer)}, which must be (memory, {made}) or the like")
    return answer
