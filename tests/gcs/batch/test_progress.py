"""Progress: bars on a terminal, plain lines elsewhere, nothing if quiet."""

from __future__ import annotations

import pytest

from gcs.batch.progress import BatchDisplay
from gcs.shell import display as display_module
from gcs.shell.display import LiveBars, StepDisplay

CURSOR = "\x1b[?25h"  # shows the cursor again
RUNNING = (("Case A", "gcs: lift"), ("Case B", ""))


class Clock:
    """A clock that is set by the test."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr("time.monotonic", made.monotonic)
    return made


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(display_module, "stderr_is_terminal", lambda: True)
    monkeypatch.setenv("FORCE_COLOR", "1")  # with it rich, too, treats the captured output as a terminal
    monkeypatch.setenv("COLUMNS", "120")


def lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return capsys.readouterr().err.splitlines()


def test_plain_lines_come_at_first_every_ten_seconds_and_at_the_end(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    with BatchDisplay(10, 40, quiet=False) as display:
        display.add(0, 0, RUNNING)
        assert lines(capsys) == ["gcs: 10 of 40 flights; running: Case A; Case B"]
        clock.now_s += 5.0
        display.add(5, 4)
        assert lines(capsys) == [], "too early"
        clock.now_s += 7.0
        display.add(5, 5)
        assert lines(capsys) == [
            "gcs: 20 of 40 flights flown, 90 % of them completed, 50.0 flights/min, 24 s remaining"
        ]
        clock.now_s += 20.0
        display.add(0, 0)
        assert lines(capsys) == [], "nothing new"
        display.add(20, 20)
        assert lines(capsys) == ["gcs: 40 of 40 flights flown, 97 % of them completed, 56.2 flights/min"]
        display.add(0, 0)
        assert lines(capsys) == []
    assert (display.flown, display.completed) == (30, 29)
    assert display.elapsed_s == pytest.approx(32.0)


def test_a_terminal_shows_a_bar_and_a_line_for_each_flight_that_runs(
    clock: Clock, terminal: None, capsys: pytest.CaptureFixture[str]
) -> None:
    with BatchDisplay(0, 4, quiet=False) as display:
        display.add(0, 0, RUNNING)
        first = capsys.readouterr().err
        assert "Case A: lift" in first and "Case B: starting" in first and "0/4" in first
        clock.now_s += 1.0
        display.add(1, 1, RUNNING[:1])
        second = capsys.readouterr().err
        assert "Case A: lift" in second and "Case B" not in second and "1/4" in second
    assert capsys.readouterr().err.endswith(CURSOR), "the terminal is given back"


def test_quiet_is_quiet(clock: Clock, terminal: None, capsys: pytest.CaptureFixture[str]) -> None:
    with BatchDisplay(0, 4, quiet=True) as display, StepDisplay("figures", quiet=True) as figures:
        for _ in range(4):
            clock.now_s += 20.0
            display.add(1, 1, RUNNING)
            figures.update(1, 2)
    assert capsys.readouterr().err == ""
    assert display.flown == 4


def test_a_short_step_shows_no_bar(clock: Clock, terminal: None, capsys: pytest.CaptureFixture[str]) -> None:
    with StepDisplay("figures") as figures:
        clock.now_s += 0.4
        figures.update(1, 9)
        assert capsys.readouterr().err == ""
        clock.now_s += 0.2
        figures.update(2, 9, "figures  fig-4-07.png")
        assert "fig-4-07.png" in capsys.readouterr().err


def test_columns_are_for_each_display_to_say() -> None:
    with pytest.raises(NotImplementedError):
        LiveBars(quiet=False).columns()
