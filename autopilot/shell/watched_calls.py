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

from autopilot.own.calls import USER_CALL, TooSlow

MAX_CALL_S = 5.0  # longest call, on the wall clock
_CHECKS = 10  # checks in that time: a call that begins after a check may last longer by up to one interval

_WAKE_SIGNAL = signal.SIGURG


@contextmanager
def watched_calls(real_time: bool = False, max_call_s: float = MAX_CALL_S) -> Iterator[None]:
    """Watch the calls in this thread; each is broken off after `max_call_s`, or a little later.

    In real time their duration is also measured against the time available to them.
    """
    ended, thread = threading.Event(), threading.get_ident()
    is_main_thread = threading.current_thread() is threading.main_thread()
    stop = partial(_wake, thread) if is_main_thread else partial(USER_CALL.abort, thread)
    watch = threading.Thread(target=_watch, args=(ended, stop, max_call_s), daemon=True)
    USER_CALL.clock = time.perf_counter if real_time else None
    USER_CALL.max_call_s = max_call_s
    before = signal.signal(_WAKE_SIGNAL, _on_wake) if is_main_thread else None
    watch.start()
    try:
        yield
    finally:
        ended.set()
        watch.join()
        if is_main_thread:
            signal.signal(_WAKE_SIGNAL, before)
        USER_CALL.clock = None


def _watch(ended: threading.Event, stop: Callable[[], None], max_call_s: float) -> None:
    last_count, checks = -1, 0
    while not ended.wait(max_call_s / _CHECKS):
        count = USER_CALL.count if USER_CALL.in_progress else -1
        checks = checks + 1 if count == last_count >= 0 else 0
        last_count = count
        if checks == _CHECKS:
            stop()
            checks = 0


def _wake(thread: int) -> None:
    signal.pthread_kill(thread, _WAKE_SIGNAL)


def _on_wake(_signal: int, _frame: object) -> None:
    """Signal handler; runs in the main thread, during the call or just after it."""
    if USER_CALL.in_progress:
        raise TooSlow
