"""gcs capture"""

from __future__ import annotations

from pathlib import Path

import click

from gcs.commands.options import OUTPUT_FILE, PositiveType, connect_option, truth_option
from gcs.shell.link import Address


@click.command("capture")
@click.option(
    "--out",
    type=OUTPUT_FILE,
    help="The log to write.  [default: flights/capture-TIME/flight.tlog]",
)
@click.option(
    "--duration",
    "duration_s",
    type=PositiveType(),
    help="Stop after NUMBER seconds.",
)
@click.option("--overwrite", is_flag=True, help="Replace an earlier log at --out.")
@connect_option
@truth_option
def capture_command(
    out: Path | None,
    duration_s: float | None,
    overwrite: bool,
    address: Address,
    truth_at: Address | None,
) -> None:
    """Capture telemetry until Ctrl-C.

    The fast messages that a report needs are requested, so that gcs report can use the log.
    """
    from gcs.workflows.capture import capture_to

    path, records = capture_to(out, address, duration_s, truth_at, overwrite)
    click.echo(f"{records} messages captured to {path}")
