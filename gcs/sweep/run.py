"""A sweep from its plan to its table: what is flown already stays, the rest is flown."""

from __future__ import annotations

from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from gcs.sweep.plan import SweepPlan, store_plan
from gcs.sweep.pool import fly_all
from gcs.sweep.progress import SweepDisplay
from gcs.sweep.store import Row, Store
from gcs.sweep.work import fingerprint, prepare


@dataclass(frozen=True)
class Swept:
    """What `gcs sweep` did."""

    flights: int  # in the table
    flown: int  # of them in this run
    completed: int
    wall_s: float
    whole: bool  # False: stopped before the end

    @property
    def flights_per_s(self) -> float:
        """Pace of this run."""
        return self.flown / self.wall_s if self.wall_s > 0.0 else 0.0


def sweep(
    plan: SweepPlan,
    directory: Path,
    command: str,
    version: str,
    workers: AbstractContextManager[tuple[Executor, int]],
    stopped: object,
    quiet: bool,
    fresh: bool,
) -> Swept:
    """Fly what is missing of the plan and store all of it; `stopped` is true once somebody asked to stop."""
    store = Store(directory, plan)
    if fresh:
        store.clear()
        (directory / "plan.json").unlink(missing_ok=True)
    store_plan(directory, plan, command, version, fingerprint(plan))
    done = store.done()
    missing = [case for case in plan.cases() if case.index not in done]
    whole, flown, wall_s = True, 0, 0.0
    if missing:
        work = prepare(plan)
        with workers as (executor, count), SweepDisplay(len(done), plan.flights, quiet) as display:

            def told(rows: list[Row]) -> None:
                display.add(len(rows), sum(row["outcome"] == "completed" for row in rows))

            whole = fly_all(work, missing, executor, count, store, told, lambda: bool(stopped))
            flown, wall_s = display.flown, display.elapsed_s
    table = store.merge()
    outcomes = table.column("outcome").to_pylist()
    return Swept(len(outcomes), flown, outcomes.count("completed"), wall_s, whole)
