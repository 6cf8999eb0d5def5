"""Betaflight's SITL target in a whole flight of the example in the docs: where PLUMBLINE_BETAFLIGHT names it.

PLUMBLINE_BETAFLIGHT=obj/betaflight_4.6.0_SITL pytest tests/processes/test_betaflight.py

Its ports are fixed: nothing else may use UDP 9002 to 9004 and TCP 5761 meanwhile. Its clock is the wall
clock: on a busy machine its loop may stop (docs/autopilots.md), so it gets priority where permitted.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

VARIABLE = "PLUMBLINE_BETAFLIGHT"
EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "betaflight_hover.py"
FLIGHT_S = 150.0
END_S = 30.0

pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(VARIABLE not in os.environ, reason=f"{VARIABLE} names no program of Betaflight"),
]

Begin = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Begin]:
    begun: list[subprocess.Popen[str]] = []

    def begin(*words: str, stdout: int = subprocess.DEVNULL) -> subprocess.Popen[str]:
        """Start a program in the folder where the firmware keeps its settings."""
        begun.append(subprocess.Popen(words, cwd=tmp_path, stdout=stdout, text=True))
        return begun[-1]

    yield begin
    for process in begun:
        process.kill()
        process.communicate(timeout=END_S)


def example(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(EXAMPLE), *arguments],
        capture_output=True,
        text=True,
        timeout=FLIGHT_S,
        check=False,
    )


def test_the_example_sets_the_firmware_up_hovers_rolls_and_lands(begin: Begin) -> None:
    program = str(Path(os.environ[VARIABLE]).resolve())
    firmware = begin(program)
    assert "saving" in example("--setup").stdout
    firmware.wait(END_S)
    words = (sys.executable, "-m", "sitl", "--for", "betaflight", "--vehicle", "iris")
    simulator = begin(*words, stdout=subprocess.PIPE)
    assert simulator.stdout
    while "waiting for Betaflight" not in simulator.stdout.readline():
        assert simulator.poll() is None
    firmware = begin(program)
    with suppress(PermissionError):
        os.sched_setscheduler(firmware.pid, os.SCHED_FIFO, os.sched_param(1))
    flown = example("--hover", "10")
    assert flown.returncode == 0, flown.stderr
    _, hovered, rolled, *_, last = flown.stdout.splitlines()
    assert last == "landed and disarmed"
    _, within_mm, swing_deg, *pull_n = (float(number) for number in re.findall(r"[0-9.]+", hovered))
    assert within_mm < 200.0 and swing_deg < 5.0
    assert pull_n == pytest.approx([0.3 * 9.81] * 2, abs=0.2)
    asked, rate, *_ = (float(number) for number in re.findall(r"[0-9]+", rolled))
    assert rate == pytest.approx(asked, rel=0.1)
