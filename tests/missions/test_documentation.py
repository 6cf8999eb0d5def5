"""docs/missions.md: its example can be flown; its table and list of assumptions are those of the files."""

from __future__ import annotations

import re
from math import degrees
from pathlib import Path

import pytest

from autopilot.trajectory.feasibility import VehicleLimits, check, peaks
from autopilot.vehicle.file import load_vehicle
from missions.fileformat import load_mission, parse_mission, shipped
from missions.model import Land, Takeoff
from missions.schema import ITEMS, SineSpec, TermSpec

PAGE = (Path(__file__).parents[2] / "docs" / "missions.md").read_text(encoding="utf-8")
# the table leaves the drag of the air out
LIMITS = VehicleLimits(
    load_vehicle("bebop").model_copy(update={"quad_drag_n_s_m": 0.0, "quad_drag_quadratic_n_s2_m2": 0.0})
)


def table_row(name: str) -> str:
    """The row of a mission: the extremes over all of its items except take-off and landing, or over these if
    there are no others."""
    mission = load_mission(name)
    surveys = peaks(mission, LIMITS)
    inner = [p for i, p in surveys.items() if not isinstance(mission.steps[i], Takeoff | Land)]
    along = inner or list(surveys.values())
    cells = [
        f"`{name}`",
        f"{max(p.speed.value for p in along):.2f}",
        f"{max(p.accel.value for p in along):.2f}",
        f"{min(p.tension_low.value for p in along):.2f}",
        f"{max(p.thrust.value for p in along):.2f}",
        f"{min(p.rotor_low.value for p in along):.2f} ... {max(p.rotor_high.value for p in along):.2f}",
        f"{degrees(max(p.tilt.value for p in along)):.1f}",
    ]
    return "| " + " | ".join(cells) + " |"


@pytest.mark.parametrize("name", shipped())
def test_the_table_holds_the_peaks_of_each_shipped_mission(name: str) -> None:
    assert table_row(name) in PAGE


@pytest.mark.parametrize("name", shipped())
def test_the_assumptions_of_each_shipped_mission_are_listed(name: str) -> None:
    for assumption in load_mission(name).assumptions:
        assert assumption in PAGE


def test_the_example_shows_every_key_and_can_be_flown() -> None:
    example, *_ = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    mission = parse_mission(example, "example", "docs/missions.md")
    assert [str(violation) for violation in check(mission, LIMITS)] == []
    for kind, item in ITEMS.items():
        assert f'type = "{kind}"' in example
        for key in (*item.model_fields, *TermSpec.model_fields, *SineSpec.model_fields):
            assert re.search(rf"\b{key}\b", example), key
