"""A watch over the calls of user code: a call that does not return is broken off.

This works only for Python code: machine code cannot be interrupted. In the main thread a signal also wakes a
call that sleeps or waits. The signal is SIGURG, which the system ignores where a program does not handle it.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from autopilot.own.calls import CALL, TooSlow

LONGEST_S = 5.0  # longest call, on the wall clock
_LOOKS = 10  # checks in that time: a call that begins after a check may last longer by up to one interval

_WAKING = signal.SIGURG


@contextmanager
def watched_calls(real_time: bool = False, longest_s: float = LONGEST_S) -> Iterator[None]:
    """Watch the calls in this thread; each is broken off after `longest_s`, or a little later.

    In real time their duration is also measured against the time available to them.
    """
    ended, thread = threading.Event(), threading.get_ident()
    wakes = threading.current_thread() is threading.main_thread()
    stop = partial(_wake, thread) if wakes else partial(CALL.break_off, thread)
    watch = threading.Thread(target=_watch, args=(ended, stop, longest_s), daemon=True)
    CALL.clock = time.perf_counter if real_time else None
    before = signal.signal(_WAKING, _woken) if wakes else None
    watch.start()
    try:
        yield
    finally:
        ended.set()
        watch.join()
        if wakes:
            signal.signal(_WAKING, before)
        CALL.clock = None


def _watch(ended: threading.Event, stop: Callable[[], None], longest_s: float) -> None:
    seen, looks = -1, 0
    while not ended.wait(longest_s / _LOOKS):
        count = CALL.count if CALL.going_on else -1
        looks = looks + 1 if count == seen >= 0 else 0
        seen = count
        if looks == _LOOKS:
            stop()
            looks = 0


def _wake(thread: int) -> None:
    signal.pthread_kill(thread, _WAKING)


def _woken(_signal: int, _frame: object) -> None:
    """Signal handler; runs in the main thread, during the call or just after it."""
    if CALL.going_on:
        raise TooSlow
