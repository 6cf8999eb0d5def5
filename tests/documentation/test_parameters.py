"""docs/parameters.md lists every parameter of both programs as the programs have it.

To write the page anew: python tests/documentation/test_parameters.py > docs/parameters.md
"""

from __future__ import annotations

from pathlib import Path

from autopilot.vehicle import parameters
from autopilot.vehicle.file import load_vehicle
from autopilot.wire.parameter_file import ParameterFile, group_of
from autopilot.wire.parameter_table import ParameterTable
from sitl.vehicles import sim_parameters
from sitl.vehicles.truth import load_truth

PAGE = Path(__file__).parents[2] / "docs" / "parameters.md"
HEAD = """# Parameters

Every number that can be set by name, with the value it has for the vehicle `bebop`. Set one at start with
`--set NAME=VALUE` (of `sitl`, `autopilot` or `gcs fly`, which hands it to the right one), or in flight by the
parameter protocol: `gcs param list`, `gcs param set NAME VALUE`, or any ground station. The autopilot shows
the simulator's parameters beside its own. A change of its own is stored at once and is there again after a
restart; a change of the world lasts as long as the world, unless PREFLIGHT_STORAGE saves it, and the loss of
the ground link, `SIM_LOSS_PCT`, ends with the autopilot. Those marked *fixed* take effect at start only.
Those marked *disarmed* describe what does not change in flight, and are refused while the vehicle is armed.
Defaults marked *vehicle* are taken from the vehicle file.

This page is made of `autopilot/vehicle/parameters.toml` and `sitl/sim_parameters.toml`.
"""
AUTOPILOT = """
## Autopilot

What the autopilot believes of its vehicle, the control laws, the estimator, missions and failsafes.
"""
SIMULATOR = """
## Simulator

What is true, whatever the autopilot believes.
"""


def tables(definitions: ParameterFile, table: ParameterTable) -> str:
    """A Markdown table for each group of parameters, in the order of the file."""
    lines = []
    for group, title in definitions.groups.items():
        lines += [
            "",
            f"### {title}",
            "",
            "| name | default | range | unit | meaning |",
            "|---|---|---|---|---|",
        ]
        for name, spec in definitions.parameters.items():
            if group_of(name) == group:
                p = table.describe(name)
                default = f"{p.default:g}" + (" *vehicle*" if spec.vehicle_keys else "")
                text = p.text + (" (*fixed*)" if p.fixed else "") + (" (*disarmed*)" if p.disarmed else "")
                lines.append(f"| `{name}` | {default} | {p.low:g} ... {p.high:g} | {p.unit} | {text} |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """The page as it should be."""
    autopilot = parameters.autopilot_parameters(load_vehicle("bebop"))
    world = sim_parameters.sim_parameters(load_truth("bebop"))
    simulated = tables(sim_parameters.definitions(), world)
    return HEAD + AUTOPILOT + tables(parameters.definitions(), autopilot) + SIMULATOR + simulated


def test_the_page_is_what_the_programs_have() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python tests/documentation/test_parameters.py"


if __name__ == "__main__":
    print(page(), end="")
