"""Convergence from far away, the cascade with its filters in flight, and the laws on a flat path."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from autopilot.control import load_attitude, quad_attitude, quad_position
from autopilot.control import thesis_cascade as thesis
from autopilot.control.records import Command, Reference, Vehicle
from autopilot.trajectory.flatness import flat_outputs
from tests.control.model import cross

ZERO = (0.0, 0.0, 0.0)
HEADING = (1.0, 0.0, 0.0)
DT = 0.004
# each with its reason
SHRUNK = 1e-3  # of the initial Psi_R: 2 s are 18 time constants of the slow pole of k_R, k_Omega, J
ALIGNED = 1e-4  # Psi_q after 6 s; near the opposite pole the start is slow
SETTLED = 1e-6  # m, rad, N: 12 s of the slowest mode (2.2 rad/s with k_x, k_v)
FLAT = 1e-9  # two derivations of the same path, up to the sixth derivative of it


def eight_by_eight() -> list[np.ndarray]:
    """64 rotation vectors: eight axes by eight angles up to 179 deg, upside down among them."""
    axes = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, -1), (0, 1, 1), (1, -1, 1), (-1, 2, 3)]
    angles = np.radians([5, 30, 60, 90, 120, 150, 170, 179])
    return [angle * np.array(axis) / np.linalg.norm(axis) for axis, angle in product(axes, angles)]


def settle_attitude(model: SimpleNamespace, R: np.ndarray, R_c: np.ndarray, vehicle: Vehicle) -> list[float]:
    """Psi_R along 2 s of (2-34), (2-35) under (3-36) for a commanded attitude at rest."""
    gains, J = thesis.THESIS_GAINS, np.array(vehicle.inertia)
    command = quad_attitude.AttitudeCommand(model.mat(R_c), ZERO, ZERO)
    W, psi, h = np.zeros(3), [], 0.002
    for _ in range(1000):
        result = quad_attitude.attitude_moment(
            model.mat(R), model.vec(W), command, gains.k_R, gains.k_Omega, gains.epsilon, vehicle.inertia
        )
        psi.append(result.psi_R)
        W = W + h * (np.array(result.moment) - cross(W, J * W)) / J
        R = R @ model.rodrigues(h * W)
    return psi


@pytest.mark.parametrize("start", range(0, 64, 8))
def test_attitude_converges_from_almost_everywhere(
    model: SimpleNamespace, bebop: Vehicle, start: int
) -> None:
    rng = np.random.default_rng(start)
    for phi in eight_by_eight()[start : start + 8]:
        R_c = model.random_rotation(rng)
        psi = settle_attitude(model, R_c @ model.rodrigues(phi), R_c, bebop)
        assert psi[-1] < SHRUNK * psi[0]
        assert max(psi) <= psi[0] * (1.0 + 1e-9)


def test_cable_converges_from_almost_everywhere(model: SimpleNamespace, bebop: Vehicle) -> None:
    """(2-36) under (3-31), with the vehicle's thrust immediately along F; from a random direction, also
    nearly opposite."""
    m_Q_L = bebop.quad_mass * bebop.cable_length
    gains, h = thesis.THESIS_GAINS, 0.004
    rng = np.random.default_rng(7)
    for angle in (0.1, 1.0, 2.0, 3.0, 3.13):
        q_c = model.unit(rng.normal(size=3))
        q = model.rodrigues(angle * model.unit(cross(q_c, rng.normal(size=3)))) @ q_c
        w = np.zeros(3)
        command = load_attitude.DirectionCommand(model.vec(q_c), ZERO, ZERO)
        psi = []
        for _ in range(1500):
            F_n = load_attitude.normal_force_held(model.vec(q), model.vec(q_c), 4.9)
            result = load_attitude.load_attitude_force(
                model.vec(q),
                model.vec(cross(w, q)),
                command,
                F_n,
                gains.k_q,
                gains.k_omega,
                bebop.quad_mass,
                bebop.cable_length,
            )
            psi.append(result.psi_q)
            w = w - h * cross(q, np.array(result.F)) / m_Q_L
            q = model.rodrigues(h * w) @ q
        assert psi[-1] < ALIGNED
        assert max(psi) <= psi[0] * (1.0 + 1e-9)


def fly(
    model: SimpleNamespace,
    vehicle: Vehicle,
    mode: str,
    y: np.ndarray,
    target: tuple[float, float, float],
    seconds: float,
) -> tuple[np.ndarray, list[Command]]:
    """One mode of the cascade with its filters, 250 Hz, on the independent model without rotors."""
    filters, gains = thesis.thesis_filters(DT), thesis.THESIS_GAINS
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    reference = Reference((target, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), HEADING)
    state = model.state_of(y, vehicle)
    memory = thesis.start(state, target, ZERO)
    commands = []
    for _ in range(round(seconds / DT)):
        state = model.state_of(y, vehicle)
        if mode == "load_position":
            memory, command = thesis.load_position(memory, state, reference, gains, filters, vehicle)
        elif mode == "load_attitude":
            memory, command = thesis.load_attitude(
                memory, state, target, HEADING, weight, gains, filters, vehicle
            )
        else:
            memory, command = quad_position.quad_position(
                memory,
                state,
                reference,
                vehicle.load_mass,
                (0.0, 0.0, 0.0),
                quad_position.QUAD_POSITION_GAINS,
                gains,
                filters,
                vehicle,
            )
        commands.append(command)
        y = model.rk4(y, command.thrust, command.moment, vehicle, DT)
    return y, commands


def swinging(model: SimpleNamespace) -> np.ndarray:
    q = model.unit([0.2, -0.1, -1.0])
    R = model.rodrigues([0.2, 0.3, 0.5])
    return model.pack((0.3, -0.2, 1.4), (0.1, 0.2, 0.0), q, cross(q, (0.3, 0.1, 0.0)), R, (0.2, -0.1, 0.3))


def test_load_position_settles_without_error(model: SimpleNamespace, bebop: Vehicle) -> None:
    y, commands = fly(model, bebop, "load_position", swinging(model), (0.0, 0.5, 1.0), 12.0)
    last = commands[-1]
    np.testing.assert_allclose(y[0:3], (0.0, 0.5, 1.0), atol=SETTLED)
    for error in (last.e_x, last.e_v, last.e_q, last.e_q_dot, last.e_R, last.e_Omega, last.moment):
        np.testing.assert_allclose(error, ZERO, atol=SETTLED)
    np.testing.assert_allclose(last.thrust, 0.5 * 9.81, atol=SETTLED)
    np.testing.assert_allclose(last.R_c, np.eye(3), atol=SETTLED)


def test_load_attitude_is_held(model: SimpleNamespace, bebop: Vehicle) -> None:
    """A cable held at a slant: vehicle and load accelerate sideways for ever, and the errors nevertheless go
    to zero."""
    q_d = model.vec(model.unit([0.3, 0.0, -1.0]))
    y, commands = fly(model, bebop, "load_attitude", swinging(model), q_d, 8.0)
    np.testing.assert_allclose(y[6:9], q_d, atol=SETTLED)
    np.testing.assert_allclose(commands[-1].e_R, ZERO, atol=SETTLED)


def test_vehicle_position_damps_the_load_enough(model: SimpleNamespace, bebop: Vehicle) -> None:
    """With the load hanging the vehicle law must not feed the swing: after 12 s it is less than half of what
    it was at first."""
    y0 = swinging(model)
    y, commands = fly(model, bebop, "quad_position", y0, (0.3, -0.2, 2.0), 12.0)
    assert np.linalg.norm(y[6:8]) < 0.5 * np.linalg.norm(y0[6:8])
    assert np.linalg.norm(commands[-1].e_x) < 0.1


def test_start_is_bumpless(model: SimpleNamespace, bebop: Vehicle) -> None:
    """The filters begin at the present R and q with their rates: when the present motion is commanded to
    continue, the cascade sees hardly an error, whereas a filter that began at rest would see the whole
    rate."""
    y = swinging(model)
    state = model.state_of(y, bebop)
    filters, gains = thesis.thesis_filters(DT), thesis.THESIS_GAINS
    memory = thesis.start(state, state.x_load, state.v_load)
    R_next = y[12:21].reshape(3, 3) @ model.rodrigues(DT * y[21:24])
    _, command = thesis.quad_attitude(memory, state, model.mat(R_next), 5.0, gains, filters, bebop)
    rate = np.linalg.norm(state.omega_body)
    assert np.linalg.norm(command.e_R) < 1.1 * rate * DT
    # one period of a 30 rad/s filter slows a steady rate by 2 zeta omega_n dt = 24 %, less what it gains back
    assert np.linalg.norm(command.e_Omega) < 0.25 * rate
    q_next = model.vec(model.unit(np.array(state.q_cable) + DT * np.array(state.q_cable_dot)))
    _, command = thesis.load_attitude(memory, state, q_next, HEADING, 5.0, gains, filters, bebop)
    rate = np.linalg.norm(state.q_cable_dot)
    assert np.linalg.norm(command.e_q) < 1.1 * rate * DT
    assert np.linalg.norm(command.e_q_dot) < 0.25 * rate


def test_half_turn_of_the_command_yields_numbers(model: SimpleNamespace, bebop: Vehicle) -> None:
    """A commanded attitude and cable direction that jump to the opposite: the filters start again and never
    give NaN."""
    y = model.pack((0, 0, 0), ZERO, (0, 0, -1), ZERO, np.eye(3), ZERO)
    state = model.state_of(y, bebop)
    filters, gains = thesis.thesis_filters(DT), thesis.THESIS_GAINS
    memory = thesis.start(state, state.x_load, ZERO)
    upside_down, up = model.mat(np.diag([1.0, -1.0, -1.0])), (0.0, 0.0, 1.0)
    for _ in range(100):
        memory, attitude = thesis.quad_attitude(memory, state, upside_down, 5.0, gains, filters, bebop)
        memory, cable = thesis.load_attitude(memory, state, up, HEADING, 5.0, gains, filters, bebop)
        for command in (attitude, cable):
            assert np.isfinite(np.hstack([np.ravel(part) for part in command])).all()


def test_free_fall_and_no_force_yield_numbers(model: SimpleNamespace, bebop: Vehicle) -> None:
    """A reference that falls freely leaves q_c and R_c without a direction: the present ones are kept."""
    y = model.pack((0, 0, 0), ZERO, (0, 0, -1), ZERO, np.eye(3), ZERO)
    state = model.state_of(y, bebop)
    gains = thesis.THESIS_GAINS._replace(k_x=ZERO, k_v=ZERO)
    filters = thesis.thesis_filters(DT)
    memory = thesis.start(state, ZERO, ZERO)
    weightless = bebop._replace(gravity=0.0)
    reference = Reference((ZERO,) * 7, HEADING)
    _, command = thesis.load_position(memory, state, reference, gains, filters, weightless)
    np.testing.assert_allclose(command.R_c, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(command.q_c, (0.0, 0.0, -1.0), atol=1e-12)


@pytest.mark.parametrize("t", [0.0, 0.7, 1.3, 2.9, 4.7])
def test_flat_path_gives_the_flat_inputs(model: SimpleNamespace, bebop: Vehicle, t: float) -> None:
    """On a flat path, with its exact derivatives in place of the filters, the cascade commands exactly the
    thrust and moment of the path: feed-forward and feedback agree, no term is left over."""
    jet = tuple(
        (
            2.0 * (np.pi / 2) ** k * -np.cos(np.pi / 2 * t + k * np.pi / 2) + (2.0 if k == 0 else 0.0),
            2.5 * (2 * np.pi / 5) ** k * np.sin(2 * np.pi / 5 * t + k * np.pi / 2),
            1.5 * (2 * np.pi / 7) ** k * np.cos(2 * np.pi / 7 * t + k * np.pi / 2),
        )
        for k in range(7)
    )
    jet = tuple(model.vec(p) for p in jet)
    v = bebop
    flat = flat_outputs(jet, 0.0, v.quad_mass, v.load_mass, v.cable_length, v.inertia, v.gravity)
    gains = thesis.THESIS_GAINS
    position = thesis.load_position_force(
        jet[0],
        jet[1],
        flat.q_cable,
        flat.q_cable_dot,
        *jet[:3],
        gains.k_x,
        gains.k_v,
        v.quad_mass,
        v.load_mass,
        v.cable_length,
        v.gravity,
    )
    q_c = thesis.computed_direction(position.A)
    np.testing.assert_allclose(q_c, flat.q_cable, atol=FLAT)
    direction = thesis.load_attitude_force(
        flat.q_cable,
        flat.q_cable_dot,
        thesis.DirectionCommand(q_c, flat.q_cable_dot, flat.q_cable_ddot),
        thesis.normal_force_tracking(flat.q_cable, position.A),
        gains.k_q,
        gains.k_omega,
        v.quad_mass,
        v.cable_length,
    )
    R_c = thesis.attitude_towards(direction.F, HEADING, flat.R)
    np.testing.assert_allclose(R_c, flat.R, atol=FLAT)
    np.testing.assert_allclose(thesis.thrust_along(direction.F, flat.R), flat.thrust, rtol=FLAT)
    result = quad_attitude.attitude_moment(
        flat.R,
        flat.omega_body,
        quad_attitude.AttitudeCommand(R_c, flat.omega_body, flat.omega_body_dot),
        gains.k_R,
        gains.k_Omega,
        gains.epsilon,
        v.inertia,
    )
    np.testing.assert_allclose(result.moment, flat.moment, atol=FLAT)
