"""The rotors' wake, and what it does to load and cable, against momentum theory and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from autopilot.vehicle.layout import Rotor
from sitl.plant.by_value import advance_many, rotors_of
from sitl.plant.cable_drag import DRAG_COEFFICIENT, drag_of_cable
from sitl.plant.records import Motion
from sitl.plant.rotors import FORCE
from sitl.plant.wake import DECAY, wake_at, wake_of

CALM = (0.0, 0.0, 0.0)
LEVEL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
PLACE = (0.0, 0.0, 50.0)
ALONE = (Rotor(0.0, 0.0, 1.0), *[Rotor(1e6, 0.0, 1.0)] * 3)  # one rotor, the others far away and still


@pytest.fixture
def blowing(bebop):
    return bebop._replace(air=bebop.air._replace(downwash=1.0))


def wake_of_one(truth, thrust, below, aside, v=CALM, wind=CALM):
    """What one rotor adds to the wind at a point below it."""
    force = (thrust, 0.0, 0.0, 0.0)
    rotors = rotors_of(force, force, ALONE)
    truth = truth._replace(rotor_height=0.0)
    wake = wake_of(rotors, FORCE, PLACE, v, LEVEL, wind, truth)
    return wake_at((aside, 0.0, PLACE[2] - below), wake, rotors, FORCE, truth)


@pytest.mark.parametrize("below", [0.0001, 0.3, 1.0, 4.0])
def test_a_rotor_s_jet_carries_its_thrust_as_momentum(blowing, below):
    def flux(r):
        return blowing.air.density * wake_of_one(blowing, 1.2, below, r)[2] ** 2 * 2.0 * math.pi * r

    found, _ = quad(flux, 0.0, 50.0 * (blowing.air.rotor_radius + below), limit=200)
    assert found == pytest.approx(1.2, rel=1e-5)


def test_the_jet_begins_at_twice_the_induced_velocity(blowing):
    air = blowing.air
    induced = math.sqrt(1.2 / (2.0 * air.density * math.pi * air.rotor_radius**2))
    assert wake_of_one(blowing, 1.2, 1e-6, 0.0)[2] == pytest.approx(-2.0 * induced, rel=1e-6)


def test_the_jet_ends_as_a_self_similar_one(blowing):
    """Centre line as B sqrt(momentum) / s, half-width within what was measured (Pope 2000, table 5.1)."""
    far = 200.0
    speed = -wake_of_one(blowing, 1.2, far, 0.0)[2]
    assert speed == pytest.approx(
        2.0 * DECAY * math.sqrt(1.2 / (math.pi * blowing.air.density)) / far, rel=1e-5
    )
    widths = np.linspace(0.0, 0.2 * far, 4001)
    speeds = np.array([-wake_of_one(blowing, 1.2, far, r)[2] for r in widths])
    half = widths[np.argmax(speeds < 0.5 * speed)] / far
    assert 0.094 <= half <= 0.102


def test_there_is_no_wake_above_nor_of_rotors_at_rest(blowing):
    assert wake_of_one(blowing, 1.2, -0.5, 0.0) == pytest.approx(CALM, abs=0.0)
    assert wake_of_one(blowing, 0.0, 0.5, 0.0) == pytest.approx(CALM, abs=0.0)
    assert wake_of_one(blowing, -1.0, 0.5, 0.0) == pytest.approx(CALM, abs=0.0)


def test_a_vehicle_that_flies_leaves_its_wake_behind(blowing):
    """The axis leans back by the flight speed over the induced velocity; a wind has the same effect."""
    air = blowing.air
    induced = math.sqrt(1.2 / (2.0 * air.density * 4 * math.pi * air.rotor_radius**2))
    flown = wake_of_one(blowing, 1.2, 0.5, 0.0, v=(3.0, 0.0, 0.0))
    assert flown[0] / flown[2] == pytest.approx(3.0 / induced, rel=1e-5)
    assert wake_of_one(blowing, 1.2, 0.5, 0.0, wind=(-3.0, 0.0, 0.0)) == pytest.approx(flown)
    assert np.linalg.norm(flown) < np.linalg.norm(wake_of_one(blowing, 1.2, 0.5, 0.0))


def test_the_load_in_hover_is_pressed_down(blowing, aloft):
    """The tension of a load at rest is its weight and the drag of the four jets that meet there."""
    truth = blowing
    weight = (truth.quad_mass + truth.load_mass) * truth.gravity
    jets = 4.0 * 3.0 * 0.25 * weight / (math.pi * truth.air.density)
    s = truth.cable_length + truth.rotor_height
    beta = 1.5 * truth.air.rotor_radius**2 + 3.0 / (2.0 * DECAY) ** 2 * s**2
    speed = math.sqrt(jets / beta) / (1.0 + truth.arm**2 / beta) ** 2
    pressed = truth.load_drag_quadratic * speed**2
    force = (0.25 * (weight + pressed),) * 4
    start = aloft(truth, rotor_force=force)
    end = advance_many(start, truth, force, CALM, 1e-4, 1)
    assert end.tension == pytest.approx(truth.load_mass * truth.gravity + pressed, rel=2e-4)
    assert pressed > 0.005 * truth.load_mass * truth.gravity


def test_wind_across_a_cable_pushes_both_ends_alike(bebop):
    truth = bebop._replace(air=bebop.air._replace(cable_diameter=2e-3))
    L = truth.cable_length
    rotors = rotors_of((0.0,) * 4, (0.0,) * 4)
    wake = wake_of(rotors, FORCE, PLACE, CALM, LEVEL, CALM, truth)

    def ends(cable_dot=CALM, v_load=CALM, wind=CALM):
        down = (0.0, 0.0, -L)
        motion = Motion(PLACE, v_load, down, cable_dot, (1.0, 0.0, 0.0, 0.0), CALM, L, 0.0)
        return drag_of_cable(motion, down, cable_dot, wind, wake, rotors, FORCE, truth)

    half = 0.5 * 0.5 * truth.air.density * DRAG_COEFFICIENT * 2e-3 * L
    across = ends(wind=(4.0, 0.0, 3.0))  # what blows along the cable does nothing
    assert across.vehicle == pytest.approx((half * 16.0, 0.0, 0.0), rel=1e-12)
    assert across.load == pytest.approx((half * 16.0, 0.0, 0.0), rel=1e-12)
    # a cable that swings about its upper end: integral of (s v)^2 (1 - s) and of (s v)^2 s
    swung = ends(cable_dot=(2.0, 0.0, 0.0), v_load=(2.0, 0.0, 0.0))
    assert swung.vehicle[0] == pytest.approx(-2.0 * half * 4.0 / 12.0, rel=1e-12)
    assert swung.load[0] == pytest.approx(-2.0 * half * 4.0 / 4.0, rel=1e-12)
