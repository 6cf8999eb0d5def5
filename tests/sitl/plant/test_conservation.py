"""What no input may change: energy, momentum, |q| = 1, R in SO(3)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sitl.plant.by_value import advance, advance_many

CALM = (0.0, 0.0, 0.0)
OFF = (0.0, 0.0, 0.0, 0.0)

# |q|-1 and R^T R - I as required; rounding gives 1e-15
CONSTRAINT = 1e-9
# linear momentum is a linear invariant, which a Runge-Kutta step keeps: rounding of 500 steps of about 10 m/s
LINEAR_MOMENTUM = 1e-12
# fourth order; invariants of rotations drift by the fifth power, the odd term of the amplitude
ORDER_LOW, ORDER_HIGH = 3.8, 5.3
STEPS = (4e-3, 2e-3, 1e-3, 5e-4)


def _slope(steps, drifts):
    assert min(drifts) > 1e-13, "the drift is in the rounding: make the motion faster"
    return float(np.polyfit(np.log(steps), np.log(drifts), 1)[0])


@pytest.fixture
def tumble(thesis, aloft):
    """Vehicle and load thrown spinning, the vehicle tumbling, rotors off, no drag."""
    return aloft(
        thesis,
        q=(0.4, -0.3, -0.8),
        q_dot=(9.0, 14.0, -5.0),
        v_load=(1.0, 2.0, 3.0),
        omega_body=(15.0, -22.0, 12.0),
    )


def test_energy_and_angular_momentum_drift_with_the_order_of_the_integrator(tumble, thesis, energy, spins):
    drifts = {"energy": [], "pair": [], "vehicle": []}
    pair, vehicle = spins(tumble, thesis)
    for h in STEPS:
        end = advance_many(tumble, thesis, OFF, CALM, h, round(2.0 / h))
        assert end.taut == 1.0
        pair_end, vehicle_end = spins(end, thesis)
        drifts["energy"].append(abs(energy(end, thesis) - energy(tumble, thesis)))
        drifts["pair"].append(float(np.linalg.norm(pair_end - pair)))
        drifts["vehicle"].append(float(np.linalg.norm(vehicle_end - vehicle)))
    for name, drift in drifts.items():
        assert ORDER_LOW < _slope(STEPS, drift) < ORDER_HIGH, name


def test_centre_of_mass_flies_a_parabola(tumble, thesis, momentum):
    duration = 2.0
    end = advance_many(tumble, thesis, OFF, CALM, 4e-3, round(duration / 4e-3))
    mass = thesis.load_mass + thesis.quad_mass
    fall = np.array([0.0, 0.0, thesis.gravity])
    velocity = momentum(tumble, thesis) / mass
    assert momentum(end, thesis) / mass == pytest.approx(velocity - fall * duration, abs=LINEAR_MOMENTUM)

    def centre(state):
        load, quad = np.array(state.x_load), np.array(state.x_quad)
        return (thesis.load_mass * load + thesis.quad_mass * quad) / mass

    expected = centre(tumble) + velocity * duration - 0.5 * fall * duration**2
    assert centre(end) == pytest.approx(expected, abs=10.0 * LINEAR_MOMENTUM)


def test_constraints_hold_through_a_minute_of_random_flight(bebop, aloft, rotation_of):
    rng = np.random.default_rng(7)
    state = aloft(bebop, q=(0.2, 0.1, -1.0), height=20_000.0)
    switches = 0
    for _ in range(15_000):
        a, b, c, d = (float(x) for x in rng.uniform(-0.5, 2.5, 4))
        wind = tuple(float(x) for x in rng.normal(0.0, 5.0, 3))
        before = state
        state = advance(state, bebop, (a, b, c, d), wind, 4e-3)
        switches += state.taut != before.taut
        assert abs(math.hypot(*state.q_cable) - 1.0) < CONSTRAINT
        # with u of unit length and u' along the sphere
        assert abs(np.dot(state.q_cable, state.q_cable_dot)) < CONSTRAINT * (
            1.0 + math.hypot(*state.q_cable_dot)
        )
        distance = math.dist(state.x_load, state.x_quad)
        if state.taut:
            assert abs(distance - bebop.cable_length) < CONSTRAINT
        else:
            assert distance < bebop.cable_length + CONSTRAINT
    R = rotation_of(state)
    assert np.abs(R.T @ R - np.eye(3)).max() < CONSTRAINT
    assert abs(math.hypot(*state.quat_wxyz) - 1.0) < CONSTRAINT
    assert state.diverged == 0.0
    assert switches > 0, "the flight was meant to pass through both modes"


def test_drag_only_takes_energy(tumble, bebop, energy):
    state, last = tumble, energy(tumble, bebop)
    for _ in range(500):
        state = advance(state, bebop, OFF, CALM, 4e-3)
        now = energy(state, bebop)
        assert now < last
        last = now
