"""docs/parameters.md lists every parameter of both programs as the programs have it.

To write the page anew: python tests/documentation/test_parameters.py > docs/parameters.md
"""

from __future__ import annotations

from pathlib import Path

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.parameter_table import ParameterTable
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth

PAGE = Path(__file__).parents[2] / "docs" / "parameters.md"
HEAD = """# Parameters

Every number that can be set by name, with the value it has for the vehicle `bebop`. Set one at start with
`--set NAME=VALUE` (of `sitl`, `autopilot` or `gcs fly`, which hands it to the right one), or in flight by the
parameter protocol: `gcs param list`, `gcs param set NAME VALUE`, or any ground station. The autopilot shows
the simulator's parameters beside its own. A change of its own is stored at once and is there again after a
restart; a change of the world lasts as long as the world, unless PREFLIGHT_STORAGE saves it. Those
marked *fixed* take effect at start only.
"""
AUTOPILOT = """
## Autopilot

What the autopilot believes of its vehicle (`VEH_`), the control laws, the estimator, missions and failsafes.

"""
SIMULATOR = """
## Simulator

What is true, whatever the autopilot believes.

"""


def rows(table: ParameterTable) -> str:
    """The parameters of a table as a Markdown table."""
    lines = ["| name | value | range | unit | meaning |", "|---|---|---|---|---|"]
    for name in table.names:
        p = table.describe(name)
        text = p.text + (" (*fixed*)" if p.fixed else "")
        lines.append(f"| `{name}` | {p.default:g} | {p.low:g} ... {p.high:g} | {p.unit} | {text} |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """The page as it should be."""
    autopilot = rows(autopilot_parameters(load_vehicle("bebop")))
    simulator = rows(sim_parameters(load_truth("bebop")))
    return HEAD + AUTOPILOT + autopilot + SIMULATOR + simulator


def test_the_page_is_what_the_programs_have() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python tests/documentation/test_parameters.py"


if __name__ == "__main__":
    print(page(), end="")
