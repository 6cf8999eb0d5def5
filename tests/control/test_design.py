"""The gains of `plumbline` meet the requirements for any vehicle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autopilot.control.design import (
    MAX_SWING_RATIO,
    SATURATED_LAG_SHARE,
    Design,
    Requirements,
    Timing,
    ackermann_gain,
    design,
    evaluate,
    gains_of,
    level_axis_model,
    sampled_loop,
)
from autopilot.control.records import Vehicle

WANTED = Requirements(0.012, integral_ratio=0.2, cable_ratio=1.5, attitude_ratio=4.0, zeta=0.9, noise=1.0)
# a vehicle five times as heavy, with a longer cable
HEAVY = Vehicle(2.0, 0.5, 2.0, (0.02, 0.022, 0.04), 9.81, 0.25, 0.02, 0.0, 10.0)


def rotor_deviation(found: Design, wanted: Requirements, timing: Timing, vehicle: Vehicle) -> float:
    """Standard deviation (N) of a rotor's command."""
    omegas = (found.omega_i, found.omega_x, found.omega_q, found.omega_R)
    return evaluate(*omegas, wanted.zeta, wanted.noise, timing, vehicle)[1]


def test_tolerance_is_what_was_asked_for_and_costs_bandwidth(bebop: Vehicle) -> None:
    fastest = math.inf
    for delay in (0.0, 0.012, 0.072):
        found = design(WANTED, Timing(delay, 0.02, 0.01, 0.004), bebop)
        assert found.tolerance == pytest.approx(0.012, rel=1e-3)
        assert found.omega_R < fastest
        fastest = found.omega_R
        assert found.omega_R / found.omega_q == pytest.approx(4.0)
        assert found.omega_q / found.omega_x == pytest.approx(1.5)
    wider = design(WANTED._replace(tolerance=0.02), Timing(0.072, 0.02, 0.01, 0.004), bebop)
    assert wider.omega_R < fastest


@pytest.mark.parametrize(("rotor_max", "sigmas"), [(1.96, 1.5), (1.5, 3.0)])
def test_noise_takes_over_where_it_is_great(bebop: Vehicle, rotor_max: float, sigmas: float) -> None:
    """The room for noise is the share that paths leave to control or, where hover is near a limit, the
    distance to that limit."""
    timing = Timing(0.0, 0.02, 0.01, 0.004)
    vehicle = bebop._replace(rotor_max=rotor_max)
    room = 0.15 * rotor_max if sigmas == 1.5 else rotor_max - 0.25 * 0.5 * 9.81
    noisy = WANTED._replace(noise=10.0)
    found = design(noisy, timing, vehicle)
    assert sigmas * rotor_deviation(found, noisy, timing, vehicle) == pytest.approx(room, rel=1e-3)
    assert found.tolerance > 0.012
    assert found.omega_R < design(WANTED, timing, vehicle).omega_R


@pytest.mark.parametrize("vehicle", ["bebop", "heavy"])
def test_poles_are_those_of_the_three_loops(vehicle: str, bebop: Vehicle) -> None:
    """The poles of the chain with the gains of the law, written down loop by loop."""
    v = bebop if vehicle == "bebop" else HEAVY
    omega_i, omega_x, omega_q, omega_R, zeta = 0.5, 2.5, 4.0, 15.0, 0.8
    gains = gains_of(omega_i, omega_x, omega_q, omega_R, zeta, v)
    m, reach, J = v.quad_mass + v.load_mass, v.quad_mass * v.cable_length, v.inertia[0]
    A, b = level_axis_model(v, J, 0.01)
    chain, b = A[:7, :7], np.append(np.zeros(6), 1.0 / J)
    # rows that give q_c, then F / (m g) = theta_c, from the chain's state; each rate is a row times the chain
    q_c = np.array([gains.k_i[0], gains.k_x[0], gains.k_v[0], 0.0, 0.0, 0.0, 0.0]) / (m * v.gravity)
    e_q = np.eye(7)[3] - q_c
    # m_Q L q'' = -F - m g q across the cable
    wished = q_c @ chain @ chain - (gains.k_q * e_q + gains.k_omega * (e_q @ chain)) / reach
    theta_c = -np.eye(7)[3] - reach / (m * v.gravity) * wished
    e_R = np.eye(7)[5] - theta_c
    u = J * (theta_c @ chain @ chain) - gains.k_R[0] * e_R - gains.k_Omega[0] * (e_R @ chain)
    closed = np.poly(chain + np.outer(b, u))
    expected = np.array([1.0, omega_i])
    for omega in (omega_x, omega_q, omega_R):
        expected = np.convolve(expected, [1.0, 2.0 * zeta * omega, omega * omega])
    np.testing.assert_allclose(closed, expected, rtol=1e-6)
    np.testing.assert_allclose(ackermann_gain(A, J, expected)[:7], -u, rtol=1e-6, atol=1e-9)


def test_another_vehicle_gets_gains_of_its_own() -> None:
    timing = Timing(0.02, 0.05, 0.02, 0.004)
    found = design(WANTED, timing, HEAVY)
    assert found.tolerance == pytest.approx(0.012, rel=1e-3)
    assert 3.0 * rotor_deviation(found, WANTED, timing, HEAVY) < HEAVY.rotor_max - 0.25 * 2.5 * 9.81
    assert found.gains.k_R[0] == pytest.approx(0.02 * found.omega_R**2)


def test_the_load_is_followed_hardly_faster_than_it_swings() -> None:
    """A light load on a long cable: nothing else would limit the bandwidth so far."""
    light = HEAVY._replace(load_mass=0.05, inertia=(0.01, 0.01, 0.02))
    timing = Timing(0.0, 0.01, 0.01, 0.004)
    for length in (8.0, 4.0, 1.0):
        found = design(WANTED, timing, light._replace(cable_length=length))
        frequency = math.sqrt((1.0 + 0.05 / 2.0) * 9.81 / length)
        assert found.omega_x <= MAX_SWING_RATIO * frequency * (1.0 + 1e-12)
        assert (found.omega_x == pytest.approx(MAX_SWING_RATIO * frequency)) == (length > 1.0)
        assert found.tolerance >= 0.012 * (1.0 - 1e-3)


def test_slow_rotors_need_no_compensation_to_be_stable() -> None:
    """At the limits of the rotors their lag cannot be compensated."""
    lag, period, J = 0.09, 0.004, HEAVY.inertia[0]
    found = design(WANTED, Timing(0.0, lag, 0.01, period), HEAVY)
    polynomial = np.array([1.0, found.omega_i])
    for omega in (found.omega_x, found.omega_q, found.omega_R):
        polynomial = np.convolve(polynomial, [1.0, 2.0 * 0.9 * omega, omega * omega])

    def growth(rotor_lag: float) -> float:
        A, b = level_axis_model(HEAVY, J, rotor_lag)
        loop, _ = sampled_loop(A, b, ackermann_gain(A, J, polynomial), period)
        return float(np.abs(np.linalg.eigvals(loop)).max())

    assert growth(SATURATED_LAG_SHARE * lag) < 1.0
    assert growth(1.02 * SATURATED_LAG_SHARE * lag) > 1.0, "it is not slower than it must be"
    assert found.omega_R < 0.8 * design(WANTED, Timing(0.0, 0.02, 0.01, period), HEAVY).omega_R
