"""Loads on cables of tens of metres are lifted, carried and set down."""

from __future__ import annotations

import pytest

import plumbline
from plumbline import Land, Mission, Takeoff, Vehicle, Waypoint

MISSION = Mission("over there", [Takeoff(2.0), Waypoint(2.0, 0.0, 2.0, hold_s=1.0), Land()])
# of the cable's length, by which the load is beside its path at most: trackers measure both ends of the cable
# to a millimetre, a camera its direction to 3 mrad from an attitude that is known to 5 mrad
TRACKED, SEEN = 0.001, 0.02


@pytest.mark.parametrize(
    ("sensors", "cable_m", "share"),
    [("lab", 45.0, TRACKED), ("lab", 100.0, TRACKED), ("rtk", 30.0, SEEN), ("field", 60.0, SEEN)],
)
def test_a_load_on_a_long_cable_is_lifted_and_set_down(sensors: str, cable_m: float, share: float) -> None:
    vehicle = Vehicle.load("heavy").replace(name="long", cable_length_m=cable_m)
    flight = plumbline.fly(MISSION, vehicle=vehicle, sensors=sensors, seed=2)
    assert (flight.outcome, flight.reason) == ("completed", "")
    assert flight.summary["load_error_max_m"] < share * cable_m
