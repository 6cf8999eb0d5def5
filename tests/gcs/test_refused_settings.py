"""A mission that the vehicle can fly, but not with the settings of this flight: the refusal names these."""

from __future__ import annotations

from typing import Any

import pytest

import plumbline
from gcs.errors import GcsError
from gcs.mission_files import load
from gcs.workflows.before_flight import check_mission
from gcs.workflows.flight_options import FlightOptions


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


def test_the_check_before_a_flight_takes_what_is_set() -> None:
    """It took the reserve of the vehicle's file, and named that."""
    with pytest.raises(GcsError, match="must leave 45 % of the rotors' range"):
        check_mission(load("case-c"), options("MIS_ROTOR_MARG=20", "MIS_ROTOR_MARG=45"))
    check_mission(load("case-c"), options("MIS_ROTOR_MARG=45", "MIS_ROTOR_MARG=20"))


def test_a_cable_that_is_too_long_for_the_path_is_named() -> None:
    told = r"by vehicle bebop with VEH_CABLE_LEN=8; force=True tries: missions/case-c.toml:20: items\[2\]"
    with pytest.raises(plumbline.Error, match=told):
        plumbline.fly("case-c", settings={"VEH_CABLE_LEN": 8}, quiet=True)
