"""The options of `sitl`: the clock that it keeps to."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest
from click.testing import CliRunner

from autopilot.shell.options import Stop, stop_signals
from gcs.shell.link import free_port
from sitl.interfaces import PLUMBLINE, THIRD_PARTY
from sitl.pacing import Pacing
from sitl.shell import program
from sitl.shell.autopilots import AUTOPILOTS
from sitl.shell.command import main

LOCKSTEP, REAL_TIME = "lockstep", "real time"


@pytest.fixture
def kept() -> Iterator[None]:
    """Restore the handlers of signals after the test."""
    before = {number: signal.getsignal(number) for number in stop_signals()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(
    ("options", "loop", "speed"),
    [
        ((), LOCKSTEP, 1.0),
        (("--speed", "4"), LOCKSTEP, 4.0),
        (("--lockstep",), LOCKSTEP, None),
        (("--lockstep", "--speed", "0.5"), LOCKSTEP, 0.5),
        (("--real-time",), REAL_TIME, 1.0),
    ],
    ids=["plain", "speed", "lockstep", "both", "real-time"],
)
def test_the_clock_is_that_of_the_wall_unless_another_is_asked_for(
    monkeypatch: pytest.MonkeyPatch, kept: None, options: tuple[str, ...], loop: str, speed: float | None
) -> None:
    run: list[tuple[str, float | None]] = []

    def run_loop(name: str, pacing: Pacing | None) -> None:
        run.append((name, pacing.speed if pacing else None))
        raise Stop

    monkeypatch.setattr(program, "reduce_latency", lambda real_time: None)
    monkeypatch.setattr(program, "wait_for_autopilot", lambda link, simulator, stop: None)
    monkeypatch.setattr(program, "run_lockstep", lambda *given: run_loop(LOCKSTEP, given[4]))
    monkeypatch.setattr(program, "run_real_time", lambda *given, **_: run_loop(REAL_TIME, given[2]))
    places = [word for name in ("--listen", "--truth") for word in (name, str(free_port()))]
    result = CliRunner().invoke(main, [*places, *options])
    assert (result.exit_code, run) == (0, [(loop, speed)]), result.output
    told = "in lockstep" if speed is None else f"at {speed:g} x real time"
    assert f"250 Hz {told}" in result.stdout


def test_each_autopilot_that_for_offers_is_served() -> None:
    assert list(AUTOPILOTS) == [PLUMBLINE, *THIRD_PARTY]


@pytest.mark.parametrize("firmware", THIRD_PARTY)
def test_a_vehicle_that_the_firmware_cannot_fly_is_refused_before_it_is_waited_for(
    kept: None, firmware: str
) -> None:
    places = [word for name in ("--listen", "--truth") for word in (name, str(free_port()))]
    result = CliRunner().invoke(main, [*places, "--for", firmware, "--vehicle", "hexarotor"])
    assert result.exit_code == 2 and "waiting for" not in result.stdout
    assert result.stderr == (
        "sitl: --vehicle hexarotor: ArduPilot, PX4 and Betaflight need four rotors with alternating spin, "
        'in an X or a plus (frame = "x" or "plus")\n'
    )
