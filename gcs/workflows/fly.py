"""One `gcs fly` from the mission file to the report: starts the programs, flies, and always cleans up."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from autopilot.wire.tlog import TlogWriter
from gcs.errors import (
    EXIT_DONE,
    EXIT_ERROR,
    EXIT_INTERRUPTED,
    EXIT_NOT_MET,
    GcsError,
    InputError,
    StoppedError,
    disk_trouble,
)
from gcs.folders import PAGE_FILE, SUMMARY_FILE, TLOG_FILE, fresh_folder, keep_others, make_folder
from gcs.shell.display import is_live, say
from gcs.shell.link import Address
from gcs.shell.stopping import StopRequest
from gcs.workflows.before_flight import check_mission, check_options, planner_doubts
from gcs.workflows.flight_meta import meta_of
from gcs.workflows.flight_options import FirmwareProgram, FlightOptions
from gcs.workflows.mission_file import load
from gcs.workflows.own_vehicle import LOGS, own_vehicle
from gcs.workflows.report import make_report
from gcs.workflows.stopwatch import Stopwatch
from gcs.workflows.too_slow import too_slow
from gcs.workflows.warmup import flight_parts, warm_up
from missions.model import Mission

if TYPE_CHECKING:
    from gcs.analysis.record import Record
    from gcs.clients.flight import FlightClient, Outcome
    from gcs.shell.processes import Processes
    from gcs.workflows.flight_page import FlightPage, PageOptions

_EXIT = {
    "completed": EXIT_DONE,
    "diverged": EXIT_NOT_MET,
    "timeout": EXIT_NOT_MET,
    "interrupted": EXIT_NOT_MET,
    "refused": EXIT_ERROR,
    "lost": EXIT_ERROR,
}

UNFLOWN_FILE = "unflown.tlog"  # telemetry of a vehicle that did not fly

Told = Callable[["Record", "Outcome"], None]


@dataclass(frozen=True)
class Flight:
    """The result of a flight."""

    outcome: Outcome
    record: Record
    out: Path
    stopped: bool  # by Ctrl-C, before the mission ended

    @property
    def exit_code(self) -> int:
        return EXIT_INTERRUPTED if self.stopped else _EXIT[self.outcome.name]


def fly(
    options: FlightOptions, told: Told, view: PageOptions | None = None, processes: Processes | None = None
) -> Flight:
    """The whole flight; GcsError if there was none. `told` is called when the flight has ended, before the
    pictures of the report are drawn. With `view`, a page shows the flight and stays afterwards. Simulator and
    autopilot may already be loaded in `processes`."""
    doubts = []
    if options.connect is None and options.firmware is None:
        doubts = check_options(options)
    mission = load(options.mission)
    if not options.quiet:
        for doubt in (*doubts, *planner_doubts(options.planner, mission)):
            say(doubt)
    out = options.out or fresh_folder(mission.name)
    with FlightFolder(out, options.overwrite) as folder:
        if options.connect is None:
            laws = (options.law,) if options.firmware is None else ()
            warm_up(flight_parts(laws), options.quiet)
            if not options.quiet:
                say("starting the simulator and the autopilot")
        with (
            StopRequest("stopping; Ctrl-C again abandons the report") as stop,
            _page(mission, options, view, stop) as page,
        ):
            watch = Stopwatch()
            tlog, truth_missing = out / TLOG_FILE, ""
            with tlog.open("wb") as file:
                log = TlogWriter(file)
                if options.firmware is not None:
                    client = _fly_firmware(mission, options, options.firmware, log, out, stop, watch, page)
                elif options.connect is None:
                    client = _fly_own(mission, options, log, out, stop, watch, page, processes)
                else:
                    client, truth_missing = _fly_running(
                        mission, options, options.connect, log, stop, watch, page
                    )

            def tell(record: Record, outcome: Outcome) -> None:
                told(record, outcome)
                if not options.quiet and not is_live():  # on a terminal a bar shows it
                    say("drawing the report")
                if page is not None:
                    page.tell(outcome=outcome.name, reason=outcome.reason)

            stop.hint = "the flight is over, and its report is made; Ctrl-C again abandons the report"
            flight = _end(mission, options, client, truth_missing, watch.stop(), out, folder, stop, tell)
            if page is not None:
                page.tell(report=str(out.resolve()))
                stop.hint = "the page is closed"  # the report is complete and can no longer be abandoned
                page.stay(stop)
            return flight


@contextmanager
def _page(
    mission: Mission, options: FlightOptions, view: PageOptions | None, stop: StopRequest
) -> Iterator[FlightPage | None]:
    """The live page, opened in a browser if there is a screen; None if it was not requested."""
    if view is None:
        yield None
        return
    from gcs.workflows.flight_page import flight_page

    with flight_page(mission, options, view) as page:
        page.await_reader(stop)
        yield page


def _fly_own(
    mission: Mission,
    options: FlightOptions,
    log: TlogWriter,
    out: Path,
    stop: StopRequest,
    watch: Stopwatch,
    page: FlightPage | None,
    processes: Processes | None,
) -> FlightClient:
    with own_vehicle(options, out, processes) as own:
        from gcs.workflows.own_flight import fly_own  # imported while the programs load

        check_mission(mission, options)
        if options.speed is None:
            from gcs.report.warm import load_libraries as load_report

            load_report(lambda: own.vehicle.waiting)  # a core is idle until the vehicle sends
        return fly_own(mission, options, log, own, stop, watch, page)


def _fly_firmware(
    mission: Mission,
    options: FlightOptions,
    program: FirmwareProgram,
    log: TlogWriter,
    out: Path,
    stop: StopRequest,
    watch: Stopwatch,
    page: FlightPage | None,
) -> FlightClient:
    from gcs.workflows.own_firmware import fly_firmware, own_firmware

    with own_firmware(program, options, out) as own:
        return fly_firmware(mission, options, program, log, own, stop, watch, page)


def _fly_running(
    mission: Mission,
    options: FlightOptions,
    address: Address,
    log: TlogWriter,
    stop: StopRequest,
    watch: Stopwatch,
    page: FlightPage | None,
) -> tuple[FlightClient, str]:
    from gcs.workflows.running_flight import fly_running

    check_mission(mission, options)
    return fly_running(mission, options, address, log, stop, watch, page)


def _end(
    mission: Mission,
    options: FlightOptions,
    client: FlightClient,
    truth_missing: str,
    wall_s: float,
    out: Path,
    folder: FlightFolder,
    stop: StopRequest,
    told: Told,
) -> Flight:
    from gcs.clients.flight import Outcome

    outcome = client.outcome or Outcome("interrupted")
    if options.firmware is None:  # a firmware counts items in its own way
        outcome = outcome.of_mission(mission)
    tlog = out / TLOG_FILE
    if tlog.stat().st_size == 0:
        if stop:
            raise StoppedError("stopped before the vehicle said anything")
        raise GcsError(outcome.reason or "the vehicle said nothing")
    if stop and not client.begun:
        raise StoppedError(f"stopped before the vehicle was armed; what it said is in {folder.set_aside()}")
    if options.connect is not None and not client.begun:
        told_by = f"what the vehicle said is in {folder.set_aside()}"
        raise GcsError(f"{mission.name}: {outcome.name}: {outcome.reason}; {told_by}")
    folder.keep()
    if options.real_time and outcome.name != "completed":
        outcome = outcome.because(too_slow(tlog))
    try:
        meta = meta_of(mission, options, outcome, wall_s, truth_missing)
        record = make_report(
            tlog, out, meta, options.quiet, lambda record: told(record, outcome), options.pictures
        )
    except KeyboardInterrupt:
        _tell_abandoned(tlog)
        raise
    return Flight(outcome, record, out, bool(stop) and outcome.name == "interrupted")


def _tell_abandoned(tlog: Path) -> None:
    say(f"report abandoned; the telemetry is in {tlog}")


class FlightFolder:
    """The output directory, from which a flight that is overwritten is deleted; if the new flight fails, our
    files are deleted again."""

    _OURS = (TLOG_FILE, *LOGS)

    def __init__(self, path: Path, overwrite: bool) -> None:
        self._path = path
        self._overwrite = overwrite
        self._kept = False

    def keep(self) -> None:
        self._kept = True

    def set_aside(self) -> Path:
        """Keep what was captured under a name that is not a flight's; the next flight may use the folder."""
        self._kept = True
        return (self._path / TLOG_FILE).rename(self._path / UNFLOWN_FILE)

    def __enter__(self) -> FlightFolder:
        make_folder(self._path)
        keep_others(self._path, TLOG_FILE, () if self._overwrite else (SUMMARY_FILE, PAGE_FILE))
        try:
            (self._path / TLOG_FILE).touch(exist_ok=self._overwrite)
        except FileExistsError:
            text = f"--out {self._path}: holds a flight already; name another, or add --overwrite"
            raise InputError(text) from None
        if self._overwrite:
            from gcs.report.build import delete_report

            delete_report(self._path)
            for name in LOGS:
                (self._path / name).unlink(missing_ok=True)
        return self

    def __exit__(self, _: object, error: BaseException | None, *__: object) -> None:
        trouble, tlog = disk_trouble(error), self._path / TLOG_FILE
        if trouble:
            size = tlog.stat().st_size if tlog.exists() else 0
            if not size:
                with suppress(OSError):  # the faulty disk may prevent this too
                    self._clear()
                raise GcsError(f"{self._path}: {trouble}; no telemetry could be kept") from None
            raise GcsError(
                f"{self._path}: {trouble}; {size} bytes of telemetry are kept in {tlog}; "
                f"gcs report {shlex.quote(str(self._path))} reads them"
            ) from None
        if self._kept:
            return
        if isinstance(error, KeyboardInterrupt) and tlog.exists() and tlog.stat().st_size > 0:
            _tell_abandoned(tlog)
            return
        self._clear()

    def _clear(self) -> None:
        for name in self._OURS:
            (self._path / name).unlink(missing_ok=True)
        if not any(self._path.iterdir()):
            self._path.rmdir()
