"""A vehicle in real time, and the programs that people fly it with; all are gone when their test is over."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from gcs.link import LOOPBACK, free_port

PROGRAMS = Path(__file__).with_name("programs")
LONG_S = 150.0
END_S = 10.0


class Vehicle(NamedTuple):
    """Where a vehicle speaks."""

    gcs: str  # port
    second_gcs: str
    api: str
    tcp: str
    directory: Path


class Programs:
    """Programs that are stopped at the end, the last first."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.running: list[subprocess.Popen[bytes]] = []

    def begin(self, name: str, *arguments: str) -> tuple[subprocess.Popen[bytes], Path]:
        log = self.directory / f"{name}.log"
        with log.open("wb") as output:
            process = subprocess.Popen(
                [sys.executable, "-m", name, *arguments],
                stdout=output,
                stderr=subprocess.STDOUT,
                cwd=self.directory,
            )
        self.running.append(process)
        return process, log

    def stop(self) -> None:
        for process in reversed(self.running):
            if process.poll() is None:
                process.terminate()
                try:
                    process.wait(END_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait(END_S)


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Callable[..., Vehicle]]:
    """Start a vehicle with such options, wait until it flies with its simulator."""
    programs = Programs(tmp_path)

    def begin(*options: str) -> Vehicle:
        sim, truth, gcs, second, api, tcp = (str(free_port()) for _ in range(6))
        at = f"{LOOPBACK}:".__add__
        programs.begin("sitl", "--listen", at(sim), "--truth", at(truth), "--sensors", "lab")
        where = ("--gcs", at(gcs), "--gcs", at(second), "--api", at(api), "--tcp", at(tcp))
        storage = ("--storage", str(tmp_path / "storage"))
        process, log = programs.begin("autopilot", "--sim", at(sim), *where, *storage, *options)
        while b"flying with the simulator" not in log.read_bytes():
            try:
                code = process.wait(0.2)
            except subprocess.TimeoutExpired:
                continue
            raise AssertionError(f"autopilot ended with {code}: {log.read_text()}")
        return Vehicle(gcs, second, api, tcp, tmp_path)

    yield begin
    programs.stop()


def told_by(program: str, *arguments: str) -> Any:
    """Run one of our programs that use a client library to its end; the JSON of its last line."""
    done = subprocess.run(
        [sys.executable, str(PROGRAMS / program), *arguments],
        capture_output=True,
        text=True,
        timeout=LONG_S,
        check=False,
    )
    assert done.returncode == 0, (done.stdout + done.stderr)[-4000:]
    return json.loads(done.stdout.splitlines()[-1])


class Mavproxy:
    """MAVProxy without a screen: lines in, text out."""

    def __init__(self, master: str, directory: Path) -> None:
        directory.mkdir()
        self.process = subprocess.Popen(
            [
                str(Path(sys.executable).with_name("mavproxy.py")),
                f"--master={master}",
                "--default-modules=link,param,wp,arm,mode,cmdlong,misc,battery,fence,rally,ftp,output",
                f"--state-basedir={directory}",
            ],
            cwd=directory,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self.text = ""
        self.all = ""

    def type(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n".encode())
        self.process.stdin.flush()

    def expect(self, text: str, timeout_s: float = 60.0) -> None:
        """Wait until it has said `text`; what was said until then is forgotten."""
        assert self.process.stdout is not None
        until = time.monotonic() + timeout_s
        while text not in self.text:
            left = until - time.monotonic()
            ready = select.select([self.process.stdout], [], [], max(left, 0.0))[0]
            data = os.read(self.process.stdout.fileno(), 65536) if ready else b""
            assert data, f"MAVProxy did not say {text!r} but {self.all[-2000:]!r}"
            self.text += data.decode(errors="replace")
            self.all += data.decode(errors="replace")
        self.text = self.text.partition(text)[2]

    def end(self) -> None:
        """As when its window is closed."""
        self.process.kill()
        self.process.communicate()


@pytest.fixture
def mavproxy(tmp_path: Path) -> Iterator[Callable[[str], Mavproxy]]:
    """Start MAVProxy: mavproxy("udpin:127.0.0.1:14550")."""
    running: list[Mavproxy] = []

    def begin(master: str) -> Mavproxy:
        running.append(Mavproxy(master, tmp_path / f"mavproxy-{len(running)}"))
        return running[-1]

    yield begin
    for program in running:
        program.end()
