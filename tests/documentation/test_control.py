"""docs/control.md and its log name only files and functions that exist, and state what these compute."""

from __future__ import annotations

import json
import re
from importlib import import_module
from pathlib import Path

import pytest

import autopilot.control
from autopilot.control.believed import believed_vehicle
from autopilot.control.design import yaw_bandwidth_ratio
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters

ROOT = Path(__file__).parents[2]
TEXT = "".join(
    (ROOT / page).read_text(encoding="utf-8") for page in ("docs/control.md", "docs/control-log.md")
)
CONTROL = Path(autopilot.control.__path__[0])
FILE = re.compile(r"`(?:python )?([\w/]+\.(?:py|toml))\b[^`]*`")
FUNCTION = re.compile(r"`(\w+)\.(?!py`|toml`)(\w+)(?:\(|`)")


def test_files_that_are_named_exist() -> None:
    names = FILE.findall(TEXT)
    assert len(names) > 15
    # with their path from the root, from the room, or, for a law, by their name
    places = (ROOT, CONTROL, CONTROL / "laws")
    assert not [name for name in names if not any((place / name).is_file() for place in places)]


def test_functions_that_are_named_exist() -> None:
    named = FUNCTION.findall(TEXT)
    assert ("thesis_cascade", "load_position") in named
    for module, name in named:
        assert callable(getattr(import_module(f"{autopilot.control.__name__}.{module}"), name))


@pytest.mark.parametrize("name", ["bebop", "heavy", "hexarotor"])
def test_the_bandwidth_of_yaw_is_that_of_the_design(name: str) -> None:
    vehicle = believed_vehicle(autopilot_parameters(load_vehicle(name)))
    assert re.search(rf"\b{yaw_bandwidth_ratio(vehicle):.2f} (?:of it )?for\s`{name}`", TEXT)


def test_the_effect_of_a_wrong_delay_is_that_which_was_flown() -> None:
    rows = json.loads((ROOT / "docs" / "figures.json").read_text(encoding="utf-8"))["rows"]
    short, right, long = (
        1e3 * rows[f"B lab 72{told}"]["load_error_max_m"] for told in (", told 62", " ms", ", told 82")
    )
    assert f"increases the error of Case B ({right:.0f} mm) by {long - right:.0f} mm." in TEXT
    assert right - short == pytest.approx(long - right, abs=0.5)
