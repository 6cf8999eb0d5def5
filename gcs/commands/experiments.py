"""gcs experiments"""

from __future__ import annotations

from pathlib import Path

import click

from autopilot.shell.options import WholeNumber
from gcs.commands.options import OUTPUT_FILE, OUTPUT_FOLDER, fresh_option, json_option, print_json
from gcs.shell.display import notify


@click.group("experiments")
def experiments_command() -> None:
    """Repeat published experiments beside their printed results."""


@experiments_command.command("thesis")
@click.option(
    "--out",
    type=OUTPUT_FOLDER,
    default=Path("experiments/thesis"),
    show_default=True,
    help="Folder for flights, tables and figures.",
)
@fresh_option
@click.option(
    "--jobs",
    type=WholeNumber(min=1),
    help="Number of flights in parallel, one per core.  [default: all cores]",
)
@click.option(
    "--docs",
    type=OUTPUT_FILE,
    help="Also put tables and key figures into this page, docs/thesis.md of the source tree.",
)
@json_option
@click.option("--quiet", is_flag=True, help="Print no progress and no tables.")
def thesis_command(
    out: Path, fresh: bool, jobs: int | None, docs: Path | None, as_json: bool, quiet: bool
) -> None:
    """Fly every experiment of chapter 4: four cases, NGC and LQR, the idealised and the true vehicle.

    Flies sixteen flights with the real processes in lockstep, with ideal sensors; then writes tables,
    results.json, a figure for each figure of the thesis, and index.html, which shows them all. Flights that
    the same code has already flown are reused: after Ctrl-C the same command continues.

    \b
    gcs experiments thesis
    gcs experiments thesis --out /tmp/thesis --fresh
    """
    from gcs.experiments.page import PAGE_FILE
    from gcs.workflows.experiments import fly_thesis, print_tables

    report = fly_thesis(out, jobs, docs, fresh, quiet or as_json)
    if as_json:
        print_json(report.records)
        return
    if not quiet:
        print_tables(report.records)
    click.echo(f"report: {out / PAGE_FILE}")
    notify(f"thesis: {len(report.records)} flights, {len(report.drawn)} figures")
