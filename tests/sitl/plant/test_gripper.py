"""The released load falls by itself, the vehicle flies by itself, and nothing is attached again in the
air."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sitl.plant.by_value import advance, initial_state
from sitl.plant.gripper import can_grip, with_cable_released, without_cable

CALM = (0.0, 0.0, 0.0)
WIND = (3.0, -1.0, 0.5)
OFF = (0.0, 0.0, 0.0, 0.0)
HOVER = (1.4, 1.4, 1.4, 1.4)
# Runge-Kutta of order four at 4 ms compared with DOP853 to 1e-12; measured 2e-12 in all
SAME_PATH = 1e-10
STEP = 4e-3


def test_the_load_falls_as_drag_and_gravity_alone_have_it(bebop, aloft):
    """Compared with SciPy's integration of one point in the wind."""
    start = with_cable_released(aloft(bebop, (0.4, 0.1, -1.0), (0.0, 1.5, 0.3), v_load=(2.0, -1.0, 1.0)))
    state, truth = start, without_cable(bebop)
    for _ in range(500):
        state = advance(state, truth, HOVER, WIND, STEP)
        assert (state.taut, state.tension, state.slack_events) == (0.0, 0.0, 0.0)

    def rate(_, y):
        v = y[3:] - np.array(WIND)
        drag = -(bebop.load_drag + bebop.load_drag_quadratic * np.linalg.norm(v)) * v / bebop.load_mass
        return np.concatenate([y[3:], drag - np.array([0.0, 0.0, bebop.gravity])])

    there = solve_ivp(rate, (0.0, 2.0), [*start.x_load, *start.v_load], "DOP853", rtol=1e-12, atol=1e-12)
    assert [*state.x_load, *state.v_load] == pytest.approx(there.y[:, -1], abs=SAME_PATH)
    assert math.dist(state.x_load, state.x_quad) > 10.0 * bebop.cable_length


def test_the_vehicle_flies_as_one_that_never_had_a_load(bebop, aloft):
    """Compared with the same vehicle whose load is elsewhere: equal to the bit, because the load has no
    effect on it."""
    start = with_cable_released(aloft(bebop, (0.4, 0.1, -1.0), (0.0, 1.5, 0.3), v_load=(2.0, -1.0, 1.0)))
    alone = start._replace(x_load=(50.0, 0.0, 90.0), v_load=CALM)
    truth = without_cable(bebop)
    command = (1.2, 1.0, 0.9, 1.1)
    for _ in range(250):
        start, alone = (advance(s, truth, command, WIND, STEP) for s in (start, alone))
    for field in ("quat_wxyz", "omega_body", "rotor_force"):
        assert getattr(start, field) == getattr(alone, field)
    # the plant integrates the load and the vector between the two: rounding of some 50 m, 250 times
    assert start.x_quad == pytest.approx(alone.x_quad, abs=1e-11)
    assert start.v_quad == pytest.approx(alone.v_quad, abs=1e-12)


def test_letting_go_changes_no_position_and_no_velocity(bebop, aloft):
    hung = aloft(bebop, (0.4, 0.1, -1.0), (0.0, 1.5, 0.3), v_load=(2.0, -1.0, 1.0))._replace(tension=1.2)
    free = with_cable_released(hung)
    assert (free.taut, free.tension) == (0.0, 0.0)
    assert free == hung._replace(taut=0.0, tension=0.0)


def test_the_dropped_load_comes_to_rest_on_the_ground(bebop, aloft):
    """From 2 m it strikes at sqrt(2 g h) = 6.2 m/s and slides 0.5 m/s: within 3 s it lies still."""
    state = with_cable_released(aloft(bebop, height=2.0, v_load=(0.5, 0.0, 0.0)))
    truth = without_cable(bebop)
    fastest = 0.0
    for _ in range(750):
        state = advance(state, truth, HOVER, CALM, STEP)
        fastest = max(fastest, -state.v_load[2])
    fall = math.sqrt(2.0 * bebop.gravity * (2.0 - bebop.load_radius))
    # drag takes a little off this speed
    assert 0.97 * fall < fastest < fall
    assert state.load_on_ground == 1.0
    assert state.x_load[2] == pytest.approx(bebop.load_radius, abs=1e-6)
    assert math.hypot(*state.v_load) < 1e-6
    assert state.x_load[0] > 0.3


def test_hold_is_taken_of_a_load_on_the_ground_within_reach_only(bebop, aloft):
    standing = advance(initial_state(bebop), bebop, OFF, CALM, STEP)
    assert can_grip(standing, bebop)
    x = standing.x_load
    beyond = standing._replace(x_load=(x[0] + 0.5, x[1], x[2]))
    assert math.dist(beyond.x_load, beyond.x_quad) > bebop.cable_length
    assert not can_grip(beyond, bebop)
    assert not can_grip(aloft(bebop), bebop)
