"""Ctrl-C: the first requests an orderly stop, the second abandons what is still being done.

Closing the terminal requests an orderly stop too, and repeating it has no effect: both the shell and the
system send the signal.
"""

from __future__ import annotations

import os
import signal
from types import FrameType, TracebackType

from autopilot.shell.options import stop_signals
from gcs.shell.display import notify


class StopRequest:
    """True after a stop was requested; the `hint` is printed then. In force within its `with` block."""

    def __init__(self, hint: str) -> None:
        self.hint = hint
        self._is_requested = False
        self._process = os.getpid()
        self._before: dict[signal.Signals, object] = {}

    def __bool__(self) -> bool:
        return self._is_requested

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if os.getpid() != self._process:
            return  # a forked process: the terminal signals both, and the parent decides
        if self._is_requested:
            if number != signal.SIGHUP:
                raise KeyboardInterrupt
            return
        self._is_requested = True
        notify(self.hint)

    def __enter__(self) -> StopRequest:
        for number in stop_signals():
            self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
