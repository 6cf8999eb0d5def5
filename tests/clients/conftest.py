"""Vehicles in real time, and the programs that people fly them with; all are ended after the tests.

A flight in real time takes long, so all flights that the collected tests use begin with the first of these
tests and are flown side by side; each test then judges the results of one of them. See `staged`.
"""

from __future__ import annotations

import json
import os
import re
import select
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise
from math import dist
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autopilot.wire.codec import Received, decode
from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.samples import CARRIED
from gcs.shell.link import LOOPBACK, free_port

PROGRAMS = Path(__file__).with_name("programs")
LONG_S = 300.0  # on a busy machine
END_S = 10.0
# for programs that threads start: pytest changes the variables of this process at each test, and a program
# that inherits them at that moment cannot be started (EFAULT)
ENVIRONMENT = dict(os.environ)
AT_ONCE = 2  # flights: as many as two cores fly, beside other tests, without a client that loses messages

# Words that no client may print, whatever it means by them
COMPLAINT = re.compile(
    r"(?i:warn|error|fail|time(d )?-?out|breach|traceback|exception|no such|unknown|denied|reject|lost)"
    r"|refused|UNSUPPORTED"
)


# MAVSDK asks again after half a second of the wall clock, within which a busy machine may not have answered;
# asking a second time is a complaint
ASKED_AGAIN = "sending again, retries to do: 5 "


def complaints(text: str) -> list[str]:
    """The lines of a client's output that are complaints."""
    return [line for line in text.splitlines() if COMPLAINT.search(line) and ASKED_AGAIN not in line]


Place = tuple[float, float, float]  # east, north, up


@dataclass
class Witness:
    """Listens at two ports: to the simulated world, and to the vehicle as a station that is silent."""

    truth: socket.socket
    ground: socket.socket
    load: list[tuple[float, Place]] = field(default_factory=list)  # vehicle's clock, s; true place, m
    asked: list[tuple[float, Place]] = field(default_factory=list)  # setpoint of the carried load
    phases: list[int] = field(default_factory=list)
    tilt: float = 0.0  # greatest of all, rad
    yaw: float = 0.0  # the last one, rad from north
    texts: list[str] = field(default_factory=list)
    attitudes: list[tuple[float, float]] = field(default_factory=list)  # ATTITUDE: wall, vehicle's clock, s
    _over: threading.Event = field(default_factory=threading.Event)

    def watch(self) -> None:
        """Receive until the end."""
        while not self._over.is_set():
            for sock in select.select([self.truth, self.ground], [], [], 0.2)[0]:
                for one in decode(sock.recv(65535))[0]:
                    self._take(one)

    def _take(self, one: Received) -> None:
        """Note a message; other messages are not even decoded, to leave the processor to the clients."""
        match one.id:
            case mavlink.MAVLINK_MSG_ID_LOAD_STATE:
                message = one.message
                if message.source == mavlink.PLUMBLINE_SOURCE_TRUTH:
                    self.load.append((message.time_usec * 1e-6, (message.y, message.x, -message.z)))
            case mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT:
                message = one.message
                if message.phase in CARRIED:
                    self.asked.append((message.time_usec * 1e-6, (message.y, message.x, -message.z)))
                if self.phases[-1:] != [message.phase]:
                    self.phases.append(message.phase)
            case mavlink.MAVLINK_MSG_ID_ATTITUDE:
                message = one.message
                self.attitudes.append((time.monotonic(), 1e-3 * message.time_boot_ms))
                self.tilt = max(self.tilt, abs(message.roll), abs(message.pitch))
                self.yaw = message.yaw
            case mavlink.MAVLINK_MSG_ID_STATUSTEXT:
                self.texts.append(one.message.text)

    def nearest(self, place: Place) -> float:
        """Least true distance of the load from a place, m; between two samples a straight path is assumed."""
        return min(_beside(place, before, after) for (_, before), (_, after) in pairwise(self.load))

    def worst_error(self) -> float:
        """Greatest distance of the carried load's true position from its setpoint, m."""
        times = np.array([at for at, _ in self.load])
        tracks = np.array([where for _, where in self.load]).T
        asked_times = np.array([at for at, _ in self.asked])
        asked = np.array([where for _, where in self.asked])
        true = np.stack([np.interp(asked_times, times, track) for track in tracks], axis=1)
        return float(np.linalg.norm(true - asked, axis=1).max())

    def longest_silence(self, begin: float, end: float) -> tuple[float, float]:
        """Longest gap in ATTITUDE between two wall clock times, in s of that and of the vehicle's clock."""
        heard = [(wall, own) for wall, own in self.attitudes if begin < wall < end]
        walls = [begin, *(wall for wall, _ in heard), end]
        of_wall = max(after - before for before, after in pairwise(walls))
        return of_wall, max(after - before for (_, before), (_, after) in pairwise(heard))

    def close(self) -> None:
        self._over.set()


def _beside(place: Place, before: Place, after: Place) -> float:
    """Distance of a place from a straight path between two others."""
    way = [b - a for a, b in zip(before, after, strict=True)]
    to = [b - a for a, b in zip(before, place, strict=True)]
    length = sum(w * w for w in way)
    share = min(max(sum(w * t for w, t in zip(way, to, strict=True)) / length, 0.0), 1.0) if length else 0.0
    return dist(to, [share * w for w in way])


def _bound() -> tuple[socket.socket, str]:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 * 1024 * 1024)
    sock.bind((LOOPBACK, 0))
    return sock, f"{LOOPBACK}:{sock.getsockname()[1]}"


class Mavproxy:
    """MAVProxy as started by hand, without a screen: lines in, text out."""

    def __init__(self, master: str, directory: Path) -> None:
        directory.mkdir()
        self.directory = directory
        self.process = subprocess.Popen(
            [
                str(Path(sys.executable).with_name("mavproxy.py")),
                f"--master={master}",
                f"--state-basedir={directory}",
            ],
            cwd=directory,
            env=ENVIRONMENT,
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

    def expect(self, text: str, timeout_s: float = LONG_S) -> None:
        """Wait until it has printed `text`; discard what it printed until then."""
        until = time.monotonic() + timeout_s
        while text not in self.text:
            assert self._read(until - time.monotonic()), (
                f"MAVProxy did not say {text!r} but {self.all[-2000:]!r}"
            )
        self.text = self.text.partition(text)[2]

    def insist(self, line: str, text: str) -> None:
        """Type `line` every few seconds until it has printed `text`: a busy MAVProxy misses answers; and it
        takes what it receives before the first HEARTBEAT for the parameters of another vehicle."""
        until = time.monotonic() + LONG_S
        while True:
            self.type(line)
            again = time.monotonic() + 3.0
            while text not in self.text and time.monotonic() < again:
                self._read(again - time.monotonic())
            if text in self.text:
                break
            assert time.monotonic() < until, f"MAVProxy did not say {text!r} but {self.all[-2000:]!r}"
        self.text = self.text.partition(text)[2]

    def _read(self, timeout_s: float) -> bool:
        assert self.process.stdout is not None
        ready = select.select([self.process.stdout], [], [], max(timeout_s, 0.0))[0]
        data = os.read(self.process.stdout.fileno(), 65536) if ready else b""
        self.text += data.decode(errors="replace")
        self.all += data.decode(errors="replace")
        return bool(data)

    def end(self) -> str:
        """End it as when its window is closed; return all that it printed."""
        self.process.kill()
        while self._read(END_S):
            continue
        self.process.wait(END_S)
        return self.all


@dataclass
class Told:
    """The output of a program in `programs`: JSON in its last line, and everything before."""

    value: dict[str, Any]
    output: str


class Stage:
    """One vehicle with its simulator, and the programs that connect to it."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.storage = directory / "storage"
        self.gcs = self.second_gcs = self.api = self.tcp = ""  # ports
        self.witness: Witness
        self._running: list[subprocess.Popen[Any]] = []
        self._programs: list[tuple[subprocess.Popen[bytes], Path]] = []  # with their output
        self._mavproxies: list[Mavproxy] = []

    def begin(self, *options: str, speed: float = 1.0) -> None:
        """Start the vehicle with these options, and wait until it flies with its simulator."""
        # a free port may be taken by others before it is used
        self.gcs, self.second_gcs, self.api, self.tcp = (str(free_port()) for _ in range(4))
        (truth, truth_at), (ground, ground_at) = _bound(), _bound()
        self.witness = Witness(truth, ground)
        threading.Thread(target=self.witness.watch, daemon=True).start()
        sim = f"{LOOPBACK}:{free_port()}"
        at = f"{LOOPBACK}:".__add__
        world = ("--listen", sim, "--truth", truth_at, "--truth-every", "5", "--sensors", "lab")
        # in lockstep, a busy machine makes the flight slower, and nothing else
        self._start("sitl", *world, "--lockstep", "--speed", str(speed))
        where = ("--gcs", at(self.gcs), "--gcs", at(self.second_gcs), "--gcs", ground_at)
        more = ("--api", at(self.api), "--tcp", at(self.tcp), "--storage", str(self.storage))
        process, log = self._start("autopilot", "--sim", sim, *where, *more, *options)
        while b"flying with the simulator" not in log.read_bytes():
            try:
                code = process.wait(0.1)
            except subprocess.TimeoutExpired:
                continue
            raise AssertionError(f"autopilot ended with {code}: {log.read_text()}")

    def _start(self, name: str, *arguments: str) -> tuple[subprocess.Popen[bytes], Path]:
        log = self.directory / f"{name}.log"
        with log.open("wb") as output:
            process = subprocess.Popen(
                [sys.executable, "-m", name, *arguments],
                stdout=output,
                stderr=subprocess.STDOUT,
                cwd=self.directory,
                env=ENVIRONMENT,
            )
        self._running.append(process)
        return process, log

    def program(self, name: str, *arguments: str) -> Callable[[], Told]:
        """Begin one of our programs that use a client library; the returned function waits for its end."""
        log = self.directory / f"{name}-{len(self._running)}.log"
        with log.open("wb") as output:
            process = subprocess.Popen(
                [sys.executable, "-u", str(PROGRAMS / name), *arguments],
                stdout=output,
                stderr=subprocess.STDOUT,
                cwd=self.directory,
                env=ENVIRONMENT,
            )
        self._running.append(process)
        self._programs.append((process, log))

        def told() -> Told:
            process.wait(LONG_S)
            self._raise_if_failed(process, log)
            lines = log.read_text(errors="replace").splitlines()
            return Told(json.loads(lines[-1]), "\n".join(lines[:-1]))

        return told

    def _raise_if_failed(self, process: subprocess.Popen[bytes], log: Path) -> None:
        code = process.poll()
        assert not code, f"a client ended with {code}\n{self._said(log)}"

    def _said(self, log: Path) -> str:
        lines = log.read_text(errors="replace").splitlines()
        return "\n".join([f"{log.name}:", *lines[-40:], "the vehicle:", *self.witness.texts])

    def run_gcs(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a gcs command at the second ground station's port, to its end."""
        return subprocess.run(
            [sys.executable, "-m", "gcs", *arguments, "--connect", self.second_gcs],
            capture_output=True,
            text=True,
            timeout=LONG_S,
            cwd=self.directory,
            env=ENVIRONMENT,
            check=False,
        )

    def mavproxy(self, master: str) -> Mavproxy:
        """Start MAVProxy: mavproxy("udpin:127.0.0.1:14550")."""
        self._mavproxies.append(Mavproxy(master, self.directory / f"mavproxy-{len(self._mavproxies)}"))
        return self._mavproxies[-1]

    def wait_for(self, text: str, timeout_s: float = LONG_S) -> None:
        """Wait until the vehicle has sent this text to all."""
        self.wait_until(lambda: text in self.witness.texts, timeout_s)

    def wait_until(self, condition: Callable[[], bool], timeout_s: float = LONG_S) -> None:
        """Wait until the condition holds; a client that failed makes it happen never."""
        turn = threading.Event()
        for _ in range(round(timeout_s / 0.05)):
            if condition():
                return
            for process, log in self._programs:
                self._raise_if_failed(process, log)
            turn.wait(0.05)
        output = "\n".join(self._said(log) for _, log in self._programs)
        raise AssertionError(f"in vain waited\n{output or self.witness.texts}")

    def end(self) -> None:
        for program in self._mavproxies:
            if program.process.poll() is None:
                program.process.kill()
                program.process.communicate()
        for process in reversed(self._running):
            if process.poll() is None:
                process.terminate()
                try:
                    process.wait(END_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait(END_S)
        if hasattr(self, "witness"):
            self.witness.close()


class Stages:
    """All flights that the tests use, some at a time."""

    def __init__(self) -> None:
        self._directory = Path(tempfile.mkdtemp(prefix="clients-"))
        self._pool = ThreadPoolExecutor(AT_ONCE)
        self._begun: list[Stage] = []
        self._flown: dict[str, Future[Any]] = {}

    def begin(self, name: str, play: Callable[[Stage], Any]) -> None:
        directory = self._directory / name
        directory.mkdir()
        stage = Stage(directory)
        self._begun.append(stage)

        def flown() -> Any:
            try:
                return play(stage)
            finally:
                stage.end()

        self._flown[name] = self._pool.submit(flown)

    def result(self, name: str) -> Any:
        return self._flown[name].result()

    def end(self) -> None:
        for stage in self._begun:
            stage.end()
        self._pool.shutdown()
        shutil.rmtree(self._directory, ignore_errors=True)


@pytest.fixture(scope="session")
def stages(request: pytest.FixtureRequest) -> Iterator[Stages]:
    all_of_them = Stages()
    wanted = {name for item in request.session.items for name in getattr(item, "fixturenames", ())}
    plays = {name: play for name, play in PLAYS.items() if name in wanted}
    for name, play in plays.items():
        all_of_them.begin(name, play)
    yield all_of_them
    all_of_them.end()


PLAYS: dict[str, Callable[[Stage], Any]] = {}


def staged(play: Callable[[Stage], Any]) -> Any:
    """A flight as a fixture: a function that returns the result of the flight, or raises its exception."""
    name = play.__name__
    PLAYS[name] = play

    @pytest.fixture(scope="session", name=name)
    def flown(stages: Stages) -> Callable[[], Any]:
        return lambda: stages.result(name)

    return flown
