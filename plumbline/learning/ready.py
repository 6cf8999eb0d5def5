"""The step of an environment compiled before it is made, with what `gcs fly` says meanwhile."""

from __future__ import annotations

import sys

from autopilot.geometry.machine_code import ROOT
from autopilot.shell.compiling import Part, name_what_is_compiled
from gcs.workflows.warmup import warm_up
from plumbline.learning.options import EnvOptions
from plumbline.learning.scenario import Scenario

_SOURCE = ROOT / "plumbline" / "learning" / "batch.py"
_COST_S = {"truth": 9.0, "estimate": 17.0}


def part_of(observation: str) -> Part:
    """What environments need that observe the truth, or the estimate."""
    title = f"environments that observe the {observation}"
    return Part(
        title, "plumbline.learning.ready", (observation,), _SOURCE, f"env-{observation}", _COST_S[observation]
    )


def make_ready(scenario: Scenario) -> None:
    """Compile what is left to be compiled; it is told on stderr."""
    warm_up([part_of(scenario.options.observation)])


def main(observation: str) -> None:
    """Compile it, or find it compiled; prints the names of the kernels that it compiles."""
    name_what_is_compiled()
    from plumbline.learning.batch import Episodes

    Episodes(Scenario(EnvOptions(observation=observation)), 1, threads=1).close()


if __name__ == "__main__":
    main(*sys.argv[1:])
