"""Proofs of the laws.

Each proof takes the laws as a namespace of functions and checks them against identities derived from
(2-30)-(2-36) with the independent model, by differences in time, or against published numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, sin
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.linalg import expm

from autopilot.control.records import Reference, Vehicle
from tests.control.closeness import EXACT, close
from tests.control.mixer_proofs import MIXER_PROOFS
from tests.control.model import cross

# each with its reason
DIFFERENCE = (
    2e-6  # central differences with step 1e-4 on motions of a few rad/s: h^2/6 times a third derivative
)
STEP = 1e-4
FILTERED = 1e-10  # two ways to the exponential of the filter, times omega_n^2
PRINTED = 5e-7  # the oracle's moments are printed with six or more decimals
FDCL_THRUST = 5e-5  # printed with four decimals

E1 = np.array([1.0, 0.0, 0.0])
E3 = np.array([0.0, 0.0, 1.0])


def motions(seed: int) -> Iterator[np.random.Generator]:
    for i in range(3):
        yield np.random.default_rng([seed, i])


# --- vehicle attitude


def attitude_error_obeys_3_22(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """With M of (3-36) applied to (2-35), J e_Omega' = -k_R e_R/eps^2 - k_Omega e_Omega/eps for any moving
    R_c."""
    J = np.array(vehicle.inertia)
    for rng in motions(1):
        R, R_c = model.random_rotation(rng), model.random_rotation(rng)
        W, W_c, W_c_dot = rng.normal(size=(3, 3)) * 2.0
        k_R, k_Omega, eps = rng.uniform(0.01, 0.05, 3), rng.uniform(0.01, 0.05, 3), 0.7
        command = laws.AttitudeCommand(model.mat(R_c), model.vec(W_c), model.vec(W_c_dot))
        result = laws.attitude_moment(
            model.mat(R), model.vec(W), command, model.vec(k_R), model.vec(k_Omega), eps, vehicle.inertia
        )
        W_dot = (np.array(result.moment) - cross(W, J * W)) / J

        def e_Omega(t: float, R=R, R_c=R_c, W=W, W_c=W_c, W_dot=W_dot, W_c_dot=W_c_dot) -> np.ndarray:
            Rt = R @ model.rodrigues(t * W + t * t / 2 * W_dot)
            Rct = R_c @ model.rodrigues(t * W_c + t * t / 2 * W_c_dot)
            return (W + t * W_dot) - Rt.T @ Rct @ (W_c + t * W_c_dot)

        S = R_c.T @ R - R.T @ R_c
        e_R = 0.5 * np.array([S[2, 1], S[0, 2], S[1, 0]])
        e_Omega_dot = (e_Omega(STEP) - e_Omega(-STEP)) / (2 * STEP)
        close(result.e_R, e_R, EXACT)
        close(result.e_Omega, e_Omega(0.0), EXACT)
        close(result.psi_R, 0.5 * np.trace(np.eye(3) - R_c.T @ R), EXACT)
        close(J * e_Omega_dot, -k_R * e_R / eps**2 - k_Omega * e_Omega(0.0) / eps, DIFFERENCE)


def commanded_frame_is_differentiated(
    laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle
) -> None:
    """R_c, Omega_c, Omega_c' of (3-27), (3-28), (3-18) against differences of an array computation."""
    for rng in motions(2):
        c3 = rng.normal(size=(3, 3)) * np.array([[1.0], [0.8], [0.8]]) + np.array(
            [[0, 0, 3], [0] * 3, [0] * 3]
        )
        c1 = rng.normal(size=(3, 3)) * np.array([[0.3], [0.8], [0.8]]) + np.array(
            [[2, 0, 0], [0] * 3, [0] * 3]
        )

        def frame(t: float, c3=c3, c1=c1) -> np.ndarray:
            b3 = model.unit(c3[0] + t * c3[1] + t * t / 2 * c3[2])
            b1 = c1[0] + t * c1[1] + t * t / 2 * c1[2]
            b1 = model.unit(b1 - (b1 @ b3) * b3)
            return np.column_stack([b1, cross(b3, b1), b3])

        def omega(t: float, frame=frame) -> np.ndarray:
            S = frame(t).T @ (frame(t + STEP) - frame(t - STEP)) / (2 * STEP)
            return 0.5 * np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])

        command = laws.attitude_from_axes(*(model.vec(v) for v in (*c3, *c1)))
        close(command.R_c, frame(0.0), EXACT)
        close(command.Omega_c, omega(0.0), DIFFERENCE)
        close(command.Omega_c_dot, (omega(STEP) - omega(-STEP)) / (2 * STEP), DIFFERENCE)


def columns_turn_with_the_body(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    for rng in motions(3):
        R, W = model.random_rotation(rng), rng.normal(size=3)
        R_dot = R @ model.hat(W)
        close(laws.column_rates(model.mat(R), model.vec(W)), R_dot.T, EXACT)


def rates_of_a_rotation_are_3_28(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """W and W' are recovered from R' = R hat(W) and R'' = R hat(W)^2 + R hat(W') of a turning rotation."""
    for rng in motions(9):
        R, (W, W_dot) = model.random_rotation(rng), rng.normal(size=(2, 3)) * 3.0
        R_dot = R @ model.hat(W)
        R_ddot = R_dot @ model.hat(W) + R @ model.hat(W_dot)
        command = laws.attitude_from_rates(*(model.mat(A) for A in (R, R_dot, R_ddot)))
        close(command.R_c, R, EXACT)
        close(command.Omega_c, W, EXACT)
        close(command.Omega_c_dot, W_dot, EXACT)


def filters_feed_rates_but_not_the_attitude(
    laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle
) -> None:
    """e_R is that of the commanded attitude, Omega_c and Omega_c' are those of an array filter of the
    elements of R_c, stepped by SciPy's matrix exponential."""
    omega_n, zeta, dt = 30.0, 0.98, 0.004
    filters, gains = laws.thesis_filters(dt), laws.THESIS_GAINS
    J, zero = np.array(vehicle.inertia), (0.0, 0.0, 0.0)
    A = np.array([[0.0, 1.0, 0.0], [-(omega_n**2), -2.0 * zeta * omega_n, omega_n**2], [0.0, 0.0, 0.0]])
    # the command changes linearly: it is a third state, and its slope a fourth
    A = np.block([[A, np.array([[0.0], [0.0], [1.0]])], [np.zeros((1, 4))]])
    E = expm(A * dt)
    for rng in motions(10):
        R, W = model.random_rotation(rng), rng.normal(size=3)
        turn = rng.normal(size=3)
        state = model.state_of(model.pack(zero, zero, -E3, zero, R, W), vehicle)
        memory = laws.start(state, zero, zero)
        x1, x2, u = R, R @ model.hat(W), R
        for k in range(1, 4):
            R_c = R @ model.rodrigues(0.3 * k * turn)
            slope = (R_c - u) / dt
            x1, x2 = (sum(E[i, j] * p for j, p in enumerate((x1, x2, u, slope))) for i in (0, 1))
            u = R_c
            memory, command = laws.quad_attitude(memory, state, model.mat(R_c), 5.0, gains, filters, vehicle)
        x3 = -2.0 * zeta * omega_n * x2 - omega_n**2 * (x1 - u)

        def skew(S: np.ndarray) -> np.ndarray:
            return 0.5 * np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])

        e_R = skew(R_c.T @ R)
        W_c, W_c_dot = R.T @ R_c @ skew(R_c.T @ x2), R.T @ R_c @ skew(R_c.T @ x3)
        e_Omega = W - W_c
        moment = -0.9 * e_R - 0.1 * e_Omega + cross(W, J * W) - J * (cross(W, W_c) - W_c_dot)
        close(command.R_c, R_c, EXACT)
        close(command.e_R, e_R, EXACT)
        close(command.e_Omega, e_Omega, FILTERED)
        close(command.moment, moment, FILTERED)


def computed_attitude_points_as_3_27(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """The result is a rotation with its thrust axis along F and its nose in the half plane of the heading;
    also at 90 deg of pitch."""
    for rng in motions(4):
        F, angle = rng.normal(size=3), rng.uniform(0, 6.0)
        b1_d = np.array([cos(angle), sin(angle), 0.0])
        R_c = np.array(laws.attitude_towards(model.vec(F), model.vec(b1_d), model.mat(np.eye(3))))
        close(R_c.T @ R_c, np.eye(3), EXACT)
        close(np.linalg.det(R_c), 1.0, EXACT)
        close(R_c[:, 2], model.unit(F), EXACT)
        assert R_c[:, 0] @ b1_d > 0.0
        close(R_c[:, 1] @ b1_d, 0.0, EXACT)
    for way in (1.0, -1.0):
        # a nose that dips through the singular pitch keeps its left wing: the limit of (3-29) on both sides
        near = laws.heading_axis(model.vec(model.unit([way, 0.0, 2e-3])), model.vec(E1))
        at = laws.heading_axis(model.vec(way * E1), model.vec(E1))
        close(at, near, 3e-3)


def published_se3_numbers(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """Thrust and moment of the tracking law on SE(3), fdcl-gwu/uav_geometric_control test_controller.cpp, in
    the form of the feed-forward that the thesis uses. There e3 points down; the numbers are rotated by half a
    turn about x."""
    flip = np.diag([1.0, -1.0, -1.0])
    m, g, k_x, k_v, s = 1.95, 9.81, 10.0, 8.0, 0.707106781186548
    J = np.array([0.02, 0.02, 0.04])
    x = v = np.array([0.0, 1.0, 2.2])
    jet = np.array([[-1, 0, 0], [0, -2, 0], [0, 0, -5], [0, 1.2, 0], [2.1, 0, 0]], float)
    R = np.diag([-1.0, -1.0, 1.0])
    b1 = np.array([[s, s, 0], [0, s, s], [s, 0, s]])
    # A is the wanted force, f = -A . R e3 the thrust; A' and A'' along the motion
    A = -k_x * (x - jet[0]) - k_v * (v - jet[1]) - m * g * E3 + m * jet[2]
    f = -A @ R[:, 2]
    a = g * E3 - f / m * R[:, 2]
    A_dot = -k_x * (v - jet[1]) - k_v * (a - jet[2]) + m * jet[3]
    f_dot = -A_dot @ R[:, 2]  # Omega = 0, so R' = 0
    a_dot = -f_dot / m * R[:, 2]
    A_ddot = -k_x * (a - jet[2]) - k_v * (a_dot - jet[3]) + m * jet[4]
    close(f, 68.4795, FDCL_THRUST)

    # e3 up: the world turns by `flip` and so does the body, R_up = flip R flip; the wanted force is A itself
    up = [model.vec(flip @ F) for F in (A, A_dot, A_ddot)]
    heading = [model.vec(flip @ h) for h in b1]
    command = laws.attitude_from_axes(*up, *heading)
    result = laws.attitude_moment(
        model.mat(flip @ R @ flip),
        (0.0, 0.0, 0.0),
        command,
        (1.5, 1.5, 0.8),
        (0.35, 0.35, 0.15),
        1.0,
        model.vec(J),
    )
    close(flip @ np.array(result.moment), [0.56943336, 0.13317011, -0.59766799], PRINTED)
    close(laws.thrust_along(up[0], model.mat(flip @ R @ flip)), 68.4795, FDCL_THRUST)


# --- load attitude and position


def cable_error_obeys_3_33(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """With F of (3-31) applied to (2-36), the part of m_Q L (e_q')' across the cable is -k_q e_q - k_w
    e_q'."""
    m_Q, L = vehicle.quad_mass, vehicle.cable_length
    for rng in motions(5):
        q, q_c = model.unit(rng.normal(size=3)), model.unit(rng.normal(size=3))
        q_dot = cross(rng.normal(size=3), q)
        w_c, w_c_dot = rng.normal(size=(2, 3))
        w_c, w_c_dot = w_c - (w_c @ q_c) * q_c, w_c_dot - (w_c_dot @ q_c) * q_c
        q_c_dot = cross(w_c, q_c)
        q_c_ddot = cross(w_c_dot, q_c) + cross(w_c, q_c_dot)
        k_q, k_omega, pull = 3.9, 2.0, 4.9
        F_n = laws.normal_force_held(model.vec(q), model.vec(q_c), pull)
        close(F_n, -pull * (q @ q_c) * q, EXACT)
        result = laws.load_attitude_force(
            model.vec(q),
            model.vec(q_dot),
            laws.DirectionCommand(model.vec(q_c), model.vec(q_c_dot), model.vec(q_c_ddot)),
            F_n,
            k_q,
            k_omega,
            m_Q,
            L,
        )
        F = np.array(result.F)
        close(F @ q, -pull * (q @ q_c), EXACT)
        q_ddot = cross(q, cross(q, F)) / (m_Q * L) - (q_dot @ q_dot) * q

        def e_q_dot(
            t: float, q=q, q_dot=q_dot, q_ddot=q_ddot, q_c=q_c, q_c_dot=q_c_dot, q_c_ddot=q_c_ddot
        ) -> np.ndarray:
            qt, qt_dot = q + t * q_dot + t * t / 2 * q_ddot, q_dot + t * q_ddot
            ct, ct_dot = q_c + t * q_c_dot + t * t / 2 * q_c_ddot, q_c_dot + t * q_c_ddot
            return qt_dot - cross(cross(ct, ct_dot), qt)

        across = np.eye(3) - np.outer(q, q)
        rate = across @ (e_q_dot(STEP) - e_q_dot(-STEP)) / (2 * STEP)
        e_q = (q_c @ q) * q - q_c
        close(result.e_q, e_q, EXACT)
        close(result.e_q_dot, e_q_dot(0.0), EXACT)
        close(result.psi_q, 1.0 - q @ q_c, EXACT)
        close(m_Q * L * rate, -k_q * e_q - k_omega * e_q_dot(0.0), DIFFERENCE)


def load_error_obeys_3_41(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """When the cable has the direction of (3-42) and F is the normal force of (3-44), m e_v' = -k_x e_x - k_v
    e_v."""
    m, m_Q, L = vehicle.quad_mass + vehicle.load_mass, vehicle.quad_mass, vehicle.cable_length
    for rng in motions(6):
        q = model.unit(rng.normal(size=3) * 0.4 - E3)
        w = cross(q, rng.normal(size=3))
        q_dot = cross(w, q)
        k_x, k_v = rng.uniform(2, 6, 3), rng.uniform(1, 3, 3)
        x_d, v_d, a_d, e_v = rng.normal(size=(4, 3))
        A = -5.0 * q  # A must be along the cable, so solve the law for the e_x that gives it
        e_x = (-k_v * e_v + m * (a_d + vehicle.gravity * E3) + m_Q * L * (q_dot @ q_dot) * q - A) / k_x
        result = laws.load_position_force(
            *(model.vec(p) for p in (x_d + e_x, v_d + e_v, q, q_dot, x_d, v_d, a_d, k_x, k_v)),
            m_Q,
            vehicle.load_mass,
            L,
            vehicle.gravity,
        )
        close(result.e_x, e_x, EXACT)
        close(result.e_v, e_v, EXACT)
        close(laws.computed_direction(result.A), q, EXACT)
        F_n = np.array(laws.normal_force_tracking(model.vec(q), result.A))
        R = np.column_stack([E1, cross(model.unit(F_n), E1), model.unit(F_n)])
        f = laws.thrust_along(model.vec(F_n), model.mat(R))
        y = model.pack(x_d + e_x, v_d + e_v, q, w, R, np.zeros(3))
        a = model.rates(y, f, np.zeros(3), vehicle)[3:6]
        close(m * (a - a_d), -k_x * e_x - k_v * e_v, EXACT)


def vehicle_error_obeys_its_law(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """Position law of the vehicle: m e_v' = -k_x e_x - k_v e_v, and limits that keep the horizontal direction
    of the force."""
    for rng in motions(7):
        x, v, x_d, v_d, a_d = rng.normal(size=(5, 3))
        gains = laws.QUAD_POSITION_GAINS
        F = laws.position_force(*(model.vec(p) for p in (x, v, x_d, v_d, a_d)), gains, 0.4, 9.81)
        wanted = 0.4 * (a_d + 9.81 * E3) - np.array(gains.k_x) * (x - x_d) - np.array(gains.k_v) * (v - v_d)
        close(F, wanted, EXACT)
    close(laws.limited_force((0.1, -0.2, 4.0), 3.924, 4.905), (0.1, -0.2, 4.0), EXACT)
    # it leans for no less than 0.8 weights, by 45 deg at most
    up, leaning, tangent = 0.2 * 3.924, 0.8 * 3.924, 1.0
    close(
        laws.limited_force((3.0, -4.0, -9.0), 3.924, 4.905),
        (0.6 * tangent * leaning, -0.8 * tangent * leaning, up),
        EXACT,
    )
    close(laws.leaning_lift(up, 3.924), leaning, EXACT)
    close(laws.leaning_lift(4.5, 3.924), 4.5, EXACT)
    close(laws.limited_force((0.0, 0.0, 99.0), 3.924, 4.905), (0.0, 0.0, 1.6 * 3.924), EXACT)
    close(laws.limited_force((0.0, 0.0, 99.0), 3.924, 9.81), (0.0, 0.0, 9.81), EXACT)


def lift_of_the_attitude_modes(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    close(laws.vertical_force(0.1, -0.2, 6.0, 2.75, 4.905), 4.905 - 0.6 + 0.55, EXACT)
    close(laws.vertical_force(9.0, 0.0, 6.0, 2.75, 4.905), 0.2 * 4.905, EXACT)
    tilt = 0.5
    q, R = np.array([sin(tilt), 0.0, -cos(tilt)]), model.rodrigues([0.0, tilt, 0.0])
    close(-laws.cable_pull(4.9, model.vec(q)) * q[2], 4.9, EXACT)
    close(laws.tilted_thrust(4.9, model.mat(R)) * R[2, 2], 4.9, EXACT)


# --- filters


def filter_is_4_2(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """One period of the filter against its Taylor series, with a command that changes linearly: all of x_1,
    x_2, x_2'."""
    for omega_n, zeta, dt in ((30.0, 0.98, 0.004), (25.0, 1.0, 0.002), (40.0, 1.3, 0.004), (12.0, 0.5, 0.01)):
        for rng in motions(8):
            x1, x2, u0, u1 = rng.normal(size=(4, 3))
            slope = (u1 - u0) / dt
            constants = laws.filter_constants(omega_n, zeta, dt)
            # derivatives of x_1 at the start: x^(k+2) = -2 zeta w x^(k+1) - w^2 (x^(k) - u^(k))
            d = [x1, x2]
            for k in range(30):
                u_k = (u0, slope)[k] if k < 2 else 0.0
                d.append(-2.0 * zeta * omega_n * d[k + 1] - omega_n**2 * (d[k] - u_k))
            series = [np.zeros(3), np.zeros(3), np.zeros(3)]
            for n in range(3):
                factor = 1.0
                for k in range(25):
                    series[n] = series[n] + d[k + n] * factor
                    factor *= dt / (k + 1)
            state = laws.FilterState(model.vec(u0), model.vec(x1), model.vec(x2))
            after = laws.filter_step(state, model.vec(u1), constants)
            close(after.u, u1, EXACT)
            close(after.x1, series[0], EXACT)
            close(after.x2, series[1], EXACT)
            close(laws.filter_acceleration(after, constants), series[2], EXACT)


# --- the cascade as a whole


def first_moment_of_the_oracle(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """Thrust and moment of the published closed loop at t = 0, far from its path."""
    sample = model.oracle["samples"][0]
    f, result, direction = model.oracle_command(laws, 0.0, model.oracle_start())
    close(f, sample["f"], EXACT)
    close(result.moment, sample["M"], EXACT)
    close(result.psi_R, sample["Psi_R"], EXACT)
    close(direction.psi_q, sample["Psi_q"], EXACT)


def hover_asks_for_weight_alone(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """In each mode, at rest at the target: thrust equal to the weight, no moment, no error; one tick later
    too."""
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    zero = (0.0, 0.0, 0.0)
    x = (1.0, 2.0, 3.0)
    y = model.pack(x, zero, -E3, zero, np.eye(3), zero)
    state = model.state_of(y, vehicle)
    filters, gains = laws.thesis_filters(0.004), laws.THESIS_GAINS
    jet = (x, zero, zero, zero, zero, zero, zero)
    memory = laws.start(state, x, zero)
    quad_jet = (state.x_quad, zero, zero, zero, zero, zero, zero)
    b1_d = (1.0, 0.0, 0.0)
    for _ in range(2):
        commands = (
            laws.load_position(memory, state, Reference(jet, b1_d), gains, filters, vehicle),
            laws.load_attitude(memory, state, (0.0, 0.0, -1.0), b1_d, weight, gains, filters, vehicle),
            laws.quad_attitude(memory, state, model.mat(np.eye(3)), weight, gains, filters, vehicle),
            laws.quad_position(
                memory,
                state,
                Reference(quad_jet, b1_d),
                vehicle.load_mass,
                (0.0, 0.0, 0.0),
                laws.QUAD_POSITION_GAINS,
                gains,
                filters,
                vehicle,
            ),
        )
        for _, command in commands:
            close(command.thrust, weight, EXACT)
            close(command.moment, zero, EXACT)
            errors = (command.e_x, command.e_v, command.e_q, command.e_q_dot, command.e_R, command.e_Omega)
            close(errors, np.zeros((6, 3)), EXACT)
            close((command.psi_R, command.psi_q), (0.0, 0.0), EXACT)
            close(command.q_c, -E3, EXACT)
            close(command.R_c, np.eye(3), EXACT)
        memory = commands[0][0]


def errors_reach_the_command(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """Away from the target the modes report the errors of the state, and compensate a push."""
    y = model.pack((0.1, -0.2, 1.3), (0.3, 0.1, -0.2), -E3, (0.2, -0.1, 0.0), np.eye(3), (0.0, 0.0, 0.0))
    state = model.state_of(y, vehicle)
    zero = (0.0, 0.0, 0.0)
    x_d, v_d = (0.0, 0.1, 1.2), (0.1, 0.2, 0.3)
    filters, gains = laws.thesis_filters(0.004), laws.THESIS_GAINS
    memory = laws.start(state, x_d, zero)
    reference = Reference((x_d, zero, zero, zero, zero, zero, zero), (1.0, 0.0, 0.0))
    command = laws.load_position(memory, state, reference, gains, filters, vehicle)[1]
    close(command.e_x, np.subtract(state.x_load, x_d), EXACT)
    close(command.e_v, state.v_load, EXACT)
    # a target so close that the force is within its limits
    x_d = model.vec(np.add(state.x_quad, (0.0, 0.1, -0.1)))
    reference = Reference((x_d, v_d, zero, zero, zero, zero, zero), (1.0, 0.0, 0.0))
    command = laws.quad_position(
        memory, state, reference, 0.0, (0.0, 0.0, 0.0), laws.QUAD_POSITION_GAINS, gains, filters, vehicle
    )[1]
    close(command.e_x, np.subtract(state.x_quad, x_d), EXACT)
    close(command.e_v, np.subtract(state.v_quad, v_d), EXACT)
    pushed = laws.quad_position(
        memory, state, reference, 0.0, (0.0, 0.0, 0.3), laws.QUAD_POSITION_GAINS, gains, filters, vehicle
    )[1]
    close(pushed.thrust, command.thrust - 0.3, EXACT)
    # of a vehicle that should be far higher: enough to carry a load three times as heavy
    laden = vehicle._replace(load_mass=3.0 * vehicle.quad_mass)
    above = (state.x_quad[0], state.x_quad[1], state.x_quad[2] + 9.0)
    reference = Reference((above, zero, zero, zero, zero, zero, zero), (1.0, 0.0, 0.0))
    lifting = laws.quad_position(
        memory, state, reference, 0.0, zero, laws.QUAD_POSITION_GAINS, gains, filters, laden
    )[1]
    close(lifting.thrust, 4.0 * vehicle.quad_mass * vehicle.gravity, EXACT)


PROOFS: tuple[Any, ...] = (
    attitude_error_obeys_3_22,
    commanded_frame_is_differentiated,
    columns_turn_with_the_body,
    rates_of_a_rotation_are_3_28,
    filters_feed_rates_but_not_the_attitude,
    computed_attitude_points_as_3_27,
    published_se3_numbers,
    cable_error_obeys_3_33,
    load_error_obeys_3_41,
    vehicle_error_obeys_its_law,
    lift_of_the_attitude_modes,
    filter_is_4_2,
    first_moment_of_the_oracle,
    hover_asks_for_weight_alone,
    errors_reach_the_command,
    *MIXER_PROOFS,
)
