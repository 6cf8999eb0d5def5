"""A simulator and an autopilot started for one flight, and stopped after it.

They load for a second before they send anything. They are therefore started first, and the ground station
loads and checks its own part meanwhile; for this reason nothing heavy is imported here. A command starts to
load them before it has examined its arguments.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from autopilot.wire.convert.geodesy import Home
from gcs.folders import SENSOR_LOG
from gcs.shell.link import LOOPBACK, UdpSocket, free_port
from gcs.shell.processes import Processes
from gcs.workflows.flight_options import (
    SIMULATOR_PREFIX,
    FlightOptions,
    home_option,
    ignore_options,
    own_part_options,
)

ONBOARD_LOG = "flight.ulg"
SIMULATOR_LOG, AUTOPILOT_LOG, FIRMWARE_LOG = "sitl.log", "autopilot.log", "firmware.log"
LOGS = (ONBOARD_LOG, SIMULATOR_LOG, AUTOPILOT_LOG, FIRMWARE_LOG, SENSOR_LOG)
_OTHER_STATIONS = ("--gcs", f"{LOOPBACK}:14550", "--api", f"{LOOPBACK}:14540")


@dataclass(frozen=True)
class VehicleProcesses:
    """The running programs, and the sockets to which they send."""

    processes: Processes
    vehicle: UdpSocket
    truth: UdpSocket


@contextmanager
def start_vehicle(
    options: FlightOptions, home: Home, out: Path, processes: Processes | None = None
) -> Iterator[VehicleProcesses]:
    """Start both programs in `processes`, which may have loaded them already, and end them afterwards.

    Their logs, and the autopilot's own log of the flight, stay in `out`.
    """
    with (
        tempfile.TemporaryDirectory(prefix="plumbline-") as storage,
        _keep_log(Path(storage), out),
        processes or Processes() as running,
        closing(UdpSocket()) as vehicle,
        closing(UdpSocket()) as truth,
    ):
        _start(running, options, home, out, Path(storage), vehicle.address, truth.address)
        yield VehicleProcesses(running, vehicle, truth)


@contextmanager
def _keep_log(storage: Path, out: Path) -> Iterator[None]:
    """Afterwards, copy the autopilot's own log of the flight to `out`, if it has written one."""
    try:
        yield
    finally:
        for log in sorted((storage / "card" / "log").glob("*.ulg"))[-1:]:
            shutil.copyfile(log, out / ONBOARD_LOG)


def _start(
    processes: Processes,
    options: FlightOptions,
    home: Home,
    out: Path,
    storage: Path,
    ground: str,
    truth: str,
) -> None:
    simulator = f"{LOOPBACK}:{free_port()}"
    pace = ["--lockstep"] if options.speed is None else ["--speed", f"{options.speed:g}"]
    pace += ["--real-time"] if options.real_time else []
    both = ["--vehicle", options.vehicle, *home_option(home)]
    given = [("--set", setting) for setting in options.settings]
    simulator_settings = [word for words in given if words[1].startswith(SIMULATOR_PREFIX) for word in words]
    autopilot_settings = ["--set", "MIS_INFEASIBLE=0"] if options.force else []
    autopilot_settings += [
        word for words in given for word in words
    ]  # those of the simulator too: the autopilot assumes them as if they had been measured
    world = [
        "--sensors",
        options.sensors,
        "--seed",
        str(options.seed),
        "--listen",
        simulator,
        "--truth",
        truth,
    ]
    world += ["--log-sensors", str(out / SENSOR_LOG)] if options.log_sensors else []
    processes.start("sitl", [*world, *pace, *both, *simulator_settings, "--quiet"], out / SIMULATOR_LOG)
    link = ["--ground-lockstep", ground] if options.speed is None else ["--gcs", ground, *_OTHER_STATIONS]
    onboard = ["--sim", simulator, "--storage", str(storage), "--law", options.law]
    own = [*own_part_options(options.estimator, options.planner), *ignore_options(options.ignored)]
    processes.start(
        "autopilot", [*onboard, *own, *link, *both, *autopilot_settings, "--quiet"], out / AUTOPILOT_LOG
    )
