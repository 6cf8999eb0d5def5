"""Programs that die, stand still or come back while the vehicle flies: docs/faults.md says what follows."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gcs.shell.link import LOOPBACK, free_port

if TYPE_CHECKING:
    from conftest import Program

pytestmark = pytest.mark.processes
Start = Callable[..., "Program"]
Gcs = Callable[..., "subprocess.CompletedProcess[str]"]
LOOKS = 120  # at a vehicle, each of which takes a while


class Flight:
    """A vehicle that is flown as a user flies it; its programs can be stopped and started again."""

    def __init__(self, start: Start, gcs: Gcs, storage: Path, *options: str) -> None:
        self._start, self._gcs, self._storage, self._options = start, gcs, storage, options
        self._sim, self._truth, self.ground = (f"{LOOPBACK}:{free_port()}" for _ in range(3))
        self.sitl = self.begin_sitl()
        self.autopilot = self.begin_autopilot()

    def begin_sitl(self) -> Program:
        return self._start("sitl", "--listen", self._sim, "--truth", self._truth, *self._options)

    def begin_autopilot(self) -> Program:
        options = ("--gcs", self.ground, "--api", "none", "--storage", str(self._storage))
        program = self._start("autopilot", "--sim", self._sim, *options)
        program.says(b"flying with the simulator")
        return program

    def do(self, *command: str) -> str:
        done = self._gcs(*command, "--connect", self.ground)
        assert done.returncode == 0, f"{command}: {done.stderr}"
        return done.stdout

    def status(self) -> Any:
        return json.loads(self.do("status", "--json"))

    def until(self, wanted: Callable[[Any], bool]) -> Any:
        seen: list[Any] = []
        for _ in range(LOOKS):
            seen.append(self.status())
            if wanted(seen[-1]):
                return seen[-1]
        raise AssertionError(seen[-3:])

    def take_off(self) -> None:
        """In real time a machine that is busy at this moment refuses to arm."""
        self.do("takeoff", "2")
        for _ in range(LOOKS):
            if self._gcs("arm", "--connect", self.ground).returncode == 0:
                break
        self.until(lambda status: status["load_up_m"] > 0.5)

    def into_the_mission(self) -> None:
        for command in (("upload", "square"), ("start",), ("arm",)):
            self.do(*command)
        self.until(lambda status: status["phase"] == "mission" and status["load_up_m"] > 1.0)


@pytest.fixture
def fly(start: Start, gcs: Gcs, tmp_path: Path) -> Callable[..., Flight]:
    return lambda *options: Flight(start, gcs, tmp_path / "storage", *options)


@pytest.mark.parametrize("options", [(), ("--lockstep", "--speed", "3")])
def test_an_autopilot_killed_in_the_air_holds_the_load_when_it_is_back(
    fly: Callable[..., Flight], options: tuple[str, ...]
) -> None:
    flight = fly(*options)
    flight.into_the_mission()
    flight.autopilot.kill()
    flight.autopilot = flight.begin_autopilot()
    status = flight.until(lambda status: status["phase"] == "hold")
    assert status["armed"]
    assert status["load_up_m"] > 1.0
    assert status["mission_items"] > 0, "as it was stored"
    flight.do("land")
    flight.until(lambda status: not status["armed"])


def test_a_simulator_killed_in_flight_begins_anew_with_the_vehicle_on_the_ground(
    fly: Callable[..., Flight],
) -> None:
    flight = fly()
    flight.into_the_mission()
    flight.sitl.kill()
    flight.autopilot.says(b"no word from the simulator")
    assert flight.status()["armed"], "time stands still"
    flight.sitl = flight.begin_sitl()
    flight.autopilot.says(b"the simulator has started again: so do I")
    status = flight.until(lambda status: not status["armed"])
    assert status["phase"] == "disarmed"
    assert status["time_s"] < 60.0
    assert status["mission_items"] > 0


@pytest.mark.parametrize("who", ["autopilot", "sitl"])
def test_a_program_that_stood_still_goes_on_where_it_was(fly: Callable[..., Flight], who: str) -> None:
    """As by Ctrl-Z, or a machine that sleeps: the world waits, and nobody takes it for a restart."""
    flight = fly()
    flight.into_the_mission()
    stopped, other = flight.autopilot, flight.sitl
    if who == "sitl":
        stopped, other = other, stopped
    stopped.process.send_signal(signal.SIGSTOP)
    other.says(b"no answer from the autopilot" if who == "autopilot" else b"no word from the simulator")
    stopped.process.send_signal(signal.SIGCONT)
    status = flight.until(lambda status: status["phase"] != "mission")
    assert status["armed"], "it was flown to its landing"
    flight.until(lambda status: not status["armed"])
    assert b"has started again" not in flight.autopilot.log.read_bytes()


def test_an_autopilot_that_stood_still_in_real_time_gives_the_flight_up(fly: Callable[..., Flight]) -> None:
    flight = fly("--real-time")
    flight.take_off()
    flight.autopilot.process.send_signal(signal.SIGSTOP)
    flight.sitl.says(b"no answer from the autopilot")
    flight.autopilot.process.send_signal(signal.SIGCONT)
    flight.sitl.says(b"answers again")
    status = flight.until(lambda status: status["phase"] == "disarmed")  # three seconds after it is given up
    assert not status["armed"]
    assert b"has started again" not in flight.autopilot.log.read_bytes()
