"""One `gcs fly` from the mission file to the report: starts what is needed, flies, and always cleans up."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path

from autopilot.geometry import kernel
from autopilot.trajectory.timeline import expected_duration_s
from autopilot.vehicle.parameters import LAWS
from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import encode_mission
from autopilot.wire.signing import Signing, timestamp_of
from autopilot.wire.tlog import TlogWriter
from gcs.analysis.record import FlightMeta, Record
from gcs.clients import command
from gcs.clients.capture import LOCKSTEP_BOOT_UNIX_US, Capture
from gcs.clients.connection import LINK_TIMEOUT_US
from gcs.clients.flight import FlightClient, Outcome
from gcs.errors import (
    EXIT_DONE,
    EXIT_ERROR,
    EXIT_INTERRUPTED,
    EXIT_NOT_MET,
    GcsError,
    StoppedError,
)
from gcs.shell.display import FlightDisplay, say
from gcs.shell.link import LOOPBACK, TRUTH_PORT, Address, UdpSocket, free_port, open_address, unix_us
from gcs.shell.processes import Processes
from gcs.shell.session import Session
from gcs.shell.stopping import StopRequest
from gcs.workflows.check_mission import load_checked
from gcs.workflows.flight_inputs import check_flight_inputs
from gcs.workflows.flight_loops import run_lockstep, run_wall_clock
from gcs.workflows.report import make_report
from missions.model import Mission

_LAST_COMPILED = Path(kernel.__file__).parents[1] / "control" / "laws" / "plumbline_tick.py"
ONBOARD_LOG = "flight.ulg"
WATCHERS = ("--gcs", f"{LOOPBACK}:14550", "--api", f"{LOOPBACK}:14540")
_EXIT = {
    "completed": EXIT_DONE,
    "diverged": EXIT_NOT_MET,
    "timeout": EXIT_NOT_MET,
    "interrupted": EXIT_NOT_MET,
    "refused": EXIT_ERROR,
    "lost": EXIT_ERROR,
}

_REFUSED = 2.0  # MIS_INFEASIBLE


@dataclass(frozen=True)
class FlightOptions:
    """What was typed."""

    mission: str
    law: str
    sensors: str
    vehicle: str
    seed: int
    speed: float | None  # None: lockstep
    out: Path | None
    settings: tuple[str, ...]  # NAME=VALUE
    connect: Address | None
    quiet: bool
    force: bool
    overwrite: bool
    limit_s: float | None


@dataclass(frozen=True)
class Flight:
    """What came of it."""

    outcome: Outcome
    record: Record
    out: Path
    stopped: bool  # by Ctrl-C

    @property
    def exit_code(self) -> int:
        return EXIT_INTERRUPTED if self.stopped else _EXIT[self.outcome.name]


def fly(options: FlightOptions) -> Flight:
    """The whole flight; GcsError if there was none."""
    if options.connect is None:
        check_flight_inputs(options.vehicle, options.sensors, map(_setting, options.settings))
    mission = load_checked(
        options.mission, options.vehicle, options.force or _tried_anyway(options), options.law == "plumbline"
    )
    out = options.out or Path("flights") / f"{mission.name}-{datetime.now():%Y%m%d-%H%M%S}"
    hint = "stopping; Ctrl-C again abandons the report"
    with _Folder(out, options.overwrite) as folder, StopRequest(hint) as stop:
        watch = _Stopwatch()
        tlog = out / "flight.tlog"
        with tlog.open("wb") as file:
            log = TlogWriter(file)
            if options.connect is not None:
                client = _fly_running(mission, options, options.connect, log, stop, watch)
            else:
                client = _fly_own(mission, options, log, out, stop, watch)
        wall_s = watch.stop()
        outcome = client.outcome or Outcome("interrupted")
        if tlog.stat().st_size == 0:
            if stop:
                raise StoppedError("stopped before the vehicle said anything")
            raise GcsError(outcome.reason or "the vehicle said nothing")
        folder.keep()
        try:
            record = make_report(tlog, out, _meta(mission, options, outcome, wall_s), options.quiet)
        except KeyboardInterrupt:
            say(f"report abandoned; the telemetry is in {tlog}")
            raise
        return Flight(outcome, record, out, bool(stop))


def _fly_own(
    mission: Mission,
    options: FlightOptions,
    log: TlogWriter,
    out: Path,
    stop: StopRequest,
    watch: _Stopwatch,
) -> FlightClient:
    """With a simulator and an autopilot of our own, which are gone afterwards."""
    client = _client(mission, options, Home())
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
    if not options.quiet and not kernel.is_compiled(_LAST_COMPILED):
        say("the first flight compiles the kernels of simulator and autopilot: about a minute")
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
    processes.start("sitl", [*world, *pace, *both, "--quiet"], out / "sitl.log")
    link = ["--ground-lockstep", ground] if options.speed is None else ["--gcs", ground, *WATCHERS]
    home = ["--sim", simulator, "--storage", str(storage)]
    processes.start("autopilot", [*home, *link, *both, "--quiet"], out / "autopilot.log")


def _fly_running(
    mission: Mission,
    options: FlightOptions,
    address: Address,
    log: TlogWriter,
    stop: StopRequest,
    watch: _Stopwatch,
) -> FlightClient:
    """With a vehicle that somebody else has started, and that goes on afterwards."""
    with Session(address) as session:
        session.find()
        client = _client(mission, options, vehicle_home(session))
    if address.signing_key is not None:
        client.connection.sign_with(Signing(address.signing_key, timestamp_of(unix_us())))
    truth = _truth_of_a_running_world()
    vehicle = open_address(address)
    try:
        with FlightDisplay(mission.name, options.quiet) as display:
            capture = Capture(log, unix_us())
            run_wall_clock(client, capture, vehicle, truth, lambda: "", display, stop, watch.start)
        watch.stop()
    finally:
        vehicle.close()
        if truth is not None:
            truth.close()
    if client.outcome is not None and client.outcome.name in ("interrupted", "timeout") and client.view.armed:
        with Session(address) as session:
            session.find()
            session.run(command.pause(session.target))
            say("the vehicle holds; gcs land brings it down")
    return client


def vehicle_home(session: Session) -> Home:
    """Where the vehicle says its home is."""
    message = session.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    return Home(message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3)


def _truth_of_a_running_world() -> UdpSocket | None:
    try:
        return UdpSocket(LOOPBACK, TRUTH_PORT)
    except GcsError:
        say(f"UDP {LOOPBACK}:{TRUTH_PORT} is in use: the report will have no truth of the simulator")
        return None


def _client(mission: Mission, options: FlightOptions, home: Home) -> FlightClient:
    slow = 1.0 if options.speed is None else max(1.0, 1.0 / options.speed)
    return FlightClient(
        encode_mission(mission, home),
        expected_duration_s(mission),
        options.limit_s,
        round(LINK_TIMEOUT_US * slow),
    )


def _meta(mission: Mission, options: FlightOptions, outcome: Outcome, wall_s: float) -> FlightMeta:
    own = options.connect is None
    settings: dict[str, float | str] = {}
    for setting in options.settings:
        name, value = _setting(setting)
        settings[name] = value
    return FlightMeta(
        mission=options.mission,
        title=mission.title,
        law=options.law if own else None,
        sensors=options.sensors if own else None,
        vehicle=options.vehicle if own else None,
        seed=options.seed if own else None,
        outcome=outcome.name,
        reason=outcome.reason or None,
        wall_s=wall_s,
        command=_command_line(options),
        version=version("plumbline"),
        settings=settings,
    )


def _setting(text: str) -> tuple[str, float]:
    """NAME=VALUE as the command line has checked it."""
    name, _, value = text.partition("=")
    return name, float(value)


def _tried_anyway(options: FlightOptions) -> bool:
    """Whether the autopilot is told to fly, or to slow down, what it cannot fly as asked."""
    name = "MIS_INFEASIBLE="
    return any(s.startswith(name) and float(s.removeprefix(name)) < _REFUSED for s in options.settings)


def _command_line(options: FlightOptions) -> str:
    words = ["gcs fly", options.mission]
    if options.connect is not None:
        return " ".join([*words, "--connect", str(options.connect)])
    words += ["--law", options.law, "--sensors", options.sensors, "--vehicle", options.vehicle]
    words += ["--seed", str(options.seed)]
    words += ["--lockstep"] if options.speed is None else ["--speed", f"{options.speed:g}"]
    for setting in options.settings:
        words += ["--set", setting]
    return " ".join(words)


class _Stopwatch:
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


class _Folder:
    """The output directory; if the flight came to nothing, what we put there is taken away again."""

    _OURS = ("flight.tlog", ONBOARD_LOG, "sitl.log", "autopilot.log")

    def __init__(self, path: Path, overwrite: bool) -> None:
        self._path = path
        self._overwrite = overwrite
        self._kept = False

    def keep(self) -> None:
        self._kept = True

    def __enter__(self) -> _Folder:
        if not self._overwrite and (self._path / self._OURS[0]).exists():
            raise GcsError(f"--out {self._path}: holds a flight already; name another, or add --overwrite")
        try:
            self._path.mkdir(parents=True, exist_ok=True)
            if not os.access(self._path, os.W_OK):
                raise PermissionError(13, "Permission denied")
        except OSError as error:
            raise GcsError(f"--out {self._path}: {error.strerror}") from None
        return self

    def __exit__(self, *_: object) -> None:
        if self._kept:
            return
        for name in self._OURS:
            (self._path / name).unlink(missing_ok=True)
        if not any(self._path.iterdir()):
            self._path.rmdir()
