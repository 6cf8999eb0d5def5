"""A mission that was found flyable is known as flyable until something changes on which this depends."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import pytest

from gcs.workflows.flyable import violations
from gcs.workflows.flyable_marks import is_known_flyable
from gcs.workflows.vehicle_limits import load_limits
from missions.fileformat import load_mission
from missions.model import Waypoint

BEBOP = files("autopilot.vehicle").joinpath("vehicles", "bebop.toml").read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def nothing_known(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")


def test_what_was_found_flyable_is_known_with_its_vehicle_and_its_shaping():
    hover = load_mission("hover")
    assert not is_known_flyable(hover, "bebop", True)
    assert violations(hover, "bebop", load_limits("bebop")) == []
    assert is_known_flyable(hover, "bebop", True)
    assert is_known_flyable(replace(hover, title="another"), "bebop", True)
    assert not is_known_flyable(hover, "bebop", False)
    assert not is_known_flyable(hover, "heavy", True)
    higher = (*hover.steps[:-1], Waypoint(0.0, 0.0, 3.0), hover.steps[-1])
    assert not is_known_flyable(replace(hover, steps=higher), "bebop", True)


def test_a_vehicle_file_is_known_by_what_stands_in_it(tmp_path):
    hover, path = load_mission("hover"), tmp_path / "mine.toml"
    path.write_text(BEBOP, encoding="utf-8")
    assert violations(hover, str(path), load_limits(str(path))) == []
    assert is_known_flyable(hover, str(path), True)
    path.write_text(BEBOP.replace("load_mass_kg = 0.1", "load_mass_kg = 0.2"), encoding="utf-8")
    assert not is_known_flyable(hover, str(path), True)
    path.unlink()
    assert not is_known_flyable(hover, str(path), True)


def test_what_cannot_be_flown_is_never_known():
    hover = load_mission("hover")
    too_low = replace(hover, steps=(hover.steps[0], Waypoint(1.0, 0.0, 0.05), hover.steps[-1]))
    assert violations(too_low, "bebop", load_limits("bebop"))
    assert not is_known_flyable(too_low, "bebop", True)


def test_what_is_set_belongs_to_the_mark():
    hover, reserve = load_mission("hover"), (("MIS_ROTOR_MARG", 20.0),)
    assert violations(hover, "bebop", load_limits("bebop", reserve), settings=reserve) == []
    assert is_known_flyable(hover, "bebop", True, reserve)
    assert not is_known_flyable(hover, "bebop", True, (("MIS_ROTOR_MARG", 21.0),))
