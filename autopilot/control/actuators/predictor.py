"""The predicted state of vehicle and load when the command of this tick takes effect.

| symbol | code name | frame | unit | equation |
|---|---|---|---|---|
| x_L, v_L, q, q' | x_load .. q_cable_dot | I | | (2-30)-(2-33) |
| R, Omega | quat, omega | B->I, B | , rad/s | (2-34), (2-35) |
| f, M | thrust, moment | B | N, N m | `actuation` |
| D | air | I | N | drag of the vehicle and a constant push |

The model of the taut cable, (2-31) with (2-36), or of the vehicle alone if the cable is slack, is integrated
by the midpoint rule over the commands on their way, each for the time in which it is in force. The rotors'
lag is exact at both ends and in the middle of each piece. Where the cable would have to push, the load falls
freely. Not in the model: the ground, drag of the load.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.actuators.rotor_model import Actuation, ActuationConstants, after_delay, lagged
from autopilot.control.drag import Drag, drag_force
from autopilot.control.records import State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, axpy, column, dot, scale, sub
from autopilot.geometry.rigid_body import angular_accel
from autopilot.geometry.s2 import normalise, tangent
from autopilot.geometry.so3 import (
    Quat,
    quat_derivative,
    quat_from_rotation,
    quat_normalise,
    rotation_from_quat,
)


class Prediction(NamedTuple):
    """The state at the instant at which a command takes effect, and what the rotors give then."""

    state: State
    thrust: float  # N
    moment: Vec3  # N m, body


class _Motion(NamedTuple):
    x: Vec3  # of the load while taut, else of the vehicle
    v: Vec3
    q: Vec3
    q_dot: Vec3
    quat: Quat
    omega: Vec3


@kernel
def _shifted(m: _Motion, h: float, rate: _Motion) -> _Motion:
    p, d = m.quat, rate.quat
    quat = (p[0] + h * d[0], p[1] + h * d[1], p[2] + h * d[2], p[3] + h * d[3])
    q = normalise(axpy(h, rate.q, m.q))
    return _Motion(
        axpy(h, rate.x, m.x),
        axpy(h, rate.v, m.v),
        q,
        tangent(q, axpy(h, rate.q_dot, m.q_dot)),
        quat_normalise(quat),
        axpy(h, rate.omega, m.omega),
    )


@kernel
def _rates(
    m: _Motion,
    thrust: float,
    moment: Vec3,
    taut: float,
    push: Vec3,
    torque: Vec3,
    drag: Drag,
    vehicle: Vehicle,
) -> _Motion:
    """Time derivative of the motion, as in `load_motion`; the cable does not push."""
    q = m.q
    v_quad = axpy(-vehicle.cable_length, m.q_dot, m.v) if taut > 0.0 else m.v
    b3 = column(rotation_from_quat(m.quat), 2)
    F = axpy(thrust, b3, add(drag_force(v_quad, drag), push))
    if taut > 0.0:
        s = dot(m.q_dot, m.q_dot)
        share = vehicle.quad_mass + vehicle.load_mass
        pull = (dot(q, F) - vehicle.quad_mass * vehicle.cable_length * s) / share
        # pull = -T / m_L
        pull = min(pull, 0.0)
        a = scale(pull, q)
        q_ddot_across = scale(-1.0 / (vehicle.quad_mass * vehicle.cable_length), tangent(q, F))
        q_ddot = axpy(-s, q, q_ddot_across)
    else:
        a = scale(1.0 / vehicle.quad_mass, F)
        q_ddot = (0.0, 0.0, 0.0)
    return _Motion(
        m.v,
        (a[0], a[1], a[2] - vehicle.gravity),
        m.q_dot,
        q_ddot,
        quat_derivative(m.quat, m.omega),
        angular_accel(m.omega, add(moment, torque), vehicle.inertia),
    )


@kernel
def _midpoint_step(
    m: _Motion,
    actuation: Actuation,
    row: int,
    half: float,
    h: float,
    taut: float,
    push: Vec3,
    torque: Vec3,
    drag: Drag,
    vehicle: Vehicle,
) -> _Motion:
    """The motion after h seconds under command `row`; after h/2 the share `half` of the lag remains."""
    start_rate = _rates(m, actuation.thrust, actuation.moment, taut, push, torque, drag, vehicle)
    thrust, moment = lagged(actuation.thrust, actuation.moment, actuation.queue, row, half)
    middle = _shifted(m, 0.5 * h, start_rate)
    return _shifted(m, h, _rates(middle, thrust, moment, taut, push, torque, drag, vehicle))


@kernel
def predict_on_ground(state: State, actuation: Actuation, constants: ActuationConstants) -> Prediction:
    """A vehicle that the ground holds stays as it is, whatever its rotors do."""
    thrust, moment = after_delay(actuation, constants)
    return Prediction(state, thrust, moment)


@kernel
def predict(
    state: State,
    taut: float,
    actuation: Actuation,
    constants: ActuationConstants,
    period: float,
    push: Vec3,
    torque: Vec3,
    drag: Drag,
    vehicle: Vehicle,
) -> Prediction:
    """The state after the delay of `constants`, under the commands on their way, a steady `push` (N) and
    a steady `torque` (N m, body).

    With taut = 0.0 only the vehicle is predicted; load and cable stay as they are.
    """
    if not (constants.remainder > 0.0 or constants.whole_periods > 0):
        return Prediction(state, actuation.thrust, actuation.moment)
    x, v = state.x_quad, state.v_quad
    if taut > 0.0:
        x, v = state.x_load, state.v_load
    m = _Motion(x, v, state.q_cable, state.q_cable_dot, quat_from_rotation(state.R), state.omega_body)
    thrust, moment = actuation.thrust, actuation.moment
    if constants.remainder > 0.0:
        row = constants.whole_periods
        m = _midpoint_step(
            m,
            actuation,
            row,
            constants.decay_half_remainder,
            constants.remainder,
            taut,
            push,
            torque,
            drag,
            vehicle,
        )
        thrust, moment = lagged(thrust, moment, actuation.queue, row, constants.decay_remainder)
    for i in range(constants.whole_periods):
        row = constants.whole_periods - 1 - i
        rotors = Actuation(actuation.queue, thrust, moment)
        m = _midpoint_step(
            m, rotors, row, constants.decay_half_period, period, taut, push, torque, drag, vehicle
        )
        thrust, moment = lagged(thrust, moment, actuation.queue, row, constants.decay_period)
    x_load, v_load, x_quad, v_quad = state.x_load, state.v_load, m.x, m.v
    q, q_dot = state.q_cable, state.q_cable_dot
    if taut > 0.0:
        L = vehicle.cable_length
        x_load, v_load, q, q_dot = m.x, m.v, m.q, m.q_dot
        # the distance between the cable's ends in the estimate is kept
        x_quad = add(state.x_quad, sub(sub(m.x, state.x_load), scale(L, sub(m.q, state.q_cable))))
        v_quad = add(state.v_quad, sub(sub(m.v, state.v_load), scale(L, sub(m.q_dot, state.q_cable_dot))))
    predicted_state = State(
        x_load,
        v_load,
        q,
        q_dot,
        x_quad,
        v_quad,
        rotation_from_quat(m.quat),
        m.omega,
        state.a_quad,
    )
    return Prediction(predicted_state, thrust, moment)
