"""gcs identify, gcs replay"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from gcs.commands.options import OUTPUT_FOLDER, json_option, print_json, print_table
from gcs.shell.display import notify

F = TypeVar("F", bound=Callable[..., Any])

_MAX_DECIMALS = 6
_QUANTITIES = {  # the identified quantities as displayed
    "tracked_length_m": "cable length, by the distance of the load (m)",
    "length_m": "cable length, by the predicted positions (m)",
    "drag_per_m": "quadratic drag / mass of the load (1/m)",
    "wash_per_s2": "rotor wash at the load, outwards (1/s^2)",
    "swirl_per_s2": "rotor wash at the load, around (1/s^2)",
    "wash_radius_m": "radius of the rotor wash (m)",
    "wash_delay_s": "delay of the rotor wash (s)",
    "acceleration_share": "force on the load / vehicle's acceleration (1)",
    "push_x_m_s2": "constant force / mass of the load, x (m/s^2)",
    "push_y_m_s2": "constant force / mass of the load, y (m/s^2)",
    "mass_ratio": "mass of the load / mass of the vehicle (1)",
    "vehicle_drag_per_s": "linear drag / mass of the vehicle (1/s)",
    "tilt_share": "acceleration shown by the tilt / acceleration (1)",
    "attitude_delay_s": "delay of the attitude (s)",
    "vehicle_drag_per_m": "quadratic drag / mass of the vehicle (1/m)",
}
_SCORE_TITLES = {
    "ahead_2s": "predicted 2 s ahead",
    "ahead_5s": "predicted 5 s ahead",
    "pose_alone": "from the vehicle's pose alone",
}


def columns_option(command: F) -> F:
    """--columns: the meaning of the recording's columns."""
    return click.option(
        "--columns",
        metavar="MAP",
        help="Column map: motion-capture, telemetry or a TOML file.  [default for .tlog: telemetry]",
    )(command)


@click.command("identify")
@click.argument("file", metavar="DIR|FILE", type=click.Path(path_type=Path))
@columns_option
@json_option
def identify_command(file: Path, columns: str | None, as_json: bool) -> None:
    """Find cable, load and drag from a recorded flight.

    DIR is a simulated flight's folder, FILE its telemetry log (.tlog), from which the true states are read,
    or rows of comma-separated numbers (.csv, .csv.gz) that a column map describes. Each number comes with its
    95 % interval; a warning lists those that the recording does not determine because load or vehicle move
    too little. Still air is assumed.

    \b
    gcs identify flight-15.csv.gz --columns motion-capture
    gcs identify flights/case-b --json
    """
    from gcs.workflows.recorded import identify

    record = identify(file, columns, as_json)
    if record["doubt"]:
        notify(record["doubt"])
    names = [_QUANTITIES[name] for name in record["not_told"]]
    if names:
        notify(
            f"the recording does not tell: {', '.join(names)}; load and vehicle move too little for it: "
            "record a longer or faster flight, with swings, turns and stops"
        )
    if as_json:
        print_json(record)
        return
    _print_rows(record)
    print_table(
        [
            (
                _QUANTITIES[name],
                *with_interval(one["value"], one["half_width"]),
                _determined_text(name, record),
            )
            for name, one in record["identified"].items()
        ]
    )


@click.command("replay")
@click.argument("file", metavar="DIR|FILE", type=click.Path(path_type=Path))
@columns_option
@click.option(
    "--out",
    type=OUTPUT_FOLDER,
    help="Folder for table and picture; those of an earlier replay are replaced.  [default: replays/NAME, "
    "after the flight's folder or file]",
)
@json_option
def replay_command(file: Path, columns: str | None, out: Path | None, as_json: bool) -> None:
    """Estimate the load of a recorded flight, and score it.

    DIR is a simulated flight's folder, FILE its telemetry log (.tlog), from which the true states are read,
    or rows of comma-separated numbers (.csv, .csv.gz) that a column map describes. The load is estimated from
    the vehicle's pose alone (load.csv, load.png) and, if it was measured, predicted 2 s and 5 s ahead. The
    score consists of innovations, errors, and the share of errors within the stated bounds.
    """
    from gcs.workflows.recorded import replay

    record, folder = replay(file, columns, out, as_json)
    if record["doubt"]:
        notify(record["doubt"])
    if as_json:
        print_json(record)
        return
    _print_rows(record)
    for name, scores in record.items():
        if isinstance(scores, dict) and name != "innovations":
            scores_text = ", ".join(
                _score_text(key, value) for key, value in scores.items() if math.isfinite(value)
            )
            nothing = "nothing; no stretch without a break is so long" if record["breaks"] else "nothing"
            click.echo(f"{_SCORE_TITLES[name]}: {scores_text or nothing}")
    for name, one in record.get("innovations", {}).items():
        click.echo(
            f"innovations of {name}: {one['mean_square_per_axis']:.2f} per axis, {one['refused']} refused"
        )
    click.echo(f"load: {folder / 'load.csv'}")
    click.echo(f"picture: {folder / 'load.png'}")


def _print_rows(record: dict[str, Any]) -> None:
    breaks = f", broken at {record['breaks']} rows" if record["breaks"] else ""
    jitter = f", jitter {1e3 * record['row_jitter_s']:.1f} ms" if record["row_jitter_s"] else ""
    source = ": the true states of a simulated flight" if record["true_states"] else ""
    click.echo(f"{record['rows']} rows, {record['duration_s']:.1f} s{jitter}{breaks}{source}")


def with_interval(value: float, half_width: float) -> tuple[str, str]:
    """A number and +- half its interval, both to two digits of the latter and at most `_MAX_DECIMALS`
    decimals; a half interval that needs more decimals is written with an exponent."""
    if not math.isfinite(half_width):
        return f"{value:z.4f}", "+- ?"
    digits = 1 - math.floor(math.log10(half_width)) if half_width > 0.0 else _MAX_DECIMALS
    decimals = min(max(digits, 0), _MAX_DECIMALS)
    width = f"{half_width:.{decimals}f}" if digits == decimals or digits < 0 else f"{half_width:.1e}"
    return f"{value:z.{decimals}f}", f"+- {width}"


def _determined_text(name: str, record: dict[str, Any]) -> str:
    return "not determined by this recording" if name in record["not_told"] else ""


def _score_text(key: str, value: float) -> str:
    if key == "median_m":
        return f"median {1e3 * value:.1f} mm"
    if key == "inside_95":
        return f"{100 * value:.1f} % within the 95 % bounds"
    return f"NEES {value:.2f} per axis"
