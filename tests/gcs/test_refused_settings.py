"""A mission that the vehicle can fly, but not with the settings of this flight: the refusal names these."""

from __future__ import annotations

from typing import Any

import pytest

import plumbline
from gcs.clients.flight import Outcome
from gcs.errors import GcsError
from gcs.mission_files import load
from gcs.workflows.before_flight import check_mission
from gcs.workflows.flight_options import FlightOptions
from gcs.workflows.refused_settings import with_blamed_settings

REFUSED = Outcome(
    "refused", "start: Mission denied: item 7: from 11.7 s to 38.5 s it exceeds what can be flown"
)


def options(*settings: str, **changed: Any) -> FlightOptions:
    given: dict[str, Any] = {
        "mission": "case-c",
        "law": "plumbline",
        "sensors": "lab",
        "vehicle": "bebop",
        "seed": 1,
        "speed": None,
        "real_time": False,
        "out": None,
        "settings": settings,
        "connect": None,
        "quiet": True,
        "force": False,
        "overwrite": False,
        "limit_s": None,
    }
    return FlightOptions(**{**given, **changed})


def test_the_parameters_that_differ_from_the_vehicles_are_named() -> None:
    flown = options("VEH_CABLE_LEN=8", "MIS_TILT_DEG=5", "SIM_WIND_E=3", "VEH_LOAD_MASS=0.1")
    told = with_blamed_settings(REFUSED, flown)
    assert told.reason == (
        f"{REFUSED.reason}; the check before the flight passes it for vehicle bebop, whose VEH_CABLE_LEN is "
        "0.7 and not 8, MIS_TILT_DEG is 45 and not 5: choose values nearer to those of the vehicle, or "
        "change the mission"
    )


def test_the_check_before_a_flight_takes_what_is_set() -> None:
    """It took the reserve of the vehicle's file, and named that."""
    with pytest.raises(GcsError, match="must leave 45 % of the rotors' range"):
        check_mission(load("case-c"), options("MIS_ROTOR_MARG=20", "MIS_ROTOR_MARG=45"))
    check_mission(load("case-c"), options("MIS_ROTOR_MARG=45", "MIS_ROTOR_MARG=20"))


@pytest.mark.parametrize(
    ("outcome", "flown"),
    [
        (REFUSED, options("SIM_WIND_E=3")),
        (REFUSED, options("VEH_CABLE_LEN=0.7")),
        (REFUSED, options("VEH_CABLE_LEN=8", force=True)),
        (REFUSED, options("VEH_CABLE_LEN=8", planner="mine.py:Mine")),
        (Outcome("refused", "Arming denied: battery"), options("VEH_CABLE_LEN=8")),
        (Outcome("completed"), options("VEH_CABLE_LEN=8")),
    ],
    ids=["none of the vehicle", "same value", "not checked", "own planner", "another refusal", "completed"],
)
def test_no_setting_is_blamed_for_anything_else(outcome: Outcome, flown: FlightOptions) -> None:
    assert with_blamed_settings(outcome, flown) == outcome


def test_a_cable_that_is_too_long_for_the_path_is_named() -> None:
    flight = plumbline.fly("case-c", settings={"VEH_CABLE_LEN": 8}, quiet=True)
    assert flight.outcome == "refused"
    assert "whose VEH_CABLE_LEN is 0.7 and not 8" in flight.reason
