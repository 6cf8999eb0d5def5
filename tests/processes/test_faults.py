"""Programs that die, stand still or come back while the vehicle flies: docs/faults.md states what follows."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gcs.shell.link import LOOPBACK, free_port, parse_address
from gcs.shell.session import Session
from gcs.workflows.status import status_record
from plumbline import Land, Mission, Takeoff, Waypoint
from tests.doubles.ports import ground_port

if TYPE_CHECKING:
    from click.testing import Result
    from conftest import Program

pytestmark = pytest.mark.processes
Start = Callable[..., "Program"]
Command = Callable[..., "Result"]
TRIES = 60  # attempts to arm on a busy machine
LONG_S = 240.0
TOLD = (
    "armed",
    "phase",
    "load_up_m",
    "mission_items",
    "time_s",
)  # known in a complete status
MISSION = Mission("over there", [Takeoff(2.0), Waypoint(6.0, 0.0, 2.0), Land()])
# paced as without options: the world waits for all programs, but its seconds are shorter
QUICK = ("--speed", "4")


class Flight:
    """A vehicle that is flown as a user flies it; its programs can be stopped and started again."""

    def __init__(self, start: Start, command: Command, storage: Path, *options: str) -> None:
        self._start, self._command, self._storage, self._options = start, command, storage, options
        ports = free_port(), free_port(), ground_port()
        self._sim, self._truth, self.ground = (f"{LOOPBACK}:{port}" for port in ports)
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
        done = self._command(*command, "--connect", self.ground)
        assert done.exit_code == 0, f"{command}: {done.stderr} {done.exception!r}"
        return done.stdout

    def status(self) -> Any:
        return json.loads(self.do("status", "--json"))

    def until(self, wanted: Callable[[Any], bool]) -> Any:
        """Wait for the first status that is as wanted, and return it."""
        with Session(parse_address(self.ground)) as session:

            def seen() -> bool:
                status = status_record(session.view)
                return all(status[key] is not None for key in TOLD) and wanted(status)

            session.find()
            assert session.watch(seen, LONG_S), status_record(session.view)
            return status_record(session.view)

    def take_off(self) -> None:
        """Take off; arming is repeated, because in real time it is refused while the machine is busy."""
        self.do("takeoff", "2")
        for _ in range(TRIES):
            if self._command("arm", "--connect", self.ground).exit_code == 0:
                break
        self.until(lambda status: status["load_up_m"] > 0.5)

    def into_the_mission(self) -> None:
        mission = self._storage.with_name("over-there.toml")
        MISSION.save(mission)
        for command in (("upload", str(mission)), ("start",), ("arm",)):
            self.do(*command)
        self.until(lambda status: status["phase"] == "mission" and status["load_up_m"] > 1.0)


@pytest.fixture
def fly(start: Start, command: Command, tmp_path: Path) -> Callable[..., Flight]:
    return lambda *options: Flight(start, command, tmp_path / "storage", *options)


@pytest.mark.parametrize("options", [QUICK, ("--lockstep", *QUICK)])
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
    flight = fly(*QUICK)
    flight.into_the_mission()
    flight.sitl.kill()
    flight.autopilot.says(b"no message from the simulator")
    assert flight.status()["armed"], "time stands still"
    flight.sitl = flight.begin_sitl()
    flight.autopilot.says(b"the simulator has started again: so do I")
    status = flight.until(lambda status: not status["armed"])
    assert status["phase"] == "disarmed"
    assert status["time_s"] < 60.0
    assert status["mission_items"] > 0


@pytest.mark.parametrize("who", ["autopilot", "sitl"])
def test_a_program_that_stood_still_goes_on_where_it_was(fly: Callable[..., Flight], who: str) -> None:
    """As by Ctrl-Z, or on a machine that sleeps: the world waits, and this does not count as a restart."""
    flight = fly(*QUICK)
    flight.into_the_mission()
    stopped, other = flight.autopilot, flight.sitl
    if who == "sitl":
        stopped, other = other, stopped
    stopped.process.send_signal(signal.SIGSTOP)
    other.says(b"no answer from the autopilot" if who == "autopilot" else b"no message from the simulator")
    stopped.process.send_signal(signal.SIGCONT)
    status = flight.until(lambda status: status["phase"] != "mission")
    assert status["armed"], "it was flown to its landing"
    if who == "sitl":
        texts = json.loads(flight.do("texts", "--json"))
        severity = {text["text"]: text["severity"] for text in texts}
        # a critical text would tell `gcs fly` that the flight has been given up
        assert severity["Simulator silent: time stands still"] == "error"
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


def test_a_vehicle_whose_simulator_is_silent_refuses_what_is_to_be_flown(
    fly: Callable[..., Flight], command: Command
) -> None:
    flight = fly(*QUICK)
    flight.sitl.process.send_signal(signal.SIGSTOP)
    flight.autopilot.says(b"no message from the simulator")
    for asked in ("arm", "land", "start"):
        refused = command(asked, "--connect", flight.ground)
        assert refused.exit_code == 1, asked
        assert "simulator is silent" in refused.stderr
    told = command("status", "--connect", flight.ground).stdout
    assert re.search(r"state +critical", told)
    assert "Simulator silent: time stands still" in told
    assert "Simulator silent: time stands still" in command("texts", "--connect", flight.ground).stdout
    flight.sitl.process.send_signal(signal.SIGCONT)
    flight.autopilot.says(b"flying with the simulator at .*\n(.*\n)*.*flying with the simulator at ")
    flight.take_off()


FENCED = {
    "fileType": "Plan",
    "version": 1,
    "mission": {
        "items": [
            {
                "type": "SimpleItem",
                "command": 22,
                "frame": 3,
                "autoContinue": True,
                "params": [0, 0, 0, 0, 47.397742, 8.545594, 2],
            }
        ]
    },
    "geoFence": {
        "circles": [{"inclusion": True, "circle": {"center": [47.397742, 8.545594], "radius": 25}}],
        "polygons": [],
    },
    "rallyPoints": {"points": []},
}


def test_a_vehicle_whose_stored_fence_is_damaged_is_not_armed_until_it_has_another(
    fly: Callable[..., Flight], tmp_path: Path
) -> None:
    storage, plan = tmp_path / "storage", tmp_path / "fenced.plan"
    storage.mkdir()
    (storage / "fence.bin").write_bytes(b"rubbish")
    plan.write_text(json.dumps(FENCED), encoding="utf-8")
    flight = fly(*QUICK)
    assert f"Storage: {storage}/fence.bin: " in flight.do("texts")
    assert flight.until(lambda status: status["time_s"] > 4.0)["ready_to_arm"] is False
    flight.do("upload", str(plan))
    flight.until(lambda status: status["ready_to_arm"])
    assert (storage / "fence.corrupt").read_bytes() == b"rubbish", "kept, as it may be mended"
    assert (storage / "fence.bin").read_bytes() != b"rubbish"


def test_an_autopilot_that_stands_still_is_named_where_the_flight_is_lost(
    start: Start, tmp_path: Path
) -> None:
    flight = start(
        "gcs", "fly", "hover", "--sensors", "ideal", "--speed", "4", "--out", str(tmp_path / "out")
    )
    flight.says(b"  (lift|hold|mission)  ")
    task = Path(f"/proc/{flight.process.pid}/task/{flight.process.pid}/children")
    (autopilot,) = (
        int(child)
        for child in task.read_text().split()
        if b"autopilot" in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
    )
    os.kill(autopilot, signal.SIGSTOP)
    with pytest.raises(subprocess.TimeoutExpired):  # for some seconds the flight is not lost
        flight.process.wait(7.0)
    os.kill(autopilot, signal.SIGCONT)
    flight.says(b"  (lower|set down)  ")
    os.kill(autopilot, signal.SIGSTOP)
    flight.process.wait(LONG_S)
    told = f"lost: autopilot (process {autopilot}) has been stopped by a signal for "
    assert told.encode() in flight.log.read_bytes()
    assert not Path(f"/proc/{autopilot}").exists()
