"""gcs warmup"""

from __future__ import annotations

import click

from autopilot.geometry.machine_code import KEEPING_HINT, storage_problem
from autopilot.shell.compiling import ready
from autopilot.vehicle.parameters import LAWS
from gcs.commands.options import law_option
from gcs.errors import GcsError


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

    The machine code is stored for this version of the sources and this processor: later flights, and those of
    other checkouts of the same version, load it. gcs fly compiles too, if necessary.

    Sweeps fly eight flights at the same time, which is faster. With fewer than a thousand flights for a law,
    they do so only if the code for this is already compiled: by --sweeps, or by a larger sweep.
    """
    from gcs.workflows.warmup import all_sweep_parts, in_process_parts, warm_up

    laws = LAWS if all_laws else (law,)
    parts = [*in_process_parts(laws), *(all_sweep_parts(laws) if sweeps else ())]
    problem = "" if ready(parts) else storage_problem()
    if problem:
        raise GcsError(f"{problem}; the machine code cannot be kept there; {KEEPING_HINT}")
    warm_up(parts, quiet)
