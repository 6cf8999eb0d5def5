"""`gcs experiments thesis` from its options to tables, figures and page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gcs.analysis.record import Record
from gcs.batch.programs import ProgramBackend, cores
from gcs.batch.progress import BatchDisplay
from gcs.batch.runner import Running
from gcs.errors import StoppedError
from gcs.experiments.marked_text import split_at_marks
from gcs.experiments.plan import Experiment, experiments
from gcs.experiments.run import EndedFlight, fly_missing, missing, start
from gcs.experiments.store import experiment_origin
from gcs.experiments.table import tables
from gcs.experiments.thesis import (
    BEGIN,
    END,
    FLIGHTS,
    Report,
    make_output_directory,
    write_docs,
    write_report,
)
from gcs.folders import reserved
from gcs.shell.display import StepDisplay
from gcs.shell.processes import Child
from gcs.shell.stopping import StopRequest
from gcs.workflows.sweep import STOPPING


def fly_thesis(out: Path, jobs: int | None, docs: Path | None, fresh: bool, quiet: bool) -> Report:
    """Fly what is missing in `out`, `jobs` flights at a time, and write everything else there.

    StoppedError if the user stopped it; completed flights are kept. `docs` is a page of the documentation to
    renew.
    """
    if docs is not None:
        # raises before the flights what would otherwise be raised after them
        split_at_marks(docs, BEGIN, END)
    make_output_directory(out)
    plan, flights = experiments(), out / FLIGHTS
    with (
        reserved(out, "another gcs experiments is writing"),
        StopRequest(STOPPING) as stop,
    ):
        waiting = missing(plan, flights, fresh)
        with BatchDisplay(len(plan) - len(waiting), len(plan), quiet) as display:

            def start_flight(experiment: Experiment, core: int) -> Child:
                return start(experiment, flights / experiment.name, core)

            def report_progress(ended: Sequence[EndedFlight], running: Running) -> None:
                display.add(len(ended), sum(met for _, met in ended), running)

            if not fly_missing(
                waiting,
                flights,
                ProgramBackend(cores(jobs), start_flight),
                report_progress,
                lambda: bool(stop),
            ):
                stored = len(plan) - len(missing(plan, flights, False))
                raise StoppedError(f"stopped: {stored} of {len(plan)} flights are stored")
        with StepDisplay("figures", quiet, long=True) as figures:

            def on_figure(done: int, total: int, name: str) -> None:
                if stop:
                    raise StoppedError(f"stopped: {done} of {total} figures are drawn")
                figures.update(done, total, f"figures  {name}")

            report = write_report(out, experiment_origin(plan[0]).code, on_figure)
    if docs is not None:
        write_docs(docs, out, report.records)
    return report


def print_tables(records: Sequence[Record]) -> None:
    """Print all tables to stdout, as wide as they need to be."""
    from rich.console import Console

    shown = [table.rich() for table in tables(records)]
    # on a narrow terminal the lines wrap, which is better than truncated numbers
    wide = max(Console(width=1000).measure(table).maximum for table in shown)
    console = Console(width=max(wide, Console().width))
    for table in shown:
        console.print(table)
