"""A mass of the vehicle that is not assumed: a push while the cable is slack, part of the load while it is
taut."""

from __future__ import annotations

import pytest

from autopilot.control.actuators.disturbance_observer import (
    nominal_on_ground,
    observe,
    observer_constants,
    with_extra_load,
    with_extra_weight,
)
from autopilot.control.drag import Drag
from autopilot.control.records import State
from autopilot.geometry.linear import IDENTITY, ZERO
from autopilot.onboard.onboard import build_setup
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters

VEHICLE = build_setup(autopilot_parameters(load_vehicle("bebop")), 1).vehicle
NO_DRAG = Drag(0.0, 0.0)


@pytest.mark.parametrize("extra_kg", [-0.05, 0.0, 0.08])
def test_a_vehicle_that_hangs_still_confirms_the_load_with_which_it_begins(extra_kg: float) -> None:
    """The rotors carry the true weight, and the mass of the load is learned with the assumed one."""
    constants = observer_constants(0.3, 0.1, 0.0, 0.0, 2.0, 0.004, NO_DRAG, VEHICLE)
    begun = with_extra_load(nominal_on_ground(VEHICLE), extra_kg, VEHICLE)
    assert begun.load_mass == pytest.approx(VEHICLE.load_mass + extra_kg)
    begun = begun._replace(load_ground_height=-9.0, vehicle_ground_height=-9.0, ground_force=0.0)
    over = (0.0, 0.0, VEHICLE.cable_length)
    state = State(ZERO, ZERO, (0.0, 0.0, -1.0), ZERO, over, ZERO, IDENTITY, ZERO, ZERO)
    thrust = (VEHICLE.quad_mass + VEHICLE.load_mass + extra_kg) * VEHICLE.gravity
    later = begun
    for _ in range(100):
        later = observe(later, state, 1.0, thrust, ZERO, constants, NO_DRAG, VEHICLE, 0.5)
    assert later.load_mass == pytest.approx(begun.load_mass, rel=1e-9)
    assert later.push == pytest.approx(ZERO, abs=1e-9)


@pytest.mark.parametrize(("extra_kg", "ratio"), [(-9.0, 0.25), (9.0, 4.0)])
def test_the_load_with_which_it_begins_has_the_bounds_of_a_learned_one(extra_kg: float, ratio: float) -> None:
    begun = with_extra_load(nominal_on_ground(VEHICLE), extra_kg, VEHICLE)
    assert begun.load_mass == pytest.approx(ratio * VEHICLE.load_mass)


def test_over_a_slack_cable_it_is_a_push_downwards() -> None:
    observed = nominal_on_ground(VEHICLE)._replace(push=(1.0, 2.0, 3.0))
    pushed = with_extra_weight(observed, 0.1, VEHICLE)
    assert pushed == observed._replace(push=(1.0, 2.0, pytest.approx(3.0 - 0.1 * VEHICLE.gravity)))
    assert with_extra_weight(observed, 0.0, VEHICLE) == observed
