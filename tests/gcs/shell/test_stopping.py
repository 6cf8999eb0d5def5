"""Requests to stop `gcs`, and its output to a terminal that is closed."""

from __future__ import annotations

import os
import pty
import signal
from collections.abc import Iterator

import pytest

from autopilot.shell.options import CloseSafeStream, stop_signals
from gcs.errors import EXIT_INTERRUPTED
from gcs.shell.stopping import StopRequest, stop_exit_code


@pytest.fixture(autouse=True)
def _handlers() -> Iterator[None]:
    """Restore the signal handlers."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)
    with StopRequest(""):
        pass  # forgets the signals of the test


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_first_asks_and_ctrl_c_after_it_abandons(number: signal.Signals) -> None:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    with StopRequest("stopping") as stop:
        os.kill(os.getpid(), number)
        assert stop
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        for _ in range(2):  # what is abandoned is cleared away undisturbed
            os.kill(os.getpid(), signal.SIGINT)


def test_a_closed_terminal_may_be_told_twice(capsys: pytest.CaptureFixture[str]) -> None:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    with StopRequest("stopping") as stop:
        for _ in range(3):
            os.kill(os.getpid(), signal.SIGHUP)
        assert stop
    assert capsys.readouterr().err == "gcs: SIGHUP (the terminal was closed): stopping\n"


@pytest.mark.parametrize(
    ("number", "code", "reason", "told"),
    [
        (signal.SIGINT, 130, "stopped by the user", "stopping"),
        (signal.SIGTERM, 143, "stopped by SIGTERM", "SIGTERM: stopping"),
        (
            signal.SIGHUP,
            129,
            "stopped by SIGHUP (the terminal was closed)",
            "SIGHUP (the terminal was closed): stopping",
        ),
    ],
)
def test_who_stopped_it_is_told_and_in_the_exit_code(
    number: signal.Signals, code: int, reason: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    with StopRequest("stopping") as stop:
        assert stop_exit_code() == EXIT_INTERRUPTED, "without a signal"
        os.kill(os.getpid(), number)
        assert (stop.reason, stop_exit_code()) == (reason, code)
    assert capsys.readouterr().err == f"gcs: {told}\n"
    assert stop_exit_code() == code


def test_what_was_begun_to_outlive_its_terminal_does() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    assert signal.SIGHUP not in stop_signals()
    with StopRequest("stopping") as stop:
        os.kill(os.getpid(), signal.SIGHUP)
        assert not stop


def test_what_is_said_to_a_closed_terminal_is_lost() -> None:
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as terminal:
        stream = CloseSafeStream(terminal)
        stream.write("heard\n")
        stream.flush()
        assert os.read(ours, 100) == b"heard\r\n"
        assert stream.isatty()
        os.close(ours)
        for _ in range(2):
            assert stream.write("lost\n") == 5
            stream.flush()
