"""gcs warmup"""

from __future__ import annotations

import click

from autopilot.vehicle.parameters import LAWS
from gcs.commands.options import law_option


@click.command("warmup")
@law_option
@click.option("--all", "all_laws", is_flag=True, help="All control laws.")
@click.option("--quiet", is_flag=True, help="No progress.")
def warmup_command(law: str, all_laws: bool, quiet: bool) -> None:
    """Compile the flight software before the first flight.

    The machine code is kept, for this version of the sources and this processor: later flights, and those of
    other checkouts of the same version, load it. gcs fly does the same when it has to.
    """
    from gcs.workflows.warmup import flight_parts, warm_up

    warm_up(flight_parts(LAWS if all_laws else (law,)), quiet)
