"""Compiles the step of an environment before the environment is made, with the messages of `gcs fly`."""

from __future__ import annotations

import sys

from autopilot.geometry.machine_code import ROOT
from autopilot.shell.compiling import Part, print_compiled_kernels
from gcs.workflows.warmup import warm_up
from plumbline.learning.options import EnvOptions
from plumbline.learning.scenario import Scenario

_SOURCE = ROOT / "plumbline" / "learning" / "batch.py"
_COST_S = {"truth": 9.0, "estimate": 17.0}


def part_of(observation: str) -> Part:
    """What must be compiled for environments that observe the truth, or the estimate."""
    title = f"environments that observe the {observation}"
    return Part(
        title, "plumbline.learning.ready", (observation,), _SOURCE, f"env-{observation}", _COST_S[observation]
    )


def compile_step(scenario: Scenario) -> None:
    """Compile what is not compiled yet, with messages on stderr."""
    warm_up([part_of(scenario.options.observation)])


def main(observation: str) -> None:
    """Compile it, unless it is compiled already; prints the names of the kernels that it compiles."""
    print_compiled_kernels()
    from plumbline.learning.batch import Episodes

    Episodes(Scenario(EnvOptions(observation=observation)), 1, threads=1).close()


if __name__ == "__main__":
    main(*sys.argv[1:])
