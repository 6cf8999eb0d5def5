"""`gcs sweep` from its arguments to table and report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from autopilot.own.misspellings import misspelling_warnings
from autopilot.own.own_code import NO_OWN_CODE, OwnCode
from gcs.batch.pool import dask_cluster, local_processes
from gcs.batch.programs import cores
from gcs.errors import EXIT_DONE, EXIT_INTERRUPTED
from gcs.folders import PAGE_FILE, REPEATS_FOLDER
from gcs.mission_files import load
from gcs.shell.display import notify
from gcs.shell.stopping import StopRequest
from gcs.sweep.plan import SweepPlan, make_plan
from gcs.sweep.plan_file import default_directory, default_folder, sweep_origin
from gcs.sweep.plan_values import parse_seeds, parse_varied, varied_values
from gcs.sweep.report import write_report
from gcs.sweep.results import flights_by_law, law_record, share_record
from gcs.sweep.run import SweepResult, disk_problem_told, sweep
from gcs.sweep.standouts import (
    Standout,
    flight_settings,
    ignored_parameters,
    repeat_command,
    standouts,
)
from gcs.sweep.store import TABLE_FILE, Store
from gcs.workflows.before_flight import mission_warnings
from gcs.workflows.flight_inputs import sensor_warnings, setting_warnings, vehicle_warnings
from gcs.workflows.flight_options import FlightOptions, parse_setting
from gcs.workflows.unused_settings import unused_settings
from gcs.workflows.warmup import warm_up

_CONTINUED = "completed flights are stored, run the same command again to continue"
STOPPING = f"stopping; {_CONTINUED}"


FIGURES = (  # of the record, that `--require` accepts
    "flights",
    "completed",
    "failed",
    "completed_fraction",
    "completed_low_95",
    "completed_high_95",
    "load_error_max_m",
    "planned",
    "flown",
    "wall_s",
    "flights_per_s",
)


@dataclass(frozen=True)
class SweepOptions:
    """Arguments and options of `gcs sweep`."""

    mission: str
    laws: Sequence[str]
    sensors: str
    vehicle: str
    varied: Sequence[str]  # NAME=VALUES
    settings: Sequence[str]  # NAME=VALUE
    seeds: str  # N, or a list and ranges
    sample: int | None
    jobs: int | None
    scheduler: str | None
    out: Path | None
    fresh: bool
    quiet: bool
    command: str  # as it was typed
    own: OwnCode = NO_OWN_CODE  # custom estimator and planner of all flights
    reports: bool = False  # also of the flights that stand out
    table_only: bool = False  # no page
    limit_s: float | None = None  # longest time that a flight may last


@dataclass(frozen=True)
class Sweep:
    """The result of a sweep; `name` is the mission's."""

    name: str
    counts: SweepResult
    planned: int
    directory: Path
    result: Path  # the page, else the table
    flights: tuple[dict[str, object], ...]  # the flights that stand out
    laws: tuple[dict[str, object], ...]  # numbers and medians of each law

    @property
    def exit_code(self) -> int:
        return EXIT_DONE if self.counts.is_complete else EXIT_INTERRUPTED

    @property
    def record(self) -> dict[str, object]:
        """As `gcs sweep --json` prints it."""
        return {
            "flights": self.counts.flights,
            "completed": self.counts.completed,
            "failed": self.counts.flights - self.counts.completed,
            **share_record(self.counts.completed, self.counts.flights),
            "load_error_max_m": self.counts.load_error_max_m,
            "planned": self.planned,
            "flown": self.counts.flown,
            "wall_s": round(self.counts.wall_s, 3),
            "flights_per_s": round(self.counts.flights_per_s, 2),
            "out": str(self.directory),
            "laws": list(self.laws),
            "standouts": list(self.flights),
        }


def run_sweep(options: SweepOptions) -> Sweep:
    """Plan the sweep, fly its missing flights, and write its report; PlanError if it cannot be flown."""
    plan = make_plan(
        options.mission,
        options.vehicle,
        options.sensors,
        options.laws,
        parse_seeds(options.seeds),
        [parse_varied(text, options.sample is not None) for text in options.varied],
        dict(parse_setting(text) for text in options.settings),
        options.sample or 0,
        options.own,
        options.limit_s,
    )
    if not options.quiet:
        _print_warnings(plan)
    directory = options.out
    if directory is None:
        directory = default_directory(plan, sweep_origin(plan), options.fresh)
        first = default_folder(plan)
        if directory != first and not options.quiet:
            location = "is in" if directory.exists() else "goes to"
            notify(f"{first} holds another sweep: this one {location} {directory}")
    with (
        StopRequest(f"stopping when the flights in the air have ended; {_CONTINUED}") as stop,
        _workers(options) as workers,
    ):
        counts = sweep(
            plan,
            directory,
            options.command,
            workers,
            lambda: bool(stop),
            options.quiet,
            options.fresh,
            partial(warm_up, quiet=options.quiet, stopped=lambda: bool(stop)),
        )
        laws = [flights for flights in flights_by_law(Store(directory, plan).read(), plan) if flights.outcome]
        found = [one for flights in laws for one in standouts(flights)]
        if options.reports and not stop:
            _fly_again(plan, found, directory, options.quiet)
        if options.table_only:
            result = directory / TABLE_FILE
        else:
            if not options.quiet:
                notify("drawing the report")
            with disk_problem_told(directory):
                result = write_report(directory, plan)
    flights = tuple(_standout_record(plan, one, directory) for one in found)
    of_laws = tuple(map(law_record, laws))
    return Sweep(Path(plan.mission).stem, counts, plan.flights, directory, result, flights, of_laws)


@contextmanager
def _workers(options: SweepOptions) -> Iterator[AbstractContextManager[tuple[Executor, int]]]:
    """The workers. A cluster is contacted here, before anything is written or deleted: it may not answer."""
    if options.scheduler:
        with dask_cluster(options.scheduler) as cluster:
            yield nullcontext(cluster)
    else:
        yield local_processes(len(cores(options.jobs)))


def _print_warnings(plan: SweepPlan) -> None:
    """Print what can be flown but may be unintended; of several values of a parameter only the first."""
    own = [line for law in plan.laws for line in misspelling_warnings(plan.own(law))]
    others = [
        *mission_warnings(plan.planner, load(plan.mission)),
        *vehicle_warnings(plan.vehicle),
        *sensor_warnings(plan.sensors),
    ]
    for line in dict.fromkeys([*own, *others]):
        notify(line)
    settings, varied = list(plan.settings), varied_values(plan.varied)
    unused = unused_settings(plan.vehicle, plan.sensors, plan.laws, [*settings, *varied])
    for option, values in (("--set", settings), ("--vary", varied)):
        lines = setting_warnings(plan.vehicle, values)
        for line in {line.split(maxsplit=1)[0]: line for line in reversed(lines)}.values():
            notify(f"{option} {line}")
        for name in dict.fromkeys(name for name, _ in values if name in unused):
            notify(f"{option} {unused[name]}")


def _fly_again(plan: SweepPlan, found: Sequence[Standout], directory: Path, quiet: bool) -> None:
    """Fly each of the flights over the wire, with a report."""
    from gcs.workflows.fly import fly

    for one in found:
        if not quiet:
            notify(f"{one.law}, {one.kind}: flying flight {one.index} again")
        fly(
            FlightOptions(
                mission=plan.mission,
                law=one.reference,
                sensors=plan.sensors,
                vehicle=plan.vehicle,
                seed=one.seed,
                speed=None,
                real_time=False,
                out=directory / REPEATS_FOLDER / one.name,
                settings=flight_settings(plan, one.reference, one.varied),
                connect=None,
                quiet=True,
                force=True,
                overwrite=True,
                limit_s=plan.limit_s,
                estimator=plan.estimator,
                planner=plan.planner,
                ignored=ignored_parameters(plan, one.reference),
            ),
            lambda record, outcome: None,
        )


def _standout_record(plan: SweepPlan, one: Standout, directory: Path) -> dict[str, object]:
    """As `gcs sweep --json` prints it."""
    page = directory / REPEATS_FOLDER / one.name / PAGE_FILE
    return {
        "law": one.law,
        "kind": one.kind,
        "index": one.index,
        "seed": one.seed,
        "told": one.summary,
        "command": repeat_command(plan, one, directory),
        "report": str(page) if page.is_file() else None,
    }
