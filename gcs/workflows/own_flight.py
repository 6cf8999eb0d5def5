"""A flight by a simulator and an autopilot that are started for it and stopped after it."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from autopilot.trajectory.timeline import expected_duration_s
from autopilot.vehicle.parameters import LAWS
from autopilot.wire.convert import Home
from autopilot.wire.items import encode_mission
from autopilot.wire.tlog import TlogWriter
from gcs.clients.capture import LOCKSTEP_BOOT_UNIX_US, Capture
from gcs.clients.connection import LINK_TIMEOUT_US
from gcs.clients.flight import FlightClient
from gcs.shell.display import FlightDisplay
from gcs.shell.link import LOOPBACK, UdpSocket, free_port, unix_us
from gcs.shell.processes import Processes
from gcs.shell.stopping import StopRequest
from gcs.workflows.flight_loops import run_lockstep, run_wall_clock
from gcs.workflows.flight_options import FlightOptions
from missions.model import Mission

ONBOARD_LOG = "flight.ulg"
SIMULATOR_LOG, AUTOPILOT_LOG = "sitl.log", "autopilot.log"
_WATCHERS = ("--gcs", f"{LOOPBACK}:14550", "--api", f"{LOOPBACK}:14540")


class Stopwatch:
    """The wall time from the vehicle's first word to the end of the flight."""

    def __init__(self) -> None:
        self._began_s: float | None = None
        self._wall_s: float | None = None

    def start(self) -> None:
        self._began_s = time.monotonic()

    def stop(self) -> float:
        """Stop if it runs; the time measured."""
        if self._wall_s is None:
            self._wall_s = 0.0 if self._began_s is None else time.monotonic() - self._began_s
        return self._wall_s


def flight_client(mission: Mission, options: FlightOptions, home: Home) -> FlightClient:
    """The ground station's side of the flight; `home` is the vehicle's."""
    slow = 1.0 if options.speed is None else max(1.0, 1.0 / options.speed)
    return FlightClient(
        encode_mission(mission, home),
        expected_duration_s(mission),
        options.limit_s,
        round(LINK_TIMEOUT_US * slow),
    )


def fly_own(
    mission: Mission,
    options: FlightOptions,
    log: TlogWriter,
    out: Path,
    stop: StopRequest,
    watch: Stopwatch,
) -> FlightClient:
    """Fly with a simulator and an autopilot started for it, which are gone afterwards.

    Their logs, and the autopilot's own log of the flight, are left in `out`.
    """
    client = flight_client(mission, options, Home())
    display = FlightDisplay(mission.name, options.quiet)
    vehicle, truth = UdpSocket(), UdpSocket()
    with (
        tempfile.TemporaryDirectory(prefix="plumbline-") as storage,
        _log_kept(Path(storage), out),
        Processes() as processes,
        display,
    ):
        ended = processes.ended

        def begun() -> None:
            watch.start()
            if options.speed is None:
                processes.share_one_core()

        try:
            _start(processes, options, out, Path(storage), vehicle.address, truth.address)
            if options.speed is None:
                capture = Capture(log, LOCKSTEP_BOOT_UNIX_US)
                run_lockstep(client, capture, vehicle, truth, ended, display, stop, begun)
            else:
                capture = Capture(log, unix_us())
                run_wall_clock(client, capture, vehicle, truth, ended, display, stop, begun)
            watch.stop()
        finally:
            vehicle.close()
            truth.close()
    return client


@contextmanager
def _log_kept(storage: Path, out: Path) -> Iterator[None]:
    """Afterwards the autopilot's own log of the flight is in `out`, if it has made one."""
    try:
        yield
    finally:
        for log in sorted((storage / "card" / "log").glob("*.ulg"))[-1:]:
            shutil.copyfile(log, out / ONBOARD_LOG)


def _start(
    processes: Processes, options: FlightOptions, out: Path, storage: Path, ground: str, truth: str
) -> None:
    simulator = f"{LOOPBACK}:{free_port()}"
    pace = ["--lockstep"] if options.speed is None else ["--speed", f"{options.speed:g}"]
    both = ["--vehicle", options.vehicle, "--set", f"CTL_LAW={LAWS.index(options.law)}"]
    if options.force:
        both += ["--set", "MIS_INFEASIBLE=0"]
    for setting in options.settings:
        both += ["--set", setting]
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
    processes.start("sitl", [*world, *pace, *both, "--quiet"], out / SIMULATOR_LOG)
    link = ["--ground-lockstep", ground] if options.speed is None else ["--gcs", ground, *_WATCHERS]
    home = ["--sim", simulator, "--storage", str(storage)]
    processes.start("autopilot", [*home, *link, *both, "--quiet"], out / AUTOPILOT_LOG)
