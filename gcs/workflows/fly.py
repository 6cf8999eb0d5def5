"""One `gcs fly` from the mission file to the report: starts the programs, flies, and always cleans up."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.tlog import TlogWriter
from gcs.errors import (
    EXIT_DONE,
    EXIT_ERROR,
    EXIT_INTERRUPTED,
    EXIT_NOT_MET,
    GcsError,
    InputError,
    StoppedError,
)
from gcs.folders import TLOG_FILE, fresh_folder
from gcs.foreign_mission import ForeignMission, home_of, home_text
from gcs.mission_files import load
from gcs.shell.display import notify, stderr_is_terminal
from gcs.shell.link import Address
from gcs.shell.stopping import StopRequest
from gcs.workflows.before_flight import (
    check_law,
    check_mission,
    check_options,
    mission_warnings,
    wind_warnings,
)
from gcs.workflows.flight_folder import FlightFolder, report_abandoned
from gcs.workflows.flight_meta import meta_of
from gcs.workflows.flight_options import FirmwareProgram, FlightOptions, parse_setting
from gcs.workflows.report import make_report
from gcs.workflows.stopwatch import Stopwatch
from gcs.workflows.too_slow import slowness_reason
from gcs.workflows.vehicle_processes import start_vehicle
from gcs.workflows.warmup import flight_parts, vehicle_parts, warm_up
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

OnRecord = Callable[["Record", "Outcome"], None]


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
    options: FlightOptions,
    on_record: OnRecord,
    view: PageOptions | None = None,
    processes: Processes | None = None,
) -> Flight:
    """The whole flight; GcsError if there was none. `on_record` is called when the flight has ended, before
    the pictures of the report are drawn. With `view`, a page shows the flight and stays afterwards. Simulator
    and autopilot may already be loaded in `processes`."""
    warnings = []
    if options.connect is None and options.firmware is None:
        warnings = check_options(options)
    in_lockstep = options.connect is None and options.speed is None  # without other ground stations
    mission = load(options.mission, with_loops=not in_lockstep)
    if options.connect is None and options.firmware is None:
        check_law(mission, options)
    if options.firmware is not None and isinstance(mission, ForeignMission):
        raise InputError(
            f"{options.mission}: --autopilot converts mission files of Plumbline; upload a file of another "
            f"ground station to {options.firmware.kind} with that ground station"
        )
    if not options.quiet:
        for warning in (*warnings, *mission_warnings(options.planner, mission)):
            notify(warning)
        if options.connect is None and home_of(mission) != Home():
            notify(f"{mission.name}: {home_text(home_of(mission))}")
    out = options.out or fresh_folder(mission.name)
    with FlightFolder(out, options.overwrite) as folder:
        if options.connect is None:
            laws = (options.law,) if options.firmware is None else ()
            settings = map(parse_setting, options.settings)
            warm_up([*flight_parts(laws), *vehicle_parts(options.vehicle, settings)], options.quiet)
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
                    client = _fly_started(mission, options, log, out, stop, watch, page, processes)
                else:
                    client, truth_missing = _fly_running(
                        mission, options, options.connect, log, stop, watch, page
                    )

            def on_end(record: Record, outcome: Outcome) -> None:
                on_record(record, outcome)
                if not options.quiet and not stderr_is_terminal():  # on a terminal a bar shows it
                    notify("drawing the report")
                if page is not None:
                    page.send_event(outcome=outcome.name, reason=outcome.reason)

            stop.hint = "the flight is over, and its report is made; Ctrl-C again abandons the report"
            flight = _finish(mission, options, client, truth_missing, watch.stop(), out, folder, stop, on_end)
            folder.unlock()
            if page is not None:
                page.send_event(report=str(out.resolve()))
                stop.hint = "ending the live page; the report is complete"
                page.keep_open(stop)
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


def _fly_started(
    mission: Mission,
    options: FlightOptions,
    log: TlogWriter,
    out: Path,
    stop: StopRequest,
    watch: Stopwatch,
    page: FlightPage | None,
    processes: Processes | None,
) -> FlightClient:
    with start_vehicle(options, home_of(mission), out, processes) as started:
        from gcs.workflows.started_flight import fly_started_vehicle  # imported while the programs load

        check_mission(mission, options)
        for line in wind_warnings(mission, options):
            notify(line)
        _tell_start(options)
        if options.speed is None:
            from gcs.report.warm import load_libraries as load_report

            load_report(lambda: started.vehicle.has_datagram)  # a core is idle until the vehicle sends
        return fly_started_vehicle(mission, options, log, started, stop, watch, page)


def _tell_start(options: FlightOptions) -> None:
    if not options.quiet:
        notify("starting the simulator and the autopilot")


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
    from gcs.workflows.firmware_processes import fly_firmware, start_firmware

    _tell_start(options)
    with start_firmware(program, options, out) as started:
        return fly_firmware(mission, options, program, log, started, stop, watch, page)


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


def _finish(
    mission: Mission,
    options: FlightOptions,
    client: FlightClient,
    truth_missing: str,
    wall_s: float,
    out: Path,
    folder: FlightFolder,
    stop: StopRequest,
    on_record: OnRecord,
) -> Flight:
    from gcs.clients.flight import Outcome

    outcome = client.outcome or Outcome("interrupted")
    if options.firmware is None:  # a firmware counts items in its own way
        outcome = outcome.in_mission_terms(mission)
    tlog = out / TLOG_FILE
    if tlog.stat().st_size == 0:
        if stop:
            raise StoppedError("stopped before the vehicle said anything")
        raise GcsError(outcome.reason or "the vehicle said nothing")
    if stop and not client.started:
        raise StoppedError(f"stopped before the vehicle was armed; what it said is in {folder.set_aside()}")
    if options.connect is not None and not client.started:
        where = f"what the vehicle said is in {folder.set_aside()}"
        raise GcsError(f"{mission.name}: {outcome.name}: {outcome.reason}; {where}")
    folder.keep()
    if options.real_time and outcome.name != "completed":
        own_parts = " and ".join(filter(None, options.own))
        outcome = outcome.with_reason(slowness_reason(tlog, outcome.reason, own_parts))
    try:
        meta = meta_of(mission, options, outcome, wall_s, truth_missing)
        record = make_report(
            tlog, out, meta, options.quiet, lambda record: on_record(record, outcome), options.pictures
        )
    except KeyboardInterrupt:
        report_abandoned(tlog)
        raise
    return Flight(outcome, record, out, bool(stop) and outcome.name == "interrupted")
