"""What `gcs check` says of the battery, against flights."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import plumbline
from gcs.cli import gcs
from gcs.closed_loop import Conditions
from gcs.errors import EXIT_DONE, EXIT_ERROR
from gcs.mission_files import load
from gcs.sweep.flight import FlightResult, fly, start_times


def checked(*arguments: str) -> tuple[int, Any]:
    result = CliRunner().invoke(gcs, ["check", *arguments, "--json"])
    return result.exit_code, json.loads(result.stdout)


def flown(mission: str, vehicle: str) -> FlightResult:
    conditions = Conditions(vehicle=vehicle)
    return fly(load(mission), conditions, start_times(load(mission), conditions))


def with_charge(share: float, path: Path) -> str:
    plumbline.Vehicle.load("bebop-real").replace(battery_charge=share).save(path)
    return str(path)


@pytest.mark.parametrize(("mission", "vehicle"), [("hover", "bebop-real"), ("delivery", "heavy-real")])
def test_what_is_left_of_the_charge_is_what_a_flight_leaves(mission: str, vehicle: str) -> None:
    code, found = checked(mission, "--vehicle", vehicle)
    assert code == EXIT_DONE
    # a few seconds more than it takes are expected
    assert 0.0 < flown(mission, vehicle).battery_left_pct - found["battery_left_pct"] < 4.0


def test_a_mission_for_which_the_charge_does_not_last_cannot_be_flown(tmp_path: Path) -> None:
    vehicle = with_charge(0.08, tmp_path / "nearly-empty.toml")
    code, found = checked("hover", "--vehicle", vehicle)
    (problem,) = found["violations"]
    assert code == EXIT_ERROR
    assert problem["text"] == (
        f"the battery is empty after about {problem['limit']:.0f} s in the air, and the flight takes about "
        f"{problem['value']:.0f} s"
    )
    assert 20.0 < problem["limit"] < 40.0 < problem["value"]
    assert flown("hover", vehicle).outcome != "completed"


@pytest.mark.parametrize(
    ("setting", "then"),
    [
        ("COM_LOW_BAT_ACT=0", "the vehicle warns from 15 % on (BAT_LOW_THR)"),
        ("COM_LOW_BAT_ACT=2", "the vehicle lands at 7 % (BAT_CRIT_THR, COM_LOW_BAT_ACT)"),
        ("COM_LOW_BAT_ACT=3", "the vehicle returns at 7 % (BAT_CRIT_THR, COM_LOW_BAT_ACT)"),
    ],
)
def test_a_charge_of_which_little_is_left_is_warned_of(setting: str, then: str, tmp_path: Path) -> None:
    vehicle = with_charge(0.12, tmp_path / "low.toml")
    code, found = checked("hover", "--vehicle", vehicle, "--set", setting)
    assert code == EXIT_DONE
    assert 2.0 < found["battery_left_pct"] < 7.0
    assert [text for text in found["warnings"] if "battery" in text] == [f"warning: battery: {then}"]


def test_a_vehicle_without_a_simulated_battery_is_not_judged_by_it() -> None:
    assert checked("hover")[1]["battery_left_pct"] is None
