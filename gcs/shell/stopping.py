"""Ctrl-C: the first requests an orderly stop, the second abandons what is still being done; more do nothing.

SIGTERM does the same. Closing the terminal requests an orderly stop too, and repeating it has no effect: both
the shell and the system send the signal.
"""

from __future__ import annotations

import os
import signal
from types import FrameType, TracebackType

from autopilot.shell.options import stop_signals
from gcs.errors import EXIT_INTERRUPTED
from gcs.shell.display import notify

_received: list[int] = []  # the signals that the last `StopRequest` has handled


def stop_exit_code() -> int:
    """The exit code of a command that was stopped, by which shells tell the signal; without one, Ctrl-C's."""
    return 128 + _received[-1] if _received else EXIT_INTERRUPTED


class StopRequest:
    """True after a stop was requested; the `hint` is printed then. In force within its `with` block."""

    def __init__(self, hint: str) -> None:
        self.hint = hint
        self._is_requested = self._is_abandoned = False
        self._process = os.getpid()
        self._before: dict[signal.Signals, object] = {}

    def __bool__(self) -> bool:
        return self._is_requested

    @property
    def reason(self) -> str:
        """Who requested the stop."""
        return (
            "stopped by the user" if _received[-1] == signal.SIGINT else f"stopped by {_name(_received[-1])}"
        )

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if os.getpid() != self._process:
            return  # a forked process: the terminal signals both, and the parent decides
        if self._is_requested:
            if number != signal.SIGHUP and not self._is_abandoned:
                self._is_abandoned = True
                _received.append(number)
                raise KeyboardInterrupt
            return
        _received.append(number)
        self._is_requested = True
        notify(self.hint if number == signal.SIGINT else f"{_name(number)}: {self.hint}")

    def __enter__(self) -> StopRequest:
        _received.clear()
        for number in stop_signals():
            self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]


def _name(number: int) -> str:
    return "SIGHUP (the terminal was closed)" if number == signal.SIGHUP else signal.Signals(number).name
