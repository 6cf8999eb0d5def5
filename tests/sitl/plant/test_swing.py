"""Frequencies known in closed form, and the tension formula."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ellipk

from sitl.plant.by_value import advance

CALM = (0.0, 0.0, 0.0)

# required: 0.1 % of omega^2; an amplitude of 0.01 rad changes it by 1e-5, interpolated crossings by 1e-6
SMALL_SWING = 5e-5
# 1e8 kg of "ceiling" leave 1e-9 of the load's own mass ratio; crossings interpolated as above
PENDULUM = 1e-6
# one evaluation of the same quantity along another way: rounding
TENSION = 1e-12


def _period(state, truth, command, h=1e-3, swings=5):
    """Mean period from the upward zero crossings of q_x, each interpolated linearly in the step."""
    crossings, tick = [], 0
    while len(crossings) <= swings:
        before, state = state, advance(state, truth, command, CALM, h)
        if before.q_cable[0] < 0.0 <= state.q_cable[0]:
            crossings.append((tick + before.q_cable[0] / (before.q_cable[0] - state.q_cable[0])) * h)
        tick += 1
        assert state.taut == 1.0
    return (crossings[-1] - crossings[0]) / swings


def _at_angle(aloft, truth, angle):
    return aloft(truth, q=(math.sin(angle), 0.0, -math.cos(angle)), height=500.0)


def test_small_swing_of_the_free_pair(thesis, aloft):
    hover = 0.25 * (thesis.quad_mass + thesis.load_mass) * thesis.gravity
    period = _period(_at_angle(aloft, thesis, 0.01), thesis, (hover,) * 4)
    omega2 = (2.0 * math.pi / period) ** 2
    expected = thesis.gravity / thesis.cable_length * (1.0 + thesis.load_mass / thesis.quad_mass)
    assert omega2 == pytest.approx(expected, rel=SMALL_SWING)


@pytest.mark.parametrize(("degrees", "published"), [(5.0, 2.8388), (20.0, 2.8593), (45.0, 2.9509)])
def test_pendulum_under_a_vehicle_too_heavy_to_move(thesis, aloft, degrees, published):
    truth = thesis._replace(quad_mass=1e8, load_mass=0.1, cable_length=2.0, gravity=9.80665)
    hold = 0.25 * truth.quad_mass * truth.gravity
    period = _period(_at_angle(aloft, truth, math.radians(degrees)), truth, (hold,) * 4, swings=2)
    exact = (
        4.0
        * math.sqrt(truth.cable_length / truth.gravity)
        * ellipk(math.sin(math.radians(degrees) / 2.0) ** 2)
    )
    assert period == pytest.approx(exact, rel=PENDULUM)
    assert period == pytest.approx(published, abs=6e-5)


def test_tension_of_the_state(thesis, aloft, rotation_of):
    """T = m_L (-q . f R e3 + m_Q L |q'|^2) / (m_Q + m_L), and x_Q'' with it."""
    rng = np.random.default_rng(3)
    state = aloft(thesis, q=(0.3, -0.2, -0.9), q_dot=(1.0, 2.0, 0.5), omega_body=(0.5, -0.4, 0.3))
    for _ in range(50):
        command = tuple(float(x) for x in 1.2 + 0.02 * rng.standard_normal(4))
        before, state = state, advance(state, thesis, command, CALM, 1e-3)
        q, q_dot = np.array(state.q_cable), np.array(state.q_cable_dot)
        thrust = sum(state.rotor_force) * rotation_of(state)[:, 2]
        total = thesis.quad_mass + thesis.load_mass
        tension = (
            thesis.load_mass * (-q @ thrust + thesis.quad_mass * thesis.cable_length * q_dot @ q_dot) / total
        )
        assert state.tension == pytest.approx(tension, rel=TENSION)
        accel = (thrust + tension * q) / thesis.quad_mass - np.array([0.0, 0.0, thesis.gravity])
        assert np.array(state.accel_quad) == pytest.approx(accel, abs=1e-11)
        # the reported acceleration is that of the motion: the mean over a step of 1 ms, to its second order
        mean = (np.array(state.v_quad) - np.array(before.v_quad)) / 1e-3
        assert mean == pytest.approx(accel, abs=0.1)
