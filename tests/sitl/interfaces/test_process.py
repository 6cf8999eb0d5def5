"""`sitl --for ardupilot` as a process: firmwares are served, turned away and restarted; wrong options are
refused."""

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

pytestmark = pytest.mark.processes


def start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "sitl", "--for", "ardupilot", "--vehicle", "iris", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


class Firmware:
    """A socket that sends requests as ArduPilot does."""

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.socket.settimeout(PATIENCE_S)

    def send(self, number: int) -> None:
        self.socket.send(struct.pack("<HHI16H", 18458, 800, number, *(1000,) * 16))

    def frame(self, number: int) -> bytes:
        self.send(number)
        return self.socket.recv(65535)


@pytest.fixture
def running() -> Iterator[tuple[subprocess.Popen[str], int]]:
    port = free_port()
    process = start("--listen", f"127.0.0.1:{port}", "--truth", f"127.0.0.1:{free_port()}", "--lockstep")
    assert process.stdout
    while "waiting for ArduPilot" not in process.stdout.readline():
        assert process.poll() is None
    yield process, port
    process.kill()
    process.communicate()


def test_a_firmware_is_served_others_are_not_and_what_begins_anew_is_told(
    running: tuple[subprocess.Popen[str], int],
) -> None:
    process, port = running
    one, other = Firmware(port), Firmware(port)
    begun = [one.frame(n) for n in range(3)]
    one.socket.send(b"rubbish")
    other.send(0)
    assert one.frame(3) not in begun
    # the same firmware, restarted: the world is as it was at first
    assert [one.frame(n) for n in range(3)] == begun
    other.socket.settimeout(0.0)
    with pytest.raises(BlockingIOError):
        other.socket.recv(65535)
    process.send_signal(signal.SIGTERM)
    said, wrong = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0 and not wrong
    assert "serving the autopilot at" in said and "is not served" in said
    assert "the firmware restarted at t = 0.005 s, and the world restarts" in said
    assert "stopped at t = 0.004 s" in said


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--real-time",), "--real-time is for plumbline"),
        (("--vehicle", "hexarotor"), "four rotors"),
        (("--set", "SIM_RATE_HZ=300"), "SIM_RATE_HZ = 300 Hz"),
    ],
)
def test_what_cannot_fly_is_said_in_a_line(arguments: tuple[str, ...], told: str) -> None:
    listen = f"127.0.0.1:{free_port()}"
    process = start("--listen", listen, "--truth", listen, *arguments)
    said, wrong = process.communicate(timeout=PATIENCE_S)
    assert process.returncode != 0 and told in wrong and "Traceback" not in said + wrong
