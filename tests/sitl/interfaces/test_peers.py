"""Firmwares and simulators that are killed, stopped and restarted: each event is reported, and nothing hangs.

The firmwares are sockets that send what the real ones send.
"""

from __future__ import annotations

import os
import re
import select
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import pytest

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from gcs.shell.link import free_port
from sitl.interfaces.px4 import Stream

PATIENCE_S = 40.0  # the first start compiles

pytestmark = pytest.mark.processes


class Simulator:
    """`sitl` for a firmware, and its output."""

    def __init__(self, kind: str, port: int) -> None:
        where = ["--listen", f"127.0.0.1:{port}", "--truth", f"127.0.0.1:{free_port()}"]
        world = ["--for", kind, "--vehicle", "iris", "--sensors", "rtk", "--lockstep"]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sitl", *world, *where], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        self.said = ""

    def says(self, pattern: str) -> None:
        """Wait until its output matches, after all that was waited for before."""
        assert self.process.stdout
        until_s = time.monotonic() + PATIENCE_S
        while not (found := re.search(pattern, self.said)):
            left_s = until_s - time.monotonic()
            ready = select.select([self.process.stdout], [], [], max(left_s, 0.0))[0]
            piece = os.read(self.process.stdout.fileno(), 65536) if ready else b""
            assert piece, f"sitl did not say {pattern!r} but {self.said!r}"
            self.said += piece.decode()
        self.said = self.said[found.end() :]

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()


Start = Callable[[str, int], Simulator]


@pytest.fixture
def start() -> Iterator[Start]:
    begun: list[Simulator] = []

    def begin(kind: str, port: int) -> Simulator:
        begun.append(Simulator(kind, port))
        begun[-1].says("waiting for")
        return begun[-1]

    yield begin
    for simulator in begun:
        simulator.end()


class ArduPilot:
    """Sends requests as ArduPilot does, from its own port."""

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.socket.settimeout(PATIENCE_S)

    def ask(self, number: int) -> None:
        self.socket.send(struct.pack("<HHI16H", 18458, 800, number, *(1000,) * 16))

    def frame(self, number: int) -> bytes:
        """The answer to a frame; the request is repeated until there is one, as the firmware does."""
        while True:
            try:
                self.ask(number)
                while not select.select([self.socket], [], [], 0.3)[0]:
                    self.ask(number)
                return self.socket.recv(65535)
            except ConnectionRefusedError:  # there is no simulator now
                select.select([], [], [], 0.05)


def connected(port: int, holds: int | None = None) -> socket.socket:
    """Connect to the simulator, trying until it listens, as PX4 does; `holds`: bytes of its receive
    buffer."""
    until_s = time.monotonic() + PATIENCE_S
    while True:
        one = socket.socket()
        one.settimeout(PATIENCE_S)
        if holds is not None:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, holds)
        try:
            one.connect(("127.0.0.1", port))
        except ConnectionRefusedError:
            one.close()
            assert time.monotonic() < until_s, "nobody listens"
            select.select([], [], [], 0.05)
        else:
            return one


class Px4:
    """Connects and answers as PX4 does."""

    def __init__(self, port: int) -> None:
        self.socket = connected(port)
        self.stream, self.writer = Stream(), FrameWriter(1, 1)

    def tick(self) -> int:
        """Receive the sensors of a tick and answer them; return its time, us."""
        while piece := self.socket.recv(65536):
            for frame in self.stream.feed(piece):
                message = decode(frame)[0][0].message
                if message.get_msgId() == mavlink.MAVLINK_MSG_ID_HIL_SENSOR:
                    at_us = int(message.time_usec)
                    answer = mavlink.MAVLink_hil_actuator_controls_message(at_us, [0.0] * 16, 1, 1)
                    self.socket.sendall(self.writer.frame(answer))
                    return at_us
        raise EOFError

    def gone(self) -> bool:
        """Wait until the simulator closes the connection."""
        try:
            while self.socket.recv(65536):
                pass
        except ConnectionError:
            pass
        return True

    def kill(self) -> None:
        """Close the connection as the system does for a process that is killed."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


def test_arducopter_killed_and_started_anew_has_the_world_anew(start: Start) -> None:
    sitl = start("ardupilot", port := free_port())
    one = ArduPilot(port)
    begun = [one.frame(n) for n in range(5)]
    one.socket.close()
    sitl.says("no answer from the autopilot at .* for 3 s .*; waiting for it")
    other = ArduPilot(port)
    assert [other.frame(n) for n in range(5)] == begun
    sitl.says("serving the autopilot at .*")
    sitl.says("the firmware restarted at t = 0.006 s, and the world restarts")
    assert "answers again" not in sitl.said


def test_arducopter_that_stood_still_goes_on_where_it_was(start: Start) -> None:
    sitl = start("ardupilot", port := free_port())
    one = ArduPilot(port)
    before = [one.frame(n) for n in range(5)]
    sitl.says("no answer from the autopilot")
    assert one.frame(5) not in before
    sitl.says("answers again")


def test_sitl_that_stood_still_answers_each_frame_once(start: Start) -> None:
    sitl = start("ardupilot", port := free_port())
    one = ArduPilot(port)
    before = one.frame(0)
    sitl.process.send_signal(signal.SIGSTOP)
    for _ in range(4):  # it asks again and again
        one.ask(1)
    sitl.process.send_signal(signal.SIGCONT)
    answer = one.socket.recv(65535)
    # one answer more would leave the firmware a frame behind for ever
    assert answer != before and one.frame(2) not in (before, answer)


def test_sitl_started_anew_takes_up_a_firmware_that_runs(start: Start) -> None:
    sitl = start("ardupilot", port := free_port())
    one = ArduPilot(port)
    first, *_ = [one.frame(n) for n in range(3)]
    sitl.end()
    sitl = start("ardupilot", port)
    assert one.frame(3) == first
    sitl.says("the firmware has already flown for 3 frames; the world restarts")


def test_px4_killed_and_started_anew_has_the_world_anew(start: Start) -> None:
    sitl = start("px4", port := free_port())
    one = Px4(port)
    times = [one.tick() for _ in range(20)]
    one.kill()
    sitl.says(r"PX4 is gone at t = .*: connection reset by peer; waiting for another")
    other = Px4(port)
    assert other.tick() <= times[1]
    sitl.says("serving PX4 at .*, and the world restarts")
    other.socket.close()
    sitl.says("PX4 is gone at t = ")


def test_another_px4_is_turned_away_while_one_answers(start: Start) -> None:
    sitl = start("px4", port := free_port())
    one, other = Px4(port), Px4(port)
    while not select.select([other.socket], [], [], 0.0)[0]:
        one.tick()
    assert other.gone()
    sitl.says("PX4 at .* is not served: that at .* answers")
    assert one.tick() < one.tick()


def test_a_px4_that_stands_still_is_told_of_and_gives_place_to_another(start: Start) -> None:
    sitl = start("px4", port := free_port())
    one = Px4(port)
    for _ in range(20):
        one.tick()
    sitl.says("no answer from PX4 for 3 s .*; waiting for it")
    one.tick()
    sitl.says("PX4 answers again")
    sitl.says("no answer from PX4 for 3 s .*; waiting for it")
    other = Px4(port)
    assert other.tick() < other.tick()
    sitl.says("it is silent, and another asks")


def test_a_stranger_that_only_connects_gives_place_to_px4(start: Start) -> None:
    sitl = start("px4", port := free_port())
    with connected(port):
        sitl.says("serving PX4")
        firmware = Px4(port)
        assert firmware.tick() < firmware.tick()
        sitl.says("it is silent, and another asks")


def test_a_stranger_that_never_reads_is_given_up(start: Start) -> None:
    sitl = start("px4", port := free_port())
    with connected(port, holds=4096):
        sitl.says("PX4 is gone at t = .*: it does not read what is sent to it")
