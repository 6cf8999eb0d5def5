"""Drag of the rotors, flapping and ground effect against their formulas; see also test_second_derivation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sitl.plant.air import ground_gain, rotor_air_wrench
from sitl.plant.by_value import advance_many, rotors_of
from sitl.plant.rotors import FORCE

CALM = (0.0, 0.0, 0.0)
LEVEL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
HIGH = (0.0, 0.0, 50.0)
EXACT = 1e-12


def felt(truth, force, v=CALM, omega=CALM, wind=CALM, place=HIGH, R=LEVEL):
    return rotor_air_wrench(rotors_of(force, force), FORCE, place, v, R, omega, wind, truth)


@pytest.fixture
def hovering(bebop):
    """Force of each of four rotors."""
    return (0.25 * (bebop.quad_mass + bebop.load_mass) * bebop.gravity,) * 4


def with_air(truth, **numbers):
    return truth._replace(air=truth.air._replace(**numbers))


def test_drag_of_hover_is_its_rate_for_each_kilogram_carried(bebop, hovering):
    """Faessler and others (2018) found 0.544 and 0.386 1/s along the two axes of their quadrotor."""
    truth = with_air(bebop, rotor_drag=0.4)
    found = felt(truth, hovering, v=(3.0, -1.0, 2.0), wind=(1.0, 0.0, 0.0))
    mass = bebop.quad_mass + bebop.load_mass
    assert found.force == pytest.approx((-0.4 * mass * 2.0, 0.4 * mass * 1.0, 0.0), abs=EXACT)
    # at the height of the rotors
    x, y, _ = found.force
    assert found.moment == pytest.approx((-bebop.rotor_height * y, bebop.rotor_height * x, 0.0), abs=EXACT)


def test_a_disc_tilts_away_from_its_motion(bebop, hovering):
    """The force is the thrust's component, and stiff blades lift the nose."""
    truth = with_air(bebop, rotor_flap=0.01, blade_stiffness=0.5)
    found = felt(truth, hovering, v=(2.0, 0.0, 0.0))
    assert found.force == pytest.approx((-sum(hovering) * 0.01 * 2.0, 0.0, 0.0), abs=EXACT)
    at_hub = bebop.rotor_height * found.force[0]
    assert found.moment == pytest.approx((0.0, at_hub - 4 * 0.5 * 0.01 * 2.0, 0.0), abs=EXACT)


def test_rotors_brake_a_turn_as_each_hub_moves(bebop, hovering):
    truth = with_air(bebop, rotor_drag=0.4)
    found = felt(truth, hovering, omega=(0.0, 0.0, 3.0))
    braked = -0.4 / bebop.gravity * sum(hovering) * 3.0 * bebop.arm**2
    assert found.moment == pytest.approx((0.0, 0.0, braked), abs=EXACT)


def test_a_gliding_vehicle_slows_down_at_the_rate(bebop, aloft, hovering):
    """Held up by its rotors alone, without the pull of its load: v = v_0 exp(-k t)."""
    truth = with_air(bebop, rotor_drag=0.5)._replace(
        quad_drag=0.0, quad_drag_quadratic=0.0, rotor_height=0.0, attachment=CALM
    )
    alone = (0.25 * truth.quad_mass * truth.gravity,) * 4
    start = aloft(truth, rotor_force=alone)._replace(v_quad=(2.0, 0.0, 0.0), v_load=(2.0, 0.0, 0.0))
    free = truth._replace(cable_length=math.inf)
    end = advance_many(start._replace(taut=0.0), free, alone, CALM, 4e-3, 250)
    assert end.v_quad[0] == pytest.approx(2.0 * math.exp(-0.5), abs=1e-9)


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0, 8.0])
def test_ground_effect_is_that_of_cheeseman_and_bennett(bebop, share):
    air = with_air(bebop, ground_effect=1.0).air
    z = share * air.rotor_radius
    gained = 1.0 / (1.0 - (air.rotor_radius / (4.0 * z)) ** 2) - 1.0
    assert ground_gain(1.2, z, 0.0, air) == pytest.approx(gained, rel=1e-6)
    # below half a radius the formula has no meaning, and no more is gained
    assert ground_gain(1.2, 0.1 * air.rotor_radius, 0.0, air) == ground_gain(
        1.2, 0.5 * air.rotor_radius, 0.0, air
    )


def test_speed_blows_the_cushion_away(bebop):
    """The second form of 1955: the source moves back as V / v_i."""
    air = with_air(bebop, ground_effect=1.0).air
    thrust, z, speed = 1.2, air.rotor_radius, 4.0
    induced = math.sqrt(thrust / (2.0 * air.density * math.pi * air.rotor_radius**2))
    b = (air.rotor_radius / (4.0 * z)) ** 2 / (1.0 + (speed / induced) ** 2)
    assert ground_gain(thrust, z, speed**2, air) == pytest.approx(1.0 / (1.0 - b) - 1.0, rel=1e-6)


def test_the_lower_side_gains_more(bebop, hovering):
    """Each rotor has its own height: a vehicle that leans over the ground is set upright."""
    truth = with_air(bebop, ground_effect=1.0)
    lean = 0.1
    R = ((1.0, 0.0, 0.0), (0.0, math.cos(lean), -math.sin(lean)), (0.0, math.sin(lean), math.cos(lean)))
    found = felt(truth, hovering, place=(0.0, 0.0, 0.06), R=R)
    assert found.moment[0] < 0.0  # leans to the right, is turned to the left
    assert found.force[2] > 0.0
    on_its_back = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
    assert felt(truth, hovering, place=(0.0, 0.0, 0.06), R=on_its_back).force == pytest.approx(
        CALM, abs=1e-15
    )


def test_what_is_off_is_not_there(bebop, aloft, hovering):
    start = aloft(bebop, q=(0.3, 0.1, -1.0), q_dot=(0.4, 0.0, 0.0), rotor_force=hovering)
    plain = advance_many(start, bebop, hovering, CALM, 4e-3, 50)
    for numbers in ({"rotor_drag": 0.4}, {"rotor_flap": 0.01}, {"downwash": 1.0}, {"cable_diameter": 1e-3}):
        changed = advance_many(start, with_air(bebop, **numbers), hovering, CALM, 4e-3, 50)
        assert np.abs(np.array(changed.x_load) - np.array(plain.x_load)).max() > 1e-9, numbers
    lain = with_air(bebop, rotor_radius=0.3, density=2.0, blade_stiffness=3.0)
    assert advance_many(start, lain, hovering, CALM, 4e-3, 50) == plain
