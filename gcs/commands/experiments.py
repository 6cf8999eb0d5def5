"""gcs experiments"""

from __future__ import annotations

import time
from pathlib import Path

import click

from gcs.commands.options import json_option, print_json
from gcs.errors import EXIT_DONE, EXIT_INTERRUPTED
from gcs.shell.display import say

_POLL_S = 0.2


@click.group("experiments")
def experiments_command() -> None:
    """Repeat published experiments beside their printed results."""


@experiments_command.command("thesis")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("experiments/thesis"),
    show_default=True,
    help="Where flights, tables and figures go.",
)
@click.option("--fresh", is_flag=True, help="Fly everything anew, also what has been flown already.")
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    help="Flights at a time, each on a core of its own.  [default: all cores]",
)
@click.option(
    "--docs",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Also put tables and key figures into this page, docs/thesis.md of the source tree.",
)
@json_option
@click.option("--quiet", is_flag=True, help="No progress and no tables.")
def thesis_command(
    out: Path, fresh: bool, jobs: int | None, docs: Path | None, as_json: bool, quiet: bool
) -> int:
    """Fly every experiment of chapter 4: four cases, NGC and LQR, the idealised and the true vehicle.

    Sixteen flights through the real processes in lockstep, with ideal sensors; then tables, results.json, a
    figure for each of the thesis's, and index.html that shows them all. A flight that was flown already by
    the same code is used again: after Ctrl-C the same command goes on where it was.

    \b
    gcs experiments thesis
    gcs experiments thesis --out /tmp/thesis --fresh
    """
    from gcs.experiments import flights, thesis
    from gcs.experiments.launch import FlightProcesses, cores
    from gcs.experiments.page import PAGE_FILE
    from gcs.experiments.plan import experiments
    from gcs.experiments.progress import ExperimentDisplay
    from gcs.experiments.reuse import code_fingerprint
    from gcs.shell.stopping import StopRequest

    quiet = quiet or as_json
    thesis.make_directory(out)
    code = code_fingerprint()
    with StopRequest("stopping; what is flown is kept, the same command goes on from there") as stop:
        try:
            with ExperimentDisplay(quiet) as display, FlightProcesses() as processes:
                flights.fly_missing(
                    experiments(),
                    out / thesis.FLIGHTS,
                    cores(jobs),
                    code,
                    processes.start,
                    display.flights,
                    lambda: time.sleep(_POLL_S),
                    lambda: bool(stop),
                    fresh,
                )

                def tell(done: int, total: int, name: str) -> None:
                    if stop:
                        raise flights.Interrupted
                    display.figures(done, total, name)

                report = thesis.write_report(out, code, tell)
        except flights.Interrupted:
            return EXIT_INTERRUPTED
    if docs is not None:
        thesis.write_docs(docs, out, report.records)
    if as_json:
        print_json(report.records)
        return EXIT_DONE
    if not quiet:
        from rich.console import Console

        from gcs.experiments.table import tables

        shown = [table.rich() for table in tables(report.records)]
        # on a narrow terminal lines wrap: better than numbers cut short
        wide = max(Console(width=1000).measure(table).maximum for table in shown)
        console = Console(width=max(wide, Console().width))
        for table in shown:
            console.print(table)
    click.echo(f"report: {out / PAGE_FILE}")
    say(f"thesis: {len(report.records)} flights, {len(report.drawn)} figures")
    return EXIT_DONE
