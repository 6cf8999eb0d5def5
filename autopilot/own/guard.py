"""Calls methods of custom classes, and reports what is wrong with them.

A class that raises, or returns something invalid, is not called again; `fault` says why, with file and line.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from statistics import median
from typing import Any, TypeVar

from autopilot.own.calls import USER_CALL
from autopilot.own.interruption import is_interruption
from autopilot.own.loaded_class import LoadedClass
from autopilot.own.source import error_text

T = TypeVar("T")

TOO_SLOW = "too slow"  # ends the fault of a class that takes too long
_AVERAGED_CALLS = 250  # number of calls over which the average duration must not exceed the available time
# Number of calls whose median duration must not exceed it either: a machine that stalls lengthens few calls,
# a slow class all of them. In real time the vehicle would be lost before the average is known.
_MEDIAN_CALLS = 25
_MAX_REPR = 60  # characters of what a method returned


class CallError(Exception):
    """A method has returned something invalid, or takes too long."""


class Guard:
    """The guard of one class in one flight. `on_failure` is called, perhaps amid a tick, when it has
    failed."""

    def __init__(self, loaded_class: LoadedClass, on_failure: Callable[[], None]) -> None:
        self.loaded_class = loaded_class
        self.fault = ""
        self.interrupted: BaseException | None = None  # not the class's fault: raised outside the tick
        self.reason = ""  # why the last call had no answer
        self._on_failure = on_failure
        self._durations_s: deque[float] = deque(maxlen=_AVERAGED_CALLS)  # durations of the last calls

    def call(
        self, method: str, period_s: float, call_method: Callable[[], Any], check: Callable[[Any], T]
    ) -> T | None:
        """The checked result of `call_method`, which calls this method; None if there is none, and `reason`
        says why. In real time, calls must not take longer than `period_s` on average, nor usually."""
        self.reason = ""
        start_s = USER_CALL.begin()
        try:
            answer = call_method()
            duration_s = USER_CALL.end(start_s)
            result = check(answer)
            self._check_duration(method, duration_s, period_s)
        except CallError as call_error:
            self.reason = f"{call_error} ({self.loaded_class.location(method)})"
        except BaseException as error:
            if is_interruption(error):
                self.interrupted, self.reason = error, "interrupted"
            else:
                self.reason = error_text(error, self.loaded_class.path, self.loaded_class.location(method))
        else:
            return result
        finally:
            USER_CALL.end(start_s)
        return None

    def fail(self, reason: str) -> None:
        """Record that the class has failed."""
        self.fault = f"{self.loaded_class.label} failed: {reason}"
        self._on_failure()

    def raise_interruption(self) -> None:
        """Raise the exception that interrupted the class: it cannot pass through the compiled tick itself."""
        if self.interrupted is not None:
            raise self.interrupted

    def _check_duration(self, method: str, duration_s: float, period_s: float) -> None:
        if USER_CALL.clock is None:
            return
        self._durations_s.append(duration_s)
        count, usual_s = len(self._durations_s), 0.0
        if count == _AVERAGED_CALLS:
            usual_s = sum(self._durations_s) / count
        elif count % _MEDIAN_CALLS == 0:
            usual_s = median(self._durations_s)
        if usual_s > period_s:
            raise CallError(
                f"{method} takes {1e3 * usual_s:.1f} ms, and there are {1e3 * period_s:.1f} ms: {TOO_SLOW}"
            )


class MethodCaller:
    """Calls the methods of an instance in plain Python, and keeps its memory."""

    def __init__(self, guard: Guard, check: Callable[[Any, str], tuple[Any, T]]) -> None:
        self.instance: Any = None  # the instance, with the present parameters
        self._guard = guard
        self._check = check
        self._memory: Any = None

    def call(self, method: str, now: Any, period_s: float) -> Any:
        """The answer of a method; None if there is none, and the guard has the reason."""

        def call_method() -> Any:
            if now.begins:
                self._memory = self.instance.start(now) if hasattr(self.instance, "start") else None
            return getattr(self.instance, method)(self._memory, now)

        memory_answer = self._guard.call(
            method, period_s, call_method, lambda memory_answer: self._check(memory_answer, method)
        )
        if memory_answer is None:
            return None
        self._memory, answer = memory_answer
        return answer


def short_repr(value: Any) -> str:
    """A value as text for a message, cut if it is long."""
    text = repr(value)
    return text if len(text) <= _MAX_REPR else f"{text[: _MAX_REPR - 3]}..."


def memory_and_answer(answer: Any, method: str, constructors: str) -> tuple[Any, Any]:
    """The pair of memory and answer that a method has returned; raises CallError if it returned anything
    else. `constructors` says how the answer is made."""
    if not (isinstance(answer, tuple) and len(answer) == 2):
        raise CallError(
            f"{method} returned {short_repr(answer)}, which must be (memory, {constructors}) or the like"
        )
    return answer
