"""Ctrl-C: the first asks to stop in order, the second abandons what is still being done.

A terminal that is closed asks to stop, too, however often that is said: shell and system both say it.
"""

from __future__ import annotations

import os
import signal
from types import FrameType, TracebackType

from autopilot.shell.options import stop_signals
from gcs.shell.display import say


class StopRequest:
    """True once somebody asked to stop, who is told the `hint` then. In force within its `with` block."""

    def __init__(self, hint: str) -> None:
        self.hint = hint
        self._asked = False
        self._process = os.getpid()
        self._before: dict[signal.Signals, object] = {}

    def __bool__(self) -> bool:
        return self._asked

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if os.getpid() != self._process:
            return  # a process that was forked from ours: a terminal asks both, and we decide
        if self._asked:
            if number != signal.SIGHUP:
                raise KeyboardInterrupt
            return
        self._asked = True
        say(self.hint)

    def __enter__(self) -> StopRequest:
        for number in stop_signals():
            self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
