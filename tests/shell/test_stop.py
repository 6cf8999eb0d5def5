"""A program that a signal stops says which it was."""

from __future__ import annotations

import os
import signal

import pytest

from autopilot.shell.options import Stop, StopRequest, print_stop


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


def test_a_quiet_program_tells_only_that_another_than_its_user_stopped_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    print_stop("autopilot", 1_500_000, "SIGTERM", "no tick was late", quiet=False)
    assert capsys.readouterr() == ("autopilot: stopped at t = 1.500 s by SIGTERM; no tick was late\n", "")
    print_stop("autopilot", 1_500_000, "SIGTERM", "no tick was late", quiet=True)
    assert capsys.readouterr() == ("", "autopilot: stopped at t = 1.500 s by SIGTERM\n")
    print_stop("autopilot", 1_500_000, "SIGINT", "", quiet=True)
    assert capsys.readouterr() == ("", "")
