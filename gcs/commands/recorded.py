"""gcs identify, gcs replay"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from gcs.commands.options import OUTPUT_FOLDER, json_option, print_json, print_table, spoken

F = TypeVar("F", bound=Callable[..., Any])

_WORDS = {
    "ahead_2s": "predicted 2 s ahead",
    "ahead_5s": "predicted 5 s ahead",
    "pose_alone": "from the vehicle's pose alone",
}


def columns_option(command: F) -> F:
    """--columns: what the recording's columns are."""
    return click.option(
        "--columns",
        metavar="MAP",
        help="Column map: motion-capture, telemetry or a TOML file.  [default for .tlog: telemetry]",
    )(command)


@click.command("identify")
@click.argument("file", metavar="FILE", type=click.Path(path_type=Path))
@columns_option
@json_option
def identify_command(file: Path, columns: str | None, as_json: bool) -> None:
    """Find cable, load and drag from a recorded flight.

    FILE is rows of comma-separated numbers (.csv, .csv.gz) that a column map describes, or a telemetry log of
    a simulated flight. Each number comes with its 95 % interval.

    \b
    gcs identify flight-15.csv.gz --columns motion-capture
    gcs identify flights/case-b/flight.tlog --json
    """
    from gcs.workflows.recorded import identify

    record = identify(file, columns)
    if as_json:
        print_json(record)
        return
    _print_rows(record)
    print_table(
        [
            (spoken(name), f"{one['value']:.4f}", _interval(one["half_width"]))
            for name, one in record["identified"].items()
        ]
    )


@click.command("replay")
@click.argument("file", metavar="FILE", type=click.Path(path_type=Path))
@columns_option
@click.option(
    "--out",
    type=OUTPUT_FOLDER,
    help="Where table and picture go.  [default: replays/, by the flight's folder or the file's name]",
)
@json_option
def replay_command(file: Path, columns: str | None, out: Path | None, as_json: bool) -> None:
    """Estimate the load of a recorded flight, and score it.

    The load is estimated from the vehicle's pose alone (load.csv, load.png) and, where it was measured,
    predicted 2 s and 5 s ahead, with innovations, errors, and the share of them within the stated bounds.
    """
    from gcs.workflows.recorded import replay

    record, folder = replay(file, columns, out)
    if as_json:
        print_json(record)
        return
    _print_rows(record)
    for name, scores in record.items():
        if isinstance(scores, dict) and name != "innovations":
            click.echo(f"{_WORDS[name]}: {', '.join(_shown(key, value) for key, value in scores.items())}")
    for name, one in record.get("innovations", {}).items():
        click.echo(
            f"innovations of {name}: {one['mean_square_per_axis']:.2f} per axis, {one['refused']} refused"
        )
    click.echo(f"load: {folder / 'load.csv'}")
    click.echo(f"picture: {folder / 'load.png'}")


def _print_rows(record: dict[str, Any]) -> None:
    broken = f", broken at {record['breaks']} rows" if record["breaks"] else ""
    jitter = f", jitter {1e3 * record['row_jitter_s']:.1f} ms" if record["row_jitter_s"] else ""
    click.echo(f"{record['rows']} rows, {record['duration_s']:.1f} s{jitter}{broken}")


def _interval(half_width: float) -> str:
    """As +- with four decimals; a width that these do not show has its first digits."""
    return f"+- {half_width:.4f}" if half_width == 0.0 or half_width >= 5e-5 else f"+- {half_width:.1e}"


def _shown(key: str, value: float) -> str:
    if key == "median_m":
        return f"median {1e3 * value:.1f} mm"
    if key == "inside_95":
        return f"{100 * value:.1f} % within the 95 % bounds"
    return f"NEES {value:.2f} per axis"
