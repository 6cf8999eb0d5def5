"""Files, logs, plans and signatures of a running vehicle through the programs that people use."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.dialect import plumbline as m
from gcs.shell.link import LOOPBACK, free_port
from tests.doubles.ports import ground_port

if TYPE_CHECKING:
    from conftest import Program

pytestmark = pytest.mark.processes
Start = Callable[..., "Program"]
Gcs = Callable[..., "subprocess.CompletedProcess[str]"]
CLIENTS = Path(__file__).with_name("clients")
LOG = os.urandom(50_000)
LONG_S = 120.0


@pytest.fixture
def port(start: Start, tmp_path: Path) -> str:
    """The port of a vehicle that stands on the ground and has one log."""
    return vehicle(start, tmp_path)


def vehicle(start: Start, tmp_path: Path, *options: str) -> str:
    """Start a vehicle and wait until it flies with its simulator; return its port."""
    sim, truth, ground = (f"{LOOPBACK}:{port}" for port in (free_port(), free_port(), ground_port()))
    logs = tmp_path / "storage" / "card" / "log"
    logs.mkdir(parents=True)
    (logs / "2026-01-01_00-00-00.ulg").write_bytes(LOG)
    start("sitl", "--listen", sim, "--truth", truth, "--sensors", "ideal")
    storage = ("--storage", str(tmp_path / "storage"))
    program = start("autopilot", "--sim", sim, "--gcs", ground, "--api", "none", *storage, *options)
    program.says(b"flying with the simulator")
    return ground.rpartition(":")[2]


def told_by(client: str, *arguments: str) -> Any:
    done = subprocess.run(
        [sys.executable, str(CLIENTS / client), *arguments],
        capture_output=True,
        text=True,
        timeout=LONG_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_mavsdk(port: str, tmp_path: Path) -> None:
    (tmp_path / "client").mkdir()
    told = told_by("mavsdk_files.py", port, str(tmp_path / "client"))
    assert told["root"] == ["@MISSION", "@PARAM", "etc", "fs"]
    assert told["up"] == "SUCCESS"
    assert told["identical"] is True
    assert told["down True"] == told["down False"] == ["SUCCESS", True]
    assert told["moved"] == ["other.bin"]
    assert told["left"] == ["log"]
    table = autopilot_parameters(load_vehicle("bebop"))
    assert told["metadata"].items() >= {name: table.describe(name).text for name in table.names}.items()
    assert told["logs"] == [len(LOG)]
    assert told["log"] == "SUCCESS"
    assert (tmp_path / "client" / "log.ulg").read_bytes() == LOG


def test_pymavlink(port: str, tmp_path: Path) -> None:
    (tmp_path / "client").mkdir()
    told = told_by("pymavlink_files.py", port, str(tmp_path / "client"))
    assert told["codes"] == [0, 0, 0, 0, 0, 0, 9, 10]  # protected, not found
    assert told["equal"] is True
    table = autopilot_parameters(load_vehicle("bebop"))
    for name in table.names:
        assert told["parameters"][name] == pytest.approx(table[name], rel=1e-7)  # a float32


class Mavproxy:
    """MAVProxy without a screen: lines in, text out."""

    def __init__(self, port: str, directory: Path) -> None:
        directory.mkdir()
        self.process = subprocess.Popen(
            [
                str(Path(sys.executable).with_name("mavproxy.py")),
                f"--master=udpin:{LOOPBACK}:{port}",
                "--default-modules=log,param,ftp",
                f"--state-basedir={directory}",
            ],
            cwd=directory,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self.text = ""

    def type(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n".encode())
        self.process.stdin.flush()

    def expect(self, text: str) -> None:
        """Wait until it has printed `text`; discard what it printed until then."""
        assert self.process.stdout is not None
        until = time.monotonic() + LONG_S
        while text not in self.text:
            left = until - time.monotonic()
            ready = select.select([self.process.stdout], [], [], max(left, 0.0))[0]
            data = os.read(self.process.stdout.fileno(), 65536) if ready else b""
            assert data, f"MAVProxy did not say {text!r} but {self.text!r}"
            self.text += data.decode(errors="replace")
        self.text = self.text.partition(text)[2]


@pytest.fixture
def mavproxy(port: str, tmp_path: Path) -> Iterator[Mavproxy]:
    program = Mavproxy(port, tmp_path / "mavproxy")
    yield program
    program.process.kill()
    program.process.communicate()


def test_mavproxy(mavproxy: Mavproxy, tmp_path: Path) -> None:
    mavproxy.expect("parameters (ftp)")  # MAVProxy fetches them by itself
    mavproxy.type("log list")
    mavproxy.expect(f"Log 0  numLogs 1 lastLog 0 size {len(LOG)}")
    mavproxy.type("log download 0 log.ulg")
    mavproxy.expect("Finished downloading log.ulg")
    assert (tmp_path / "mavproxy" / "log.ulg").read_bytes() == LOG
    mavproxy.type("ftp list /fs/microsd/log")
    mavproxy.expect(f"2026-01-01_00-00-00.ulg\t{len(LOG)}")
    mavproxy.type("log erase")
    mavproxy.type("log list")
    mavproxy.expect("No logs")


def test_a_plan_means_the_same_to_mavsdk(port: str, gcs: Gcs, tmp_path: Path) -> None:
    plan, connect = tmp_path / "square.plan", ("--connect", port)
    for command in (("upload", "square"), ("download", str(plan))):
        done = gcs(*command, *connect)
        assert done.returncode == 0, done.stderr
    told = told_by("mavsdk_plan.py", port, str(plan))
    assert len(told["plan"]) > 2
    files_frame = {m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: m.MAV_FRAME_GLOBAL_RELATIVE_ALT}
    assert told["plan"] == [[files_frame.get(frame, frame), *rest] for frame, *rest in told["vehicle"]]


def test_a_signed_vehicle_hears_who_knows_the_key(start: Start, gcs: Gcs, tmp_path: Path) -> None:
    secret = os.urandom(32).hex()
    key = tmp_path / "key"
    key.touch(0o600)
    key.write_text(secret)
    port = vehicle(start, tmp_path, "--signing-key", str(key))
    connect = ("--connect", port)
    done = gcs("--signing-key", str(key), "param", "set", "NGC_KX", "6.5", *connect)
    assert done.returncode == 0, done.stderr
    assert gcs("param", "set", "NGC_KX", "6.0", *connect).returncode == 1
    told = told_by("pymavlink_signing.py", port, secret)
    assert told == {"signed": True, "unsigned": None, "wrong": None, "right": 0, "off": 0}
    got = gcs("param", "get", "NGC_KX", *connect)
    assert "6.5" in got.stdout
    assert not (tmp_path / "storage" / "signing.key").exists()
