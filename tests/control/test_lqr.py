"""The regulator of A-2: its linear model against the plant, its gain against the printed one, and its
flights.
"""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from autopilot.control import lqr
from autopilot.control.linear_model import PHI_L, THETA_L, second_order, state_space
from autopilot.control.records import Reference, State, Vehicle
from autopilot.geometry.linear import ZERO
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.trajectory.signals import evaluate, signal_table
from gcs.analysis.step import Step, step_response
from missions.fileformat import load_mission
from missions.model import Signals
from sitl.plant.by_value import advance, initial_state
from sitl.plant.records import PlantState, Truth
from sitl.vehicles.truth import load_truth
from tests.control.plain_laws import plain_laws, text_of
from tests.doubles.mixing import mix

Array = NDArray[np.float64]
PRINTED = np.array(json.loads((Path(__file__).parent / "printed_gains.json").read_text())["K"])
POSITIONS, SWING = [0, 1, 2], [PHI_L, THETA_L, 8 + PHI_L, 8 + THETA_L]
ROLL, PITCH = [1, 3, 6, 9, 11, 14], [0, 4, 7, 8, 12, 15]  # the states of the two lateral motions
EAST = (1.0, 0.0, 0.0)
CALM = ZERO

STEP, STEPS, NUDGE = 0.004, 10, 1e-5
# differences of the flown plant: rounding 1e-13 / NUDGE, curvature NUDGE^2, the integrator's own error
LINEAR = 2e-6
PRINT = 0.5e-4  # half a unit of the last printed decimal
ROUNDING = 1e-12  # of numbers up to a hundred, a few dozen operations


# ---- a second, independent conversion from coordinates to the motion


def motion_of(x: Array) -> tuple[Array, Array, Array, Array, Array, Array, Rotation, Array]:
    """x_Q, v_Q, x_L, v_L, q, q', R, Omega of the state (4-6), by SciPy's rotations."""
    roll, pitch, yaw = x[3:6]
    R = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    by_axis = Rotation.from_euler("ZY", [yaw, pitch])
    # each rate turns about its own axis: yaw about e3, pitch about the turned e2, roll about the body's e1
    turn = (
        x[13] * np.array([0.0, 0.0, 1.0])
        + x[12] * Rotation.from_euler("Z", yaw).apply([0.0, 1.0, 0.0])
        + x[11] * by_axis.apply([1.0, 0.0, 0.0])
    )
    along = np.array([np.tan(x[7]), np.tan(x[6]), -1.0])
    along_dot = np.array([x[15] / np.cos(x[7]) ** 2, x[14] / np.cos(x[6]) ** 2, 0.0])
    n = np.linalg.norm(along)
    q = along / n
    q_dot = (along_dot - q * (q @ along_dot)) / n
    return x[:3], x[8:11], x[:3] + 0.7 * q, x[8:11] + 0.7 * q_dot, q, q_dot, R, R.inv().apply(turn)


def told(x: Array, model: SimpleNamespace) -> State:
    x_Q, v_Q, x_L, v_L, q, q_dot, R, Omega = motion_of(x)
    vec = model.vec
    return State(
        vec(x_L), vec(v_L), vec(q), vec(q_dot), vec(x_Q), vec(v_Q), model.mat(R.as_matrix()), vec(Omega)
    )


def aloft(x: Array, truth: Truth, model: SimpleNamespace) -> PlantState:
    x_Q, v_Q, x_L, v_L, q, q_dot, R, Omega = motion_of(x)
    vec = model.vec
    quat = R.as_quat()
    return initial_state(truth)._replace(
        x_load=vec(x_L),
        v_load=vec(v_L),
        q_cable=vec(q),
        q_cable_dot=vec(q_dot),
        x_quad=vec(x_Q),
        v_quad=vec(v_Q),
        quat_wxyz=(float(quat[3]), *vec(quat[:3])),
        omega_body=vec(Omega),
        taut=1.0,
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
    )


def sensed(state: PlantState) -> State:
    return State(
        state.x_load,
        state.v_load,
        state.q_cable,
        state.q_cable_dot,
        state.x_quad,
        state.v_quad,
        rotation_from_quat(state.quat_wxyz),
        state.omega_body,
    )


def coordinates(state: State) -> Array:
    return np.array(lqr.state_error(state, CALM, EAST, 0.0))


def still(x_d: tuple[float, float, float], heading: tuple[float, float, float] = EAST) -> Reference:
    return Reference((x_d, CALM, CALM, CALM, CALM, CALM, CALM), heading)


@pytest.fixture(scope="module")
def regulator(bebop: Vehicle) -> lqr.Lqr:
    return lqr.lqr(bebop)


@pytest.fixture(scope="module")
def truth() -> Truth:
    return load_truth("thesis")


# ---- the linear model


def test_the_model_is_the_plant_near_hover(bebop: Vehicle, truth: Truth, model: SimpleNamespace) -> None:
    """Forty milliseconds of the plant, differentiated by every state and input, are expm of A and B."""
    hover = np.zeros(16)
    hover[2] = 50.0

    def flown(x: Array, du: Array) -> Array:
        state = aloft(hover + x, truth, model)
        thrust = (bebop.quad_mass + bebop.load_mass) * bebop.gravity + du[0]
        forces = mix(float(thrust), model.vec(du[1:]), bebop, 0.0).forces
        for _ in range(STEPS):
            state = advance(state, truth, forces, CALM, STEP)
        assert state.taut == 1.0
        return coordinates(sensed(state))

    nudges = NUDGE * np.eye(20)
    columns = [(flown(d[:16], d[16:]) - flown(-d[:16], -d[16:])) / (2.0 * NUDGE) for d in nudges]
    A, B = state_space(bebop)
    both = np.zeros((20, 20))
    both[:16, :16], both[:16, 16:] = A, B
    # inputs are divided by the mass or inertia that they accelerate, to be of the size of the states
    size = np.concatenate([np.ones(16), [bebop.quad_mass + bebop.load_mass, *bebop.inertia]])
    expected = expm(both * STEP * STEPS)[:16]
    np.testing.assert_allclose(np.array(columns).T * size, expected * size, atol=LINEAR)


def test_the_model_is_what_the_equations_say(bebop: Vehicle) -> None:
    """(2-31), (2-33) and (2-35) for small angles, row by row."""
    A, B = state_space(bebop)
    m_Q, m_L, L, g = bebop.quad_mass, bebop.load_mass, bebop.cable_length, bebop.gravity
    lift, pull, swing = (m_Q + m_L) * g / m_Q, m_L * g / m_Q, (m_Q + m_L) * g / (m_Q * L)
    expected = np.zeros((8, 8))
    expected[0, [4, 7]] = lift, pull
    expected[1, [3, 6]] = -lift, pull
    expected[6, [3, 6]] = swing, -swing
    expected[7, [4, 7]] = -swing, -swing
    np.testing.assert_allclose(A[8:, :8], expected, atol=ROUNDING)
    np.testing.assert_array_equal(A[:8], np.hstack([np.zeros((8, 8)), np.eye(8)]))
    np.testing.assert_array_equal(A[8:, 8:], 0.0)
    inputs = np.zeros((8, 4))
    inputs[2, 0] = 1.0 / (m_Q + m_L)
    inputs[[3, 4, 5], [1, 2, 3]] = 1.0 / np.array(bebop.inertia)
    np.testing.assert_allclose(B[8:], inputs, atol=ROUNDING)


def test_the_matrices_are_those_of_a_5(bebop: Vehicle) -> None:
    """M1 x'' + M2 x = M3 u, with a mass matrix that is symmetric and positive, and with I_L and m_T in their
    places."""
    M1, M2, M3 = second_order(bebop)
    A, B = state_space(bebop)
    np.testing.assert_allclose(M1 @ A[8:, :8], -M2, atol=ROUNDING)
    np.testing.assert_allclose(M1 @ B[8:], M3, atol=ROUNDING)
    np.testing.assert_array_equal(M1, M1.T)
    assert np.linalg.eigvalsh(M1).min() > 0.0
    m_T, I_L = bebop.quad_mass + bebop.load_mass, bebop.load_mass * bebop.cable_length**2
    np.testing.assert_allclose(np.diag(M1), [m_T, m_T, m_T, *bebop.inertia, I_L, I_L])


# ---- the gain


def test_what_agrees_with_the_printed_gain(regulator: lqr.Lqr) -> None:
    """Thrust and yaw rows to all four decimals, the position gains, and the sign of every entry."""
    K = np.array(regulator.K)
    np.testing.assert_allclose(K[[0, 3]], PRINTED[[0, 3]], atol=PRINT)
    np.testing.assert_allclose(K[:, POSITIONS], PRINTED[:, POSITIONS], atol=PRINT)
    np.testing.assert_array_equal(np.sign(np.where(np.abs(K) < PRINT, 0.0, K)), np.sign(PRINTED))


def test_the_printed_roll_and_pitch_rows_are_of_another_model(bebop: Vehicle, regulator: lqr.Lqr) -> None:
    """With them the true linear model is unstable, whatever the signs of the cable's angles."""
    A, B = state_space(bebop)
    assert np.linalg.eigvals(A - B @ np.array(regulator.K)).real.max() < -1.2
    for phi_L, theta_L in product((1.0, -1.0), repeat=2):
        K = PRINTED.copy()
        K[:, SWING] *= [phi_L, theta_L, phi_L, theta_L]
        closed = A - B @ K
        assert np.linalg.eigvals(closed[np.ix_(ROLL, ROLL)]).real.max() > 0.5
        if theta_L < 0.0:
            assert np.linalg.eigvals(closed[np.ix_(PITCH, PITCH)]).real.max() > 0.5


# ---- the law


def test_the_angles_are_those_of_r_and_q(model: SimpleNamespace) -> None:
    rng = np.random.default_rng(11)
    for _ in range(50):
        x = rng.uniform(-1.2, 1.2, size=16)
        np.testing.assert_allclose(coordinates(told(x, model)), x, atol=1e2 * ROUNDING)


def test_the_command_is_the_gain_times_the_error(
    model: SimpleNamespace, bebop: Vehicle, regulator: lqr.Lqr
) -> None:
    """u = u0 - K (x - x_ref), about a reference one cable length above the load's."""
    rng = np.random.default_rng(12)
    for _ in range(20):
        x, x_d = rng.uniform(-1.0, 1.0, size=16), rng.normal(size=3)
        state = told(x, model)
        command = lqr.load_position(state, still(model.vec(x_d)), regulator)
        error = x.copy()
        error[:3] -= x_d
        error[2] -= bebop.cable_length
        hover = [(bebop.quad_mass + bebop.load_mass) * bebop.gravity, 0.0, 0.0, 0.0]
        expected = hover - np.array(regulator.K) @ error
        np.testing.assert_allclose([command.thrust, *command.moment], expected, atol=1e3 * ROUNDING)
        np.testing.assert_allclose(command.e_x, np.array(state.x_load) - x_d, atol=ROUNDING)
        np.testing.assert_allclose(command.psi_q, 1.0 + state.q_cable[2], atol=ROUNDING)
        np.testing.assert_allclose(command.psi_R, 0.5 * (3.0 - np.trace(np.array(state.R))), atol=ROUNDING)


def test_no_direction_of_the_compass_is_special(model: SimpleNamespace, regulator: lqr.Lqr) -> None:
    """The whole situation rotated about the vertical gives the same thrust and moment."""
    rng = np.random.default_rng(13)
    for angle in rng.uniform(-np.pi, np.pi, size=10):
        H = Rotation.from_euler("z", angle).as_matrix()
        x, x_d = rng.uniform(-1.0, 1.0, size=16), rng.normal(size=3)
        state = told(x, model)
        turned = State(*(model.vec(H @ v) for v in state[:6]), model.mat(H @ state.R), state.omega_body)
        one = lqr.load_position(state, still(model.vec(x_d)), regulator)
        two = lqr.load_position(turned, still(model.vec(H @ x_d), model.vec(H[:, 0])), regulator)
        np.testing.assert_allclose([two.thrust, *two.moment], [one.thrust, *one.moment], atol=1e3 * ROUNDING)


@pytest.mark.parametrize("turn", [(0.0, 90.0, 0.0), (0.0, -90.0, 0.0), (180.0, 0.0, 0.0), (90.0, 0.0, 30.0)])
def test_no_attitude_gives_a_command_that_is_no_number(
    turn: tuple[float, float, float], model: SimpleNamespace, regulator: lqr.Lqr
) -> None:
    R = model.mat(Rotation.from_euler("xyz", turn, degrees=True).as_matrix())
    for q in ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)):
        state = State(CALM, CALM, q, (0.0, 0.3, 0.1), CALM, CALM, R, (1.0, 2.0, 3.0))
        for heading in (EAST, (0.0, 0.0, 1.0)):
            command = lqr.load_position(state, still(CALM, heading), regulator)
            assert np.isfinite([command.thrust, *command.moment]).all()


def test_compiled_and_plain_agree_to_the_bit(model: SimpleNamespace, regulator: lqr.Lqr) -> None:
    plain = plain_laws({lqr.__name__: text_of(lqr.__name__)})
    rng = np.random.default_rng(14)
    for _ in range(20):
        state, reference = told(rng.uniform(-1.2, 1.2, size=16), model), still(model.vec(rng.normal(size=3)))
        one = lqr.load_position(state, reference, regulator)
        assert repr(plain.load_position(state, reference, regulator)) == repr(one)


def test_other_laws_do_not_pay_for_the_solver() -> None:
    check = "import sys, autopilot.control.laws.interface; sys.exit('control' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0


# ---- flights


def load_flown(
    mission: str, model: SimpleNamespace, truth: Truth, vehicle: Vehicle, regulator: lqr.Lqr
) -> tuple[Array, Array, Array]:
    """(n,) s, (n, 3) m desired and (n, 3) m flown load path of a shipped mission's signals, from rest in the
    air, with the state known and the rotors without limits."""
    signals = next(s for s in load_mission(mission).steps if isinstance(s, Signals))
    table = signal_table(signals.terms)
    start = np.zeros(16)
    start[2] = 10.0 + vehicle.cable_length
    state = aloft(start, truth, model)
    times = np.arange(round(signals.duration_s / STEP)) * STEP
    desired, flown = np.zeros((len(times), 3)), np.zeros((len(times), 3))
    for k, t in enumerate(times):
        x, *rest = evaluate(table, float(t))
        reference = Reference(((x[0], x[1], x[2] + 10.0), *rest), EAST)
        command = lqr.load_position(sensed(state), reference, regulator)
        desired[k], flown[k] = reference.jet[0], state.x_load
        forces = mix(command.thrust, command.moment, vehicle, 0.0).forces
        state = advance(state, truth, forces, CALM, STEP)
        assert state.taut == 1.0
    return times, desired, flown


def test_case_a_overshoots_as_printed(
    model: SimpleNamespace, truth: Truth, bebop: Vehicle, regulator: lqr.Lqr
) -> None:
    times, _, flown = load_flown("case-a", model, truth, bebop, regulator)
    step = Step(0.0, 0.25, np.array([0.0, 0.0, 10.0]), np.array([0.0, 1.0, 0.0]))
    response = step_response(step, times, flown)
    assert response.overshoot_pct == pytest.approx(23.0, abs=3.0)  # 4-4: approximately 23 %


def test_case_b_errs_as_printed(
    model: SimpleNamespace, truth: Truth, bebop: Vehicle, regulator: lqr.Lqr
) -> None:
    _, desired, flown = load_flown("case-b", model, truth, bebop, regulator)
    worst = np.linalg.norm(flown - desired, axis=1).max()
    assert worst == pytest.approx(1.1, abs=0.15)  # 4-4: up to 1.1 m
