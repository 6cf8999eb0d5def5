"""Loads that are much heavier than the vehicle are lifted, carried and set down."""

from __future__ import annotations

import pytest

import plumbline
from plumbline import Land, Mission, Takeoff, Vehicle, Waypoint

MISSION = Mission("over there", [Takeoff(1.0), Waypoint(2.0, 0.0, 1.0, hold_s=1.0), Land()])


@pytest.mark.parametrize(
    ("ratio", "sensors", "greatest_m"),
    [
        (2.5, "lab", 0.01),
        (5.0, "lab", 0.01),
        (1.0, "rtk", 0.1),  # without a tracker, more pull is needed before the cable counts as taut
        (5.0, "rtk", 0.1),
    ],
)
def test_a_load_heavier_than_its_vehicle_is_lifted_and_set_down(
    ratio: float, sensors: str, greatest_m: float
) -> None:
    heavy = Vehicle.load("heavy")
    load_mass_kg = ratio * heavy.quad_mass_kg
    rotor_max_n = 0.55 * (heavy.quad_mass_kg + load_mass_kg) * heavy.gravity_m_s2
    vehicle = heavy.replace(name="loaded", load_mass_kg=load_mass_kg, rotor_max_n=rotor_max_n)
    flight = plumbline.fly(MISSION, vehicle=vehicle, sensors=sensors, seed=2)
    assert (flight.outcome, flight.reason) == ("completed", "")
    assert flight.summary["load_error_max_m"] < greatest_m
