"""gcs warmup"""

from __future__ import annotations

import click

from autopilot.vehicle.parameters import LAWS
from gcs.commands.options import law_option


@click.command("warmup")
@law_option
@click.option("--all", "all_laws", is_flag=True, help="Compile all control laws.")
@click.option(
    "--sweeps",
    is_flag=True,
    help="Compile the sweeps too, eight flights at once included: a minute or two more for each law.",
)
@click.option("--quiet", is_flag=True, help="Print no progress.")
def warmup_command(law: str, all_laws: bool, sweeps: bool, quiet: bool) -> None:
    """Compile the flight software before the first flight.

    The machine code is kept, for this version of the sources and this processor: later flights, and those of
    other checkouts of the same version, load it. gcs fly does the same when it has to.

    A sweep of fewer than a thousand flights with a law flies them eight at once, which is faster, only if
    that has been compiled already: by --sweeps, or by a greater sweep.
    """
    from gcs.workflows.warmup import all_sweep_parts, parts_here, warm_up

    laws = LAWS if all_laws else (law,)
    warm_up([*parts_here(laws), *(all_sweep_parts(laws) if sweeps else ())], quiet)
