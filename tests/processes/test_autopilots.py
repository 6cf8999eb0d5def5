"""Third-party autopilots in whole flights: where PLUMBLINE_ARDUCOPTER or PLUMBLINE_PX4 names the program.

PLUMBLINE_ARDUCOPTER=./arducopter pytest tests/processes/test_autopilots.py
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

VARIABLES = {"ardupilot": "PLUMBLINE_ARDUCOPTER", "px4": "PLUMBLINE_PX4"}
TITLES = {"ardupilot": "ArduPilot", "px4": "PX4"}
FLIGHT_S = 300.0
END_S = 30.0
MISSION = """
title = "Hop"
description = "Lifts the load, carries it two metres and sets it down."

[[items]]
type = "takeoff"
altitude_m = 1.0

[[items]]
type = "waypoint"
east_m = 2.0
north_m = 0.0
altitude_m = 1.0
hold_s = 1.0

[[items]]
type = "land"
"""

pytestmark = pytest.mark.processes


@pytest.fixture(params=list(VARIABLES))
def kind(request: pytest.FixtureRequest) -> str:
    variable = VARIABLES[request.param]
    if variable not in os.environ:
        pytest.skip(f"{variable} names no program of {TITLES[request.param]} to fly with")
    return str(request.param)


@pytest.fixture
def begin(tmp_path: Path, kind: str) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    mission = tmp_path / "hop.toml"
    mission.write_text(MISSION, encoding="utf-8")
    begun: list[subprocess.Popen[str]] = []

    def begin(*options: str) -> subprocess.Popen[str]:
        autopilot = f"{kind}={os.environ[VARIABLES[kind]]}"
        arguments = ["fly", str(mission), "--autopilot", autopilot, "--vehicle", "iris", "--sensors", "rtk"]
        process = subprocess.Popen(
            [sys.executable, "-m", "gcs", *arguments, "--out", str(tmp_path / "flight"), *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        begun.append(process)
        return process

    yield begin
    for process in begun:
        if process.poll() is None:
            process.terminate()
            process.communicate(timeout=END_S)


def children(process: subprocess.Popen[str]) -> dict[str, int]:
    """The process ids of simulator and firmware."""
    listed = subprocess.run(
        ["ps", "-ww", "--ppid", str(process.pid), "-o", "pid=,args="],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout
    found = {}
    for line in listed.splitlines():
        pid, words = line.split(maxsplit=1)
        if "-m sitl" in words:
            found["sitl"] = int(pid)
        elif "--model" in words or "init.d-posix" in words:
            found["firmware"] = int(pid)
    return found


def flies(process: subprocess.Popen[str]) -> None:
    """Wait until the process reports that it flies."""
    assert process.stderr
    said = [process.stderr.readline()]
    while "flying" not in said[-1]:
        assert said[-1], "".join(said)
        said.append(process.stderr.readline())


def test_the_load_is_lifted_carried_and_set_down(
    kind: str, begin: Callable[..., subprocess.Popen[str]]
) -> None:
    said, wrong = (process := begin("--json")).communicate(timeout=FLIGHT_S)
    assert process.returncode == 0, wrong
    record = json.loads(said)
    assert (record["outcome"], record["law"]) == ("completed", kind)
    # it knows of no load: the error is that of the truth, and its bound is as loose as its GNSS
    assert 0.01 < record["load_error_max_m"] < 0.6
    assert 5.0 < record["flight_s"] < 60.0
    assert record["tension_max_n"] > 0.3 * 9.81
    assert record["slack_events"] == 0 and record["matched_fraction"] == 1.0


@pytest.mark.parametrize("name", ["sitl", "firmware"])
def test_one_that_is_killed_ends_the_flight_with_its_name(
    name: str, kind: str, begin: Callable[..., subprocess.Popen[str]]
) -> None:
    process = begin("--speed", "2")
    flies(process)
    os.kill(children(process)[name], signal.SIGKILL)
    _, wrong = process.communicate(timeout=FLIGHT_S)
    called = {"sitl": "sitl", "firmware": TITLES[kind]}[name]
    assert process.returncode == 1
    assert re.search(rf"lost: {called} was killed by SIGKILL", wrong)


@pytest.mark.parametrize("name", ["sitl", "firmware"])
def test_one_that_stands_still_ends_the_flight_with_its_name(
    name: str, kind: str, begin: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    process = begin("--speed", "2")
    flies(process)
    stopped = children(process)[name]
    os.kill(stopped, signal.SIGSTOP)
    _, wrong = process.communicate(timeout=FLIGHT_S)
    called = {"sitl": "sitl", "firmware": TITLES[kind]}[name]
    assert process.returncode == 1
    told = rf"lost: {called} \(process {stopped}\) stopped by a signal; the vehicle fell silent while flying"
    assert re.search(told, wrong)
    if name == "firmware":
        silent = "no answer from PX4" if kind == "px4" else "no answer from the autopilot"
        assert silent in (tmp_path / "flight" / "sitl.log").read_text()


def test_ctrl_c_leaves_a_report_and_no_process(
    begin: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    process = begin("--speed", "2")
    flies(process)
    started = children(process)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=FLIGHT_S)
    assert process.returncode == 130
    assert (tmp_path / "flight" / "report.html").exists()
    for pid in started.values():
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
