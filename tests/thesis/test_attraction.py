"""Domains of attraction: (3-24), (3-25) of the vehicle's attitude, (3-37), (3-38) of the cable's, (3-45) of
the load's position.

Flights that start inside converge, from random starts that cover SO(3) and S^2: uniform directions and
attitudes, upside down among them, and rates up to the bounds. Starts outside are not asserted: the bounds
are sufficient. The motion is (2-30)-(2-35) without rotors, its cable a rod, at 2 kHz; the laws are those that
fly, with the gains of Table 4-3.

In the two attitude modes the feed-forward is exact: that of R_c, which depends on the state, by differences
along the motion itself. In the load position mode it comes from the filters: exact derivatives of q_c cannot
be computed there, because the second one contains the thrust, which contains the second one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from autopilot.control import thesis_cascade as thesis
from autopilot.control.command_filter import filter_start
from autopilot.control.load_attitude import (
    DirectionCommand,
    load_attitude_force,
    normal_force_held,
    normal_force_tracking,
    thrust_along,
)
from autopilot.control.load_position import computed_direction
from autopilot.control.quad_attitude import AttitudeCommand, attitude_from_axes, attitude_moment
from autopilot.control.records import Reference, State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    Mat3,
    Vec3,
    add,
    add3,
    axpy,
    column,
    cross,
    dot,
    mul,
    norm,
    scale,
    sub,
    times,
)
from autopilot.geometry.so3 import exp

BEBOP = Vehicle(0.4, 0.1, 0.7, (2.23e-3, 2.99e-3, 4.8e-3), 9.81, 0.126, 0.016, 0.0, 1.96)
GAINS = thesis.THESIS_GAINS
K_R, K_Q = GAINS.k_R[0], GAINS.k_q
WEIGHT = (BEBOP.quad_mass + BEBOP.load_mass) * BEBOP.gravity
H = 5e-4  # s: 2 % of the fastest time constant, J / k_Omega = 22 ms
HEADING = (1.0, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)


class Motion(NamedTuple):
    """The coordinates of (2-30)-(2-35), the cable's rate as q'."""

    x: Vec3
    v: Vec3
    q: Vec3
    q_dot: Vec3
    R: Mat3
    Omega: Vec3


@kernel
def moved(m: Motion, f: float, M: Vec3, vehicle: Vehicle, h: float) -> Motion:
    """h seconds later under constant thrust and moment: a midpoint step."""
    half = shifted(m, m, f, M, vehicle, 0.5 * h)
    return shifted(m, half, f, M, vehicle, h)


@kernel
def shifted(m: Motion, at: Motion, f: float, M: Vec3, vehicle: Vehicle, h: float) -> Motion:
    """m, h seconds further with the rates that (2-30)-(2-35) give at `at`."""
    J, m_Q_L = vehicle.inertia, vehicle.quad_mass * vehicle.cable_length
    force = scale(f, column(at.R, 2))
    speed2 = dot(at.q_dot, at.q_dot)
    pull = (dot(at.q, force) - m_Q_L * speed2) / (vehicle.quad_mass + vehicle.load_mass)
    a = add(scale(pull, at.q), (0.0, 0.0, -vehicle.gravity))
    q_ddot = axpy(-speed2, at.q, scale(1.0 / m_Q_L, cross(at.q, cross(at.q, force))))
    torque = sub(M, cross(at.Omega, times(J, at.Omega)))
    Omega_dot = (torque[0] / J[0], torque[1] / J[1], torque[2] / J[2])
    q = axpy(h, at.q_dot, m.q)
    q = scale(1.0 / norm(q), q)
    q_dot = axpy(h, q_ddot, m.q_dot)
    return Motion(
        axpy(h, at.v, m.x),
        axpy(h, a, m.v),
        q,
        axpy(-dot(q, q_dot), q, q_dot),
        mul(m.R, exp(scale(h, at.Omega))),
        axpy(h, Omega_dot, m.Omega),
    )


# --- vehicle attitude


@kernel
def attitude_flight(m: Motion, R_d: Mat3, Omega_d: Vec3, vehicle: Vehicle, out: NDArray[np.float64]) -> None:
    """Psi_R of each step; R_d turns at the constant body rate Omega_d. The thrust is the weight."""
    for k in range(out.shape[0]):
        command = AttitudeCommand(R_d, Omega_d, ZERO)
        result = attitude_moment(
            m.R, m.Omega, command, GAINS.k_R, GAINS.k_Omega, GAINS.epsilon, vehicle.inertia
        )
        out[k] = result.psi_R
        m = moved(m, WEIGHT, result.moment, vehicle, H)
        R_d = mul(R_d, exp(scale(H, Omega_d)))


# --- load attitude


@kernel
def direction_at(q_0: Vec3, turn: float, t: float) -> DirectionCommand:
    """A direction on a cone about the vertical, turning at `turn` rad/s, with its derivatives."""
    W = (0.0, 0.0, turn)
    angle = exp((0.0, 0.0, turn * t))
    q = (dot(angle[0], q_0), dot(angle[1], q_0), q_0[2])
    q_dot = cross(W, q)
    return DirectionCommand(q, q_dot, cross(W, q_dot))


@kernel
def commanded_force(m: Motion, q_0: Vec3, turn: float, t: float, vehicle: Vehicle) -> Vec3:
    """F of (3-31)."""
    command = direction_at(q_0, turn, t)
    return load_attitude_force(
        m.q,
        m.q_dot,
        command,
        normal_force_held(m.q, command.q_c, WEIGHT),
        GAINS.k_q,
        GAINS.k_omega,
        vehicle.quad_mass,
        vehicle.cable_length,
    ).F


@kernel
def along(m: Motion, q_0: Vec3, turn: float, t: float, vehicle: Vehicle, h: float) -> Vec3:
    """F h seconds later on the motion under f of (3-35). M does not reach F within two derivatives."""
    f = thrust_along(commanded_force(m, q_0, turn, t, vehicle), m.R)
    half = shifted(m, m, f, ZERO, vehicle, 0.5 * h)
    f = thrust_along(commanded_force(half, q_0, turn, t + 0.5 * h, vehicle), half.R)
    return commanded_force(shifted(m, half, f, ZERO, vehicle, h), q_0, turn, t + h, vehicle)


@kernel
def exact_attitude(m: Motion, q_0: Vec3, turn: float, t: float, vehicle: Vehicle) -> AttitudeCommand:
    """R_c of (3-27) with Omega_c, Omega_c' from F', F'' along the motion, by central differences."""
    h = 1e-4
    F = commanded_force(m, q_0, turn, t, vehicle)
    later = along(m, q_0, turn, t, vehicle, h)
    before = along(m, q_0, turn, t, vehicle, -h)
    F_dot = scale(0.5 / h, sub(later, before))
    F_ddot = scale(1.0 / (h * h), add3(later, before, scale(-2.0, F)))
    return attitude_from_axes(F, F_dot, F_ddot, HEADING, ZERO, ZERO)


@kernel
def cable_flight(m: Motion, q_0: Vec3, turn: float, vehicle: Vehicle, out: NDArray[np.float64]) -> None:
    """Psi_q and Psi_R of each step."""
    for k in range(out.shape[0]):
        t = k * H
        F = commanded_force(m, q_0, turn, t, vehicle)
        command = exact_attitude(m, q_0, turn, t, vehicle)
        result = attitude_moment(
            m.R, m.Omega, command, GAINS.k_R, GAINS.k_Omega, GAINS.epsilon, vehicle.inertia
        )
        out[k, 0] = 1.0 - dot(m.q, direction_at(q_0, turn, t).q_c)
        out[k, 1] = result.psi_R
        m = moved(m, thrust_along(F, m.R), result.moment, vehicle, H)


# --- load position


@kernel
def position_flight(
    m: Motion,
    memory: thesis.ThesisMemory,
    filters: thesis.ThesisFilters,
    vehicle: Vehicle,
    out: NDArray[np.float64],
) -> None:
    """|e_x| of each step, with the load sent to the origin by the cascade that flies, including its
    filters."""
    L = vehicle.cable_length
    reference = Reference((ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), HEADING)
    for k in range(out.shape[0]):
        state = State(m.x, m.v, m.q, m.q_dot, axpy(-L, m.q, m.x), axpy(-L, m.q_dot, m.v), m.R, m.Omega)
        memory, command = thesis.load_position(memory, state, reference, GAINS, filters, vehicle)
        out[k] = norm(command.e_x)
        m = moved(m, command.thrust, command.moment, vehicle, H)


# --- random starts


def vec(a: NDArray[np.float64]) -> Vec3:
    return (float(a[0]), float(a[1]), float(a[2]))


def mat(A: NDArray[np.float64]) -> Mat3:
    return (vec(A[0]), vec(A[1]), vec(A[2]))


def random_direction(rng: np.random.Generator) -> NDArray[np.float64]:
    """Uniform on S^2."""
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def across(rng: np.random.Generator, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """A unit vector normal to q, uniform."""
    v = np.cross(q, rng.normal(size=3))
    return np.asarray(v / np.linalg.norm(v))


def random_rotation(rng: np.random.Generator) -> NDArray[np.float64]:
    """Uniform on SO(3): QR of a Gaussian matrix with the signs of the diagonal taken out."""
    Q, T = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(T))
    return Q if np.linalg.det(Q) > 0.0 else -Q


def psi_attitude(R: NDArray[np.float64], R_c: NDArray[np.float64]) -> float:
    """(3-1)."""
    return float(0.5 * np.trace(np.eye(3) - R_c.T @ R))


def rate_within_3_25(rng: np.random.Generator, psi: float) -> NDArray[np.float64]:
    """A random e_Omega (rad/s) inside (3-25)."""
    bound = 2.0 / max(BEBOP.inertia) * K_R / GAINS.epsilon**2 * (2.0 - psi)
    return random_direction(rng) * np.sqrt(bound * rng.uniform())


def cable_rate(
    rng: np.random.Generator, q: NDArray[np.float64], gain: float, room: float
) -> NDArray[np.float64]:
    """A random e_q' (1/s) with |e_q'|^2 < 2 / (m_Q L) * gain * room."""
    bound = 2.0 / (BEBOP.quad_mass * BEBOP.cable_length) * gain * room
    return across(rng, q) * np.sqrt(bound * rng.uniform())


def cable_start(rng: np.random.Generator) -> tuple[Motion, Vec3, float, float, float]:
    """A start inside (3-24), (3-25), (3-37), (3-38) as printed: motion, direction to follow, its rate of
    turn, Psi_q, Psi_R."""
    q, q_0, turn = random_direction(rng), random_direction(rng), float(rng.uniform(-1.0, 1.0))
    command = direction_at(vec(q_0), turn, 0.0)
    psi_q = float(1.0 - q @ q_0)
    e_q_dot = cable_rate(rng, q, K_R, 2.0 - psi_q)
    q_dot = e_q_dot + np.cross(np.cross(command.q_c, command.q_c_dot), q)
    R = random_rotation(rng)
    still = Motion(ZERO, ZERO, vec(q), vec(q_dot), mat(R), ZERO)

    def Omega_c_body(Omega: NDArray[np.float64]) -> NDArray[np.float64]:
        turning = exact_attitude(still._replace(Omega=vec(Omega)), vec(q_0), turn, 0.0, BEBOP)
        return np.asarray(R.T @ np.array(turning.R_c) @ np.array(turning.Omega_c))

    R_c = np.array(exact_attitude(still, vec(q_0), turn, 0.0, BEBOP).R_c)
    psi_R = psi_attitude(R, R_c)
    # F' does not contain Omega, so Omega = e_Omega + R^T R_c Omega_c needs no iteration
    Omega = rate_within_3_25(rng, psi_R) + Omega_c_body(np.zeros(3))
    np.testing.assert_allclose(Omega_c_body(Omega), Omega_c_body(np.zeros(3)), atol=OMEGA_C)
    return still._replace(Omega=vec(Omega)), vec(q_0), turn, psi_q, psi_R


# each with its reason
ARRIVED = 1e-6  # Psi: 3 s are 27 of the slowest time constants of the attitude, 6 s are 10 of the cable
OMEGA_C = 1e-4  # rad/s: differences of F over 0.1 ms
# of Psi: 172 deg. Of the starts nearer to the opposite pole one in ten is lost: the vehicle is upside down
# for so long that F may vanish on the way, and with it R_c (3-30)
ALMOST = 1.99
# The constants of (3-45), (3-46) depend on the design, according to the thesis. These are those of the
# cascade with its filters, whose derivatives come 80 ms late: 8 deg of cable, 0.1 m, and for the vehicle,
# which does not turn, 60 deg. At twice this Psi_q one flight in ten is lost, at 20 deg of cable nearly all.
PSI_1, E_X_MAX, ATTITUDE_MAX = 0.01, 0.1, np.radians(60.0)
NEAR_HOME = 1e-4  # m, after 6 s at 2 /s


@pytest.mark.parametrize("seed", range(4))
def test_vehicle_attitude_converges_within_3_24_and_3_25(seed: int) -> None:
    rng, psi_first, upside_down = np.random.default_rng([1, seed]), [], 0
    for _ in range(50):
        R, R_d, Omega_d = random_rotation(rng), random_rotation(rng), rng.normal(size=3)
        psi_first.append(psi_attitude(R, R_d))
        Omega = rate_within_3_25(rng, psi_first[-1]) + R.T @ R_d @ Omega_d
        start = Motion(ZERO, ZERO, (0.0, 0.0, -1.0), ZERO, mat(R), vec(Omega))
        psi = np.zeros(6000)
        attitude_flight(start, mat(R_d), vec(Omega_d), BEBOP, psi)
        upside_down += int(R[2, 2] < 0.0)
        assert psi.max() < 2.0
        assert psi[-1] < ARRIVED
    # the starts cover the stated set
    assert upside_down > 10
    assert min(psi_first) < 0.8
    assert max(psi_first) > 1.9


@pytest.mark.parametrize("seed", range(4))
def test_load_attitude_converges_within_3_37_and_3_38(seed: int) -> None:
    rng, psi_first = np.random.default_rng([2, seed]), []
    for _ in range(25):
        start, q_0, turn, psi_q, psi_R = cable_start(rng)
        if max(psi_q, psi_R) > ALMOST:
            continue
        psi_first.append((psi_q, psi_R))
        psi = np.zeros((12000, 2))
        cable_flight(start, q_0, turn, BEBOP, psi)
        assert psi[:, 0].max() < 2.0
        assert psi[-1, 0] < ARRIVED, (psi_q, psi_R)
        assert psi[-1, 1] < ARRIVED, (psi_q, psi_R)
    assert len(psi_first) >= 20
    assert np.max(psi_first, axis=0).min() > 1.7


def test_load_position_converges_within_3_45() -> None:
    rng, filters = np.random.default_rng(3), thesis.thesis_filters(H)
    for _ in range(60):
        e_x = random_direction(rng) * E_X_MAX * rng.uniform() ** (1.0 / 3.0)
        A = np.array([0.0, 0.0, WEIGHT]) - GAINS.k_x[0] * e_x
        q_c = np.array(computed_direction(vec(A)))
        angle = float(np.arccos(1.0 - PSI_1 * rng.uniform()))
        q = np.array(exp(vec(angle * across(rng, q_c)))) @ q_c
        q_dot = cable_rate(rng, q, K_Q, PSI_1 - float(1.0 - q @ q_c))
        command = DirectionCommand(vec(q_c), ZERO, ZERO)
        F = load_attitude_force(
            vec(q),
            vec(q_dot),
            command,
            normal_force_tracking(vec(q), vec(A)),
            GAINS.k_q,
            GAINS.k_omega,
            BEBOP.quad_mass,
            BEBOP.cable_length,
        ).F
        level: Mat3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        R_c = np.array(thesis.attitude_towards(F, HEADING, level))
        R = R_c @ np.array(exp(vec(ATTITUDE_MAX * rng.uniform() * random_direction(rng))))
        # the filters begin at the commands, at rest
        memory = thesis.ThesisMemory(
            filter_start(ZERO, ZERO),
            filter_start(vec(q_c), ZERO),
            filter_start(vec(R_c[:, 0]), ZERO),
            filter_start(vec(R_c[:, 1]), ZERO),
            filter_start(vec(R_c[:, 2]), ZERO),
        )
        errors = np.zeros(12000)
        start = Motion(vec(e_x), ZERO, vec(q), vec(q_dot), mat(R), ZERO)
        position_flight(start, memory, filters, BEBOP, errors)
        assert errors[-1] < NEAR_HOME
