"""`sitl --for betaflight` as a process: it runs on the wall clock, firmwares come, go and come back, wrong
options are refused."""

from __future__ import annotations

import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator

import pytest

from gcs.shell.link import free_port

PATIENCE_S = 30.0  # the first start compiles
STATE = struct.Struct("<18d")

pytestmark = pytest.mark.processes


def free_ports() -> tuple[int, int]:
    """A free port for the motors, and the next one, on which the firmware receives."""
    port = free_port(2)
    return port, port + 1


def start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "sitl", "--for", "betaflight", "--vehicle", "iris", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


class Firmware:
    """Sockets like Betaflight's: it receives on its own port, and sends from any."""

    def __init__(self, ports: tuple[int, int]) -> None:
        self._motors = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._motors.connect(("127.0.0.1", ports[0]))
        self._states = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._states.bind(("127.0.0.1", ports[1]))
        self._states.settimeout(PATIENCE_S)

    def heard(self) -> tuple[float, ...]:
        """A state that was sent after this call."""
        self._states.setblocking(False)
        try:
            while True:
                self._states.recv(65535)
        except BlockingIOError:
            self._states.settimeout(PATIENCE_S)
        return STATE.unpack(self._states.recv(65535))

    def says(self, throttle: float) -> None:
        self._motors.send(struct.pack("<4f", *(throttle,) * 4))

    def climbs(self, metres: float, since: float) -> None:
        """Send a high throttle until the vehicle is this many metres above `since`."""
        while self.heard()[16] < since + metres:
            self.says(0.9)

    def send(self, datagram: bytes) -> None:
        self._motors.send(datagram)

    def end(self) -> None:
        self._motors.close()
        self._states.close()


@pytest.fixture
def running() -> Iterator[tuple[subprocess.Popen[str], tuple[int, int]]]:
    ports = free_ports()
    process = start("--listen", f"127.0.0.1:{ports[0]}", "--truth", "127.0.0.1:9")
    assert process.stdout
    while "waiting for Betaflight" not in process.stdout.readline():
        assert process.poll() is None
    yield process, ports
    process.kill()
    process.communicate()


def until(process: subprocess.Popen[str], told: str) -> str:
    """Wait for a line that contains this text, and return it."""
    assert process.stdout
    while told not in (line := process.stdout.readline()):
        assert line, f"it ended, and did not say {told!r}"
    return line


def test_firmwares_are_met_left_and_met_again(running: tuple[subprocess.Popen[str], tuple[int, int]]) -> None:
    process, ports = running
    one = Firmware(ports)
    on_ground = one.heard()[16]  # it gets states before it has sent anything
    one.send(b"")
    one.send(b"rubbish of sixteen")
    one.send(bytes(17))
    one.send(bytes(65000))
    one.climbs(0.5, on_ground)
    until(process, "serving the autopilot at")
    other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    other.sendto(bytes(16), ("127.0.0.1", ports[0]))
    one.climbs(0.8, on_ground)
    # the firmware falls silent, and the world continues: the vehicle falls
    until(process, "no answer from the autopilot at")
    assert one.heard()[16] < on_ground + 0.1
    one.says(0.0)
    until(process, "answers again")
    one.end()
    # the firmware is restarted: it receives on the same port, and sends from another
    two = Firmware(ports)
    before = until_taken(two)
    assert "restarted at t = " in until(process, "and the world restarts")
    assert before == pytest.approx(on_ground, abs=0.01)
    two.climbs(0.3, on_ground)
    process.send_signal(signal.SIGTERM)
    said, wrong = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0 and not wrong
    assert "stopped at t = " in said and "commands missed" in said
    two.end()
    other.close()


def until_taken(firmware: Firmware) -> float:
    """Send motors at rest for longer than it takes until another firmware is served; return the height."""
    for _ in range(1000):
        firmware.says(0.0)
        height = firmware.heard()[16]
    return height


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--lockstep",), "betaflight runs on the wall clock"),
        (("--speed", "2"), "betaflight runs on the wall clock"),
        (("--vehicle", "hexarotor"), "four rotors"),
    ],
)
def test_what_cannot_fly_is_said_in_a_line(arguments: tuple[str, ...], told: str) -> None:
    port, truth = free_ports()
    process = start("--listen", f"127.0.0.1:{port}", "--truth", f"127.0.0.1:{truth}", *arguments)
    said, wrong = process.communicate(timeout=PATIENCE_S)
    assert process.returncode != 0 and told in wrong and "Traceback" not in said + wrong
