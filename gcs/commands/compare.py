"""gcs compare"""

from __future__ import annotations

from pathlib import Path

import click

from gcs.commands.options import OUTPUT_FILE, json_option, print_json


@click.command("compare")
@click.argument("runs", metavar="RUN RUN ...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--out",
    type=OUTPUT_FILE,
    help="Path of the page, .html; an existing file is replaced.  [default: comparisons/RUN-RUN.html]",
)
@json_option
@click.option("--quiet", is_flag=True, help="Print no table.")
def compare_command(runs: tuple[Path, ...], out: Path | None, as_json: bool, quiet: bool) -> None:
    """Compare flights: figures, settings, tracks and errors.

    RUN is the output of gcs fly or gcs capture, or any telemetry log of a Plumbline vehicle. The figures
    are listed side by side with the best of each marked, and with the differences in mission, law, sensors,
    seed and parameters; the page overlays tracks and errors. If there are more flights than the terminal has
    columns for, only the main figures are shown, in a row for each flight.

    \b
    gcs compare flights/plumbline flights/thesis
    gcs compare flights/* --json
    """
    from gcs.workflows.compare import compare

    found, page = compare(runs, out)

    from gcs.report.compare import STAR, comparison, comparison_table, figures, fits_in_columns

    if as_json:
        print_json(comparison(found))
        return
    if not quiet:
        from rich.console import Console

        console = Console()
        if fits_in_columns(found, console.width):
            console.print(comparison_table(found))
        else:
            from gcs.report.overview import overview

            table, hidden = overview(found, console.width)
            console.print(table)
            also_differs = f" What differs too: {', '.join(hidden)}." if hidden else ""
            click.echo(f"The page and --json have all figures.{also_differs}")
        if any(row.best for _, rows in figures(found) for row in rows):
            click.echo(STAR)
    click.echo(f"comparison: {page}")
