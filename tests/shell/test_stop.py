"""A program that a signal stops says which it was."""

from __future__ import annotations

import os
import signal

import pytest

from autopilot.shell.options import Stop, StopRequest


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_the_signal_is_named(number: signal.Signals, monkeypatch: pytest.MonkeyPatch) -> None:
    before = {one: signal.getsignal(one) for one in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)}
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        with StopRequest() as stop, pytest.raises(Stop, match=f"^{number.name}$"):
            stop.check()
            os.kill(os.getpid(), number)
            stop.check()
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
