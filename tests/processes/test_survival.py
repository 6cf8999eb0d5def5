"""Programs that are killed, and what is still there after their restart."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gcs.shell.link import LOOPBACK, free_port
from tests.doubles.ports import ground_port

if TYPE_CHECKING:
    from click.testing import Result
    from conftest import Program

pytestmark = pytest.mark.processes
Start = Callable[..., "Program"]
Command = Callable[..., "Result"]
# on a busy machine a phase may pass between two outputs; "mission" also occurs in that of the compilation
IN_THE_AIR = b"(tauten|lift|hold|lower)"


def test_mission_and_parameters_outlive_a_killed_autopilot(
    start: Start, command: Command, tmp_path: Path
) -> None:
    """As by kill -9 in the middle of a mission."""
    sim, truth, ground = (f"{LOOPBACK}:{port}" for port in (free_port(), free_port(), ground_port()))
    storage = str(tmp_path / "storage")

    def autopilot() -> Program:
        program = start("autopilot", "--sim", sim, "--gcs", ground, "--api", "none", "--storage", storage)
        program.says(b"flying with the simulator")
        return program

    start("sitl", "--listen", sim, "--truth", truth, "--sensors", "ideal")
    first = autopilot()
    connect = ("--connect", ground)
    for asked in (
        ("upload", "square"),
        ("param", "set", "NGC_KX", "6.5"),
        ("start",),
        ("arm",),
    ):
        done = command(*asked, *connect)
        assert done.exit_code == 0, f"{asked}: {done.stderr} {done.exception!r}"
    uploaded = command("download", "--json", *connect).stdout
    status = json.loads(command("status", "--json", *connect).stdout)
    assert status["armed"] is True
    (paths,) = _children(first.process.pid)
    first.kill()

    autopilot()
    assert not _runs(paths), "the process that prepares paths is gone with whom it does it for"
    value = command("param", "get", "NGC_KX", *connect)
    assert value.exit_code == 0, value.stderr
    assert "6.5" in value.stdout
    downloaded = command("download", "--json", *connect)
    assert downloaded.exit_code == 0, downloaded.stderr
    assert json.loads(downloaded.stdout) == json.loads(uploaded)


def test_ctrl_c_stops_everything_and_still_writes_what_was_captured(start: Start, tmp_path: Path) -> None:
    out = tmp_path / "out"
    flight = start("gcs", "fly", "hover", "--sensors", "ideal", "--speed", "2", "--out", str(out))
    flight.says(b"  " + IN_THE_AIR + b"  ")  # progress is printed even without a terminal
    children = _children(flight.process.pid)
    assert len(children) == 2
    code = flight.interrupt()
    assert code == 130, flight.log.read_text()
    assert json.loads((out / "summary.json").read_text())["outcome"] == "interrupted"
    assert (out / "report.html").stat().st_size > 0
    assert not [pid for pid in children if Path(f"/proc/{pid}").exists()]


def test_a_closed_terminal_ends_a_flight_as_ctrl_c_does(tmp_path: Path) -> None:
    """The terminal closes first, so that nothing more can be printed; then shell and system send SIGHUP."""
    ours, theirs = pty.openpty()
    words = ["gcs", "fly", "hover", "--sensors", "ideal", "--speed", "2", "--out", str(tmp_path / "out")]
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # a child inherits it; under nohup it is ignored
    flight = subprocess.Popen(
        [sys.executable, "-m", *words], stdin=theirs, stdout=theirs, stderr=theirs, cwd=tmp_path
    )
    signal.signal(signal.SIGHUP, before)
    os.close(theirs)
    try:
        said = b""
        while not re.search(IN_THE_AIR, said):
            try:
                said += os.read(ours, 4096)
            except OSError:  # the other end is closed
                raise AssertionError(said.decode(errors="replace")) from None
        os.close(ours)
        flight.send_signal(signal.SIGHUP)
        flight.send_signal(signal.SIGHUP)
        assert flight.wait(60.0) == 129
    finally:
        flight.kill()
        flight.wait()
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["outcome"] == "interrupted"
    assert (tmp_path / "out" / "report.html").stat().st_size > 0


def _runs(pid: int) -> bool:
    """Whether a process runs; False also if it has ended and its parent has not yet waited for it."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


def _children(pid: int) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(child) for child in text.split()]
