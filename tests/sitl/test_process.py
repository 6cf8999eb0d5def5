"""The `sitl` program as a process: it serves, sends again, changes the autopilot, stops. Sockets, but no
sleeps."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.simulator import padded_forces
from autopilot.wire.dialect import plumbline as mavlink
from gcs.shell.link import free_port
from tests.doubles.messages import hil_actuator_controls_message

PATIENCE_S = 30.0  # the first start compiles
RESENT = 5  # a tick without an answer is sent again so often in the first 1.55 s

pytestmark = pytest.mark.processes


def start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "sitl", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_until_told(process: subprocess.Popen[str], text: str) -> None:
    """Read what it prints up to a line with this text; the first start also tells what it compiles."""
    assert process.stdout is not None
    while text not in (line := process.stdout.readline()):
        assert line, f"it ended without: {text}"


class Pilot:
    """A socket that behaves like an autopilot."""

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.socket.settimeout(PATIENCE_S)
        self.writer = FrameWriter(1, 1)

    def greet(self) -> None:
        self.socket.send(self.writer.frame(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)))

    def sensors(self, after_us: int = -1) -> tuple[bytes, int]:
        """The next sensor datagram with a time after `after_us`: on a busy machine one may have been sent
        again."""
        while True:
            datagram = self.socket.recv(65535)
            time_us = decode(datagram)[0][-1].message.time_usec
            if time_us > after_us:
                return datagram, time_us

    def answer(self, time_us: int) -> None:
        message = hil_actuator_controls_message(time_us, padded_forces((1.0,) * 4), True, True)
        self.socket.send(self.writer.frame(message))


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def lockstep_sitl(port: int) -> Iterator[subprocess.Popen[str]]:
    process = start("--lockstep", "--listen", f"127.0.0.1:{port}", "--truth", f"127.0.0.1:{free_port()}")
    wait_until_told(process, "waiting for an autopilot")
    yield process
    process.kill()
    process.communicate()


def test_lockstep_over_udp(port: int, lockstep_sitl: subprocess.Popen[str]) -> None:
    first = Pilot(port)
    first.greet()
    time_us = -1
    for tick in range(20):
        _, time_us = first.sensors(after_us=time_us)
        assert time_us == tick * 4000
        first.answer(time_us)
        if tick == 10:
            Pilot(port).greet()  # another autopilot, started by accident: not while the first one answers
    unanswered, time_us = first.sensors(after_us=time_us)
    assert first.sensors() == (unanswered, time_us)  # without an answer it is sent again

    first.socket.send(b"\xfd\x00rubbish")
    stranger = Pilot(port)
    stranger.answer(time_us)  # without a heartbeat it is not taken for the autopilot
    assert first.sensors() == (unanswered, time_us)

    for _ in range(2):  # sent again after 50, 100, 200 and 400 ms: the first one counts as gone
        assert first.sensors() == (unanswered, time_us)
    second = Pilot(port)  # the autopilot was restarted: served from the present tick
    second.greet()
    told, again_us = second.sensors()  # and it is told which run of the simulator this is
    assert told.endswith(unanswered) and len(told) > len(unanswered) and again_us == time_us
    second.answer(time_us)
    assert second.sensors(after_us=time_us)[1] == time_us + 4000

    lockstep_sitl.send_signal(signal.SIGTERM)
    output, errors = lockstep_sitl.communicate(timeout=PATIENCE_S)
    assert lockstep_sitl.returncode == 0
    assert errors == ""
    assert f"stopped at t = {(time_us + 4000) / 1e6:.3f} s by SIGTERM; " in output
    assert output.count("is not served") == 1
    assert output.count("serving the autopilot at") == 2


def test_real_time_over_udp(port: int) -> None:
    process = start(
        *("--real-time", "--speed", "4", "--sensors", "ideal", "--listen", f"127.0.0.1:{port}"),
        *("--truth", f"127.0.0.1:{free_port()}"),
    )
    wait_until_told(process, "at 4 x real time, without waiting for answers")
    pilot = Pilot(port)
    pilot.greet()
    times = []
    while not times or times[-1] < 400_000:
        times.append(pilot.sensors()[1])
        pilot.answer(times[-1])
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert errors == ""
    assert times == list(range(0, times[-1] + 1, 4000))
    assert "ticks/s, late p50" in output


def test_the_clock_goes_no_faster_than_it_may_and_waits(port: int) -> None:
    process = start("--speed", "10", "--listen", f"127.0.0.1:{port}")
    wait_until_told(process, "at 10 x real time, slower on a busy machine")
    pilot = Pilot(port)
    pilot.greet()
    time_us = pilot.sensors()[1]
    began = time.monotonic()
    while time_us < 2_000_000:
        pilot.answer(time_us)
        time_us = pilot.sensors(after_us=time_us)[1]
    # 0.2 s from when the first tick was sent, which may have been a while before it was received
    assert time.monotonic() - began > 0.1
    assert pilot.sensors()[1] == time_us, "asked again, until it is answered"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, errors) == (0, "")


def test_a_long_wait_for_the_autopilot_is_told(port: int) -> None:
    process = start("--listen", f"127.0.0.1:{port}", "--truth", f"127.0.0.1:{free_port()}")
    wait_until_told(process, "waiting for an autopilot")
    pilot = Pilot(port)
    pilot.greet()
    time_us = pilot.sensors()[1]
    while time_us < 60_000:
        pilot.answer(time_us)
        time_us = pilot.sensors(after_us=time_us)[1]
    for _ in range(RESENT):
        assert pilot.sensors()[1] == time_us, "asked again, until it is answered"
    pilot.answer(time_us)
    pilot.sensors(after_us=time_us)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, errors) == (0, "")
    waited = re.search(r"^sitl: waited (\d+\.\d) s for the autopilot$", output, re.MULTILINE)
    assert waited is not None, output
    assert float(waited[1]) >= 1.5


@pytest.mark.parametrize(
    ("arguments", "code", "complaint"),
    [
        (
            ["--listen", "127.0.0.1:{busy}"],
            1,
            "sitl: cannot listen on 127.0.0.1:{busy}: address already in use; ",
        ),
        (
            ["--sensors", "nothing"],
            2,
            "sitl: unknown sensors 'nothing'; shipped: field, gps, ideal, lab, lab-blind, lab-real, "
            "rtk, rtk-blind; or",
        ),
        (["--set", "SIM_RATE_HZ=300"], 2, "sitl: SIM_RATE_HZ = 300 Hz; a tick must be"),
    ],
)
def test_what_cannot_start_says_why(arguments: list[str], code: int, complaint: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as busy:
        busy.bind(("127.0.0.1", 0))
        taken = str(busy.getsockname()[1])
        free = ["--listen", f"127.0.0.1:{free_port()}"] if "--listen" not in arguments else []
        process = start(*(a.format(busy=taken) for a in arguments), *free)
        _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == code
    assert complaint.format(busy=taken) in errors
