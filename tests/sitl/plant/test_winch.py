"""The cable reeled in and out, compared with derivations that share nothing with the plant."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from sitl.plant.by_value import advance, initial_state
from sitl.plant.winch import MAX_ACCEL, MAX_RATE, MIN_LENGTH, truth_after, with_commanded_rate

CALM = (0.0, 0.0, 0.0)
WIND = (2.0, -1.0, 0.3)
STEP = 4e-3
FORCE = 1.35  # N of each rotor: level, so that the attitude stays
# order four: 4 ms leaves this after 1.2 s, a quarter of the step a 256th; measured 2e-9 and 9e-12
AGREEMENT = {STEP: 1e-8, 0.25 * STEP: 1e-10}


def flown(state, truth, seconds, h, wind=WIND, force=FORCE):
    """The state and the truth after a time at constant reel acceleration."""
    for _ in range(round(seconds / h)):
        state = advance(state, truth, (force,) * 4, wind, h)
        truth = truth_after(truth, h)
    return state, truth


@pytest.fixture(scope="module")
def lagrangian():
    """Accelerations of vehicle and two cable angles, the length a given function of time."""
    t, L0, r, a = sp.symbols("t L0 r a")
    mQ, mL, g, f, kQ1, kQ2, kL1, kL2 = sp.symbols("mQ mL g f kQ1 kQ2 kL1 kL2")
    wind = sp.Matrix(sp.symbols("w0:3"))
    s = sp.Matrix(sp.symbols("x y z alpha beta"))
    v = sp.Matrix(sp.symbols("v0:5"))
    length = L0 + r * t + a * t**2 / 2
    vehicle = s[:3, :]
    lean, side = s[3], s[4]
    load = vehicle + length * sp.Matrix(
        [sp.sin(lean) * sp.cos(side), sp.sin(side), -sp.cos(lean) * sp.cos(side)]
    )

    def rate(expression):
        return expression.jacobian(s) * v + expression.diff(t)

    v_load, v_vehicle = rate(load), v[:3, :]
    kinetic = (mQ * v_vehicle.dot(v_vehicle) + mL * v_load.dot(v_load)) / 2
    potential = g * (mQ * vehicle[2] + mL * load[2])
    air_vehicle, air_load = v_vehicle - wind, v_load - wind
    push = sp.Matrix([0, 0, f]) - (kQ1 + kQ2 * sp.sqrt(air_vehicle.dot(air_vehicle))) * air_vehicle
    pull = -(kL1 + kL2 * sp.sqrt(air_load.dot(air_load))) * air_load
    momenta = sp.Matrix([kinetic]).jacobian(v).T
    force = (
        v_vehicle.jacobian(v).T * push
        + v_load.jacobian(v).T * pull
        + sp.Matrix([kinetic - potential]).jacobian(s).T
        - momenta.jacobian(s) * v
        - momenta.diff(t)
    )
    function = sp.lambdify(
        [t, list(s), list(v), [L0, r, a], [mQ, mL, g, f, kQ1, kQ2, kL1, kL2], list(wind)],
        [momenta.jacobian(v), force],
        modules="numpy",
        cse=True,
    )

    def accelerations(time, at, speed, reel, values):
        mass, generalised = function(time, at, speed, reel, values, WIND)
        return np.linalg.solve(mass, np.ravel(generalised))

    return accelerations


@pytest.mark.parametrize(("reel_rate", "reel_accel"), [(0.5, 0.4), (-0.3, 0.0), (0.0, -0.25)])
def test_a_swing_while_reeling(bebop, aloft, lagrangian, reel_rate, reel_accel):
    start = aloft(bebop, q=(0.3, -0.2, -1.0), q_dot=(0.6, 1.0, 0.0), rotor_force=(FORCE,) * 4)
    q, q_dot = np.array(start.q_cable), np.array(start.q_cable_dot)
    v_quad = np.array(start.v_load) - bebop.cable_length * q_dot - reel_rate * q
    start = start._replace(v_quad=tuple(map(float, v_quad)))
    b = bebop
    values = (b.quad_mass, b.load_mass, b.gravity, 4 * FORCE)
    values += (b.quad_drag, b.quad_drag_quadratic, b.load_drag, b.load_drag_quadratic)
    reel = (b.cable_length, reel_rate, reel_accel)
    lean, side = math.atan2(q[0], -q[2]), math.asin(q[1])
    lean_rate = (q_dot[0] * math.cos(lean) + q_dot[2] * math.sin(lean)) / math.cos(side)
    y = [*start.x_quad, lean, side, *v_quad, lean_rate, q_dot[1] / math.cos(side)]

    def rate(time, at):
        return np.concatenate((at[5:], lagrangian(time, at[:5], at[5:], reel, values)))

    end = solve_ivp(rate, (0.0, 1.2), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    lean, side = end[3:5]
    length = reel[0] + 1.2 * reel_rate + 0.5 * 1.2**2 * reel_accel
    direction = [math.sin(lean) * math.cos(side), math.sin(side), -math.cos(lean) * math.cos(side)]
    for h, allowed in AGREEMENT.items():
        truth = bebop._replace(reel_rate=reel_rate, reel_accel=reel_accel)
        state, after = flown(start, truth, 1.2, h)
        assert state.taut == 1.0
        assert after.cable_length == pytest.approx(length, abs=1e-13)
        assert math.dist(state.x_load, state.x_quad) == pytest.approx(length, abs=1e-13)
        error = np.abs([*(np.array(state.x_quad) - end[:3]), *(np.array(state.q_cable) - direction)]).max()
        assert error < allowed
    # the cable does swing
    assert np.abs(np.array(direction) - q).max() > 0.1


def test_what_the_winch_does_is_the_work_of_the_tension(thesis, aloft):
    """E' = f R e3 . v_Q - T L', and the winch does not change the momentum."""
    truth = thesis._replace(reel_rate=-0.4, reel_accel=0.5, rotor_tau=0.0)
    state = aloft(thesis, q=(0.3, -0.2, -1.0), q_dot=(0.6, 1.0, 0.0), rotor_force=(FORCE,) * 4)
    v_quad = np.array(state.v_quad) - truth.reel_rate * np.array(state.q_cable)
    state = state._replace(v_quad=tuple(map(float, v_quad)))
    m_Q, m_L, g = thesis.quad_mass, thesis.load_mass, thesis.gravity

    def energy(s):
        v_Q, v_L = np.array(s.v_quad), np.array(s.v_load)
        return 0.5 * m_Q * v_Q @ v_Q + 0.5 * m_L * v_L @ v_L + g * (m_Q * s.x_quad[2] + m_L * s.x_load[2])

    def momentum(s):
        return m_Q * np.array(s.v_quad) + m_L * np.array(s.v_load)

    h, work, powers = 1e-3, 0.0, []
    # the first step finds the tension at the start
    state, truth = advance(state, truth, (FORCE,) * 4, CALM, h), truth_after(truth, h)
    before, pushed = energy(state), momentum(state)
    for _ in range(1000):
        powers.append(4 * FORCE * state.v_quad[2] - state.tension * truth.reel_rate)
        state, truth = advance(state, truth, (FORCE,) * 4, CALM, h), truth_after(truth, h)
    powers.append(4 * FORCE * state.v_quad[2] - state.tension * truth.reel_rate)
    work = h * (sum(powers) - 0.5 * (powers[0] + powers[-1]))
    # the trapezoidal rule over 1 s in 1 ms: h^2 / 12 of the power's slope, some 5 W/s; measured 2e-7
    assert energy(state) - before == pytest.approx(work, abs=1e-6)
    assert abs(work) > 0.1
    # the level vehicle keeps its attitude
    gained = momentum(state) - pushed
    assert gained == pytest.approx([0.0, 0.0, 4 * FORCE - (m_Q + m_L) * g], abs=1e-12)


def test_a_slack_cable_is_reeled_in_until_it_pulls(thesis, aloft):
    """Both fall freely 0.6 m apart; 0.7 m of cable at 0.5 m/s is taut after 0.2 s and pulls with 0.5 m/s."""
    start = aloft(thesis)
    start = start._replace(taut=0.0, x_quad=(0.0, 0.0, start.x_load[2] + 0.6))
    state, truth = start, thesis._replace(reel_rate=-0.5)
    times = []
    for step in range(100):
        state = advance(state, truth, (0.0,) * 4, CALM, STEP)
        truth = truth_after(truth, STEP)
        if state.snap_speed > 0.0:
            times.append((step, state.snap_speed))
    (only,) = times
    assert only == (49, pytest.approx(0.5, abs=1e-9)) or only == (50, pytest.approx(0.5, abs=1e-9))
    assert state.taut == 1.0
    assert state.v_load[2] - state.v_quad[2] == pytest.approx(0.5, abs=1e-9)
    total = thesis.quad_mass * state.v_quad[2] + thesis.load_mass * state.v_load[2]
    assert total == pytest.approx(-(thesis.quad_mass + thesis.load_mass) * thesis.gravity * 0.4, abs=1e-12)


def test_out_faster_than_the_load_falls_the_cable_is_slack(bebop, aloft):
    """At 13 m/s^2 outwards, a hanging load falls freely."""
    truth = bebop._replace(reel_accel=13.0)
    hover = 0.25 * (bebop.quad_mass + bebop.load_mass) * bebop.gravity
    state = advance(aloft(bebop, rotor_force=(hover,) * 4), truth, (hover,) * 4, CALM, STEP)
    assert (state.taut, state.tension, state.slack_events) == (0.0, 0.0, 1.0)


def test_the_drum_obeys_within_its_limits(bebop):
    truth = bebop
    for _ in range(100):
        truth = truth_after(with_commanded_rate(truth, 0.3, STEP), STEP)
        assert abs(truth.reel_accel) <= MAX_ACCEL
    assert truth.reel_rate == pytest.approx(0.3, abs=1e-12)
    assert truth.cable_length == pytest.approx(0.7 + 0.3 * 0.4 - 0.3**2 / (2 * MAX_ACCEL), abs=2e-4)
    for _ in range(50):
        truth = truth_after(with_commanded_rate(truth, 0.0, STEP), STEP)
    assert (truth.reel_rate, truth.reel_accel) == (0.0, 0.0)
    for _ in range(2000):
        truth = truth_after(with_commanded_rate(truth, -math.inf, STEP), STEP)
        assert truth.reel_rate >= -MAX_RATE - 1e-12
    assert truth.cable_length == pytest.approx(MIN_LENGTH, abs=1e-3)
    assert with_commanded_rate(truth, math.nan, STEP).reel_accel == 0.0


def test_a_cable_that_rests_gives_the_same_bits(bebop):
    start = initial_state(bebop)
    assert advance(start, truth_after(bebop, STEP), (1.4,) * 4, WIND, STEP) == advance(
        start, bebop, (1.4,) * 4, WIND, STEP
    )
