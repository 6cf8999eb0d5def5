"""gcs report"""

from __future__ import annotations

from pathlib import Path

import click

from gcs.commands.options import OUTPUT_FOLDER, json_option, pictures_option, print_json
from gcs.errors import InputError


@click.command("report")
@click.argument("source", metavar="DIR|TLOG", type=click.Path(path_type=Path))
@click.option(
    "--out",
    type=OUTPUT_FOLDER,
    help="Folder of the report.  [default: that of flight.tlog; for another log, one of its name beside it]",
)
@pictures_option
@click.option("--mcap", is_flag=True, help="Write flight.mcap too, for Foxglove, PlotJuggler and Rerun.")
@click.option(
    "--common-tlog",
    "common",
    is_flag=True,
    help="Write flight.common.tlog too, without the private dialect, for tools that reject it.",
)
@json_option
@click.option("--quiet", is_flag=True, help="Print no progress and no table.")
def report_command(
    source: Path,
    out: Path | None,
    pictures: tuple[str, ...],
    mcap: bool,
    common: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Write the report of a captured flight again.

    DIR is the output of gcs fly or gcs capture, TLOG any telemetry log of a Plumbline vehicle. The command
    writes summary.json, flight.parquet, overview.png and report.html, all from the telemetry alone.
    """
    from gcs.shell.display import notify
    from gcs.workflows.report import make_common, make_mcap, print_record, remade_report

    if mcap:
        from gcs.analysis.mcap import require_libraries

        require_libraries()  # before the work, not after it
    with remade_report(source, out, quiet or as_json, pictures) as (record, folder):
        if as_json:
            print_json(record)
        elif not quiet:
            print_record(record)
        if record["outcome"] == "no telemetry":
            raise InputError(f"{source}: holds no telemetry of a Plumbline vehicle")
        if not record["samples"]:
            notify(f"{source}: holds no moment of a mission with the load in the air; its figures are empty")
        extra_files = [make_common(source, folder)] if common else []
        extra_files += [make_mcap(source, folder)] if mcap else []
    if not as_json:
        for path in extra_files:
            click.echo(f"{path.name}: {path}")
        click.echo(f"report: {folder / 'report.html'}")
