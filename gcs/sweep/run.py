"""A sweep from its plan to its table: stored flights are kept, the rest is flown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from autopilot.shell.compiling import Part
from gcs.batch.pool import PoolBackend
from gcs.batch.progress import BatchDisplay
from gcs.batch.runner import Running, fly_all
from gcs.errors import GcsError, disk_problem, reason, write_error
from gcs.folders import PAGE_FILE, PLAN_FILE, check_no_other_results, make_folder, reserved
from gcs.sweep.plan import SweepPlan
from gcs.sweep.plan_file import store_plan, sweep_origin
from gcs.sweep.results import COMPLETED
from gcs.sweep.store import TABLE_FILE, Row, Store
from gcs.sweep.work import batches, fly_cases, prepare

STORE_INTERVAL_S = 5.0  # longest time between the end of a flight and its storage on disk


@dataclass(frozen=True)
class SweepResult:
    """What `gcs sweep` did."""

    flights: int  # in the table
    flown: int  # of these, in this run
    completed: int
    load_error_max_m: float | None  # of the completed flights; None: there is none
    wall_s: float
    is_complete: bool  # False: stopped before the end

    @property
    def flights_per_s(self) -> float:
        """Flights per second of this run."""
        return self.flown / self.wall_s if self.wall_s > 0.0 else 0.0


def sweep(
    plan: SweepPlan,
    directory: Path,
    command: str,
    workers: AbstractContextManager[tuple[Executor, int]],
    stopped: Callable[[], bool],
    quiet: bool,
    fresh: bool,
    warm: Callable[[Iterable[Part]], None] = lambda _: None,
) -> SweepResult:
    """Fly the flights of the plan that are missing, and store them.

    `stopped` returns whether a stop was requested; `warm` compiles parts of the flight software beforehand,
    which are otherwise compiled when they are first needed. GcsError if a flight cannot be stored.
    """
    store = Store(directory, plan)
    check_no_other_results(directory, PLAN_FILE, (PAGE_FILE, TABLE_FILE))
    make_folder(directory)
    with reserved(directory, "another gcs sweep is writing"):
        if fresh:
            store.clear()
            (directory / PLAN_FILE).unlink(missing_ok=True)
        origin = sweep_origin(plan)
        try:
            store_plan(directory, plan, command, origin)
        except OSError as error:
            raise write_error(error, directory) from None
        with disk_problem_told(directory):
            return _fly_missing(plan, origin.settings["files"], store, workers, stopped, quiet, warm)


@contextmanager
def disk_problem_told(directory: Path) -> Iterator[None]:
    """Within the block, a failure of the disk becomes a GcsError that names the directory of the sweep."""
    try:
        yield
    except OSError as error:
        if not disk_problem(error):
            raise
        text = f"{directory}: {reason(error).lower()}; its flights are kept, and the same command continues"
        raise GcsError(text) from None


def _fly_missing(
    plan: SweepPlan,
    files: Mapping[str, str],
    store: Store,
    workers: AbstractContextManager[tuple[Executor, int]],
    stopped: Callable[[], bool],
    quiet: bool,
    warm: Callable[[Iterable[Part]], None],
) -> SweepResult:
    if store.parts():
        store.merge()  # parts of a sweep that was killed; their names are those of its plan
    stored = store.stored_indices()
    missing = [case for case in plan.cases() if case.index not in stored]
    is_complete, flown, wall_s = True, 0, 0.0
    if missing:
        work = prepare(plan, files, warm, quiet)
        with workers as (executor, count), BatchDisplay(len(stored), plan.flights, quiet) as display:

            def report(rows: Sequence[Row], running: Running) -> None:
                display.add(len(rows), sum(row["outcome"] == COMPLETED for row in rows), running)

            backend = PoolBackend(executor, count, partial(fly_cases, work))
            is_complete = fly_all(
                batches(plan, missing, count), backend, store.add, report, stopped, STORE_INTERVAL_S
            )
            flown, wall_s = display.flown, display.elapsed_s
    table = store.merge()
    outcomes = table.column("outcome").to_pylist()
    errors = table.column("load_error_max_m").to_pylist()
    completed = [error for error, outcome in zip(errors, outcomes, strict=True) if outcome == COMPLETED]
    is_complete = (
        is_complete or len(outcomes) == plan.flights
    )  # a stop may be requested while the last flights fly
    return SweepResult(
        len(outcomes), flown, len(completed), max(completed, default=None), wall_s, is_complete
    )
