"""The parts of all corrections: the past state of a reading, entries of its Jacobian, correcting the state.

A reading that is `age` old is a function of the errors of *then*; its Jacobian is needed for the errors of
*now*. Errors propagate by x' = F x, and backwards over the age

    attitude(then)  = attitude + age R gyro bias
    velocity(then)  = velocity - attitude x S + age R accel bias
    position(then)  = position - age velocity + attitude x D - age^2/2 R accel bias
    direction(then) = (1 + age^2 k / 2) direction - age rate,    k = q . f / L

where f is the specific force in the world, S its integral since then, and D the integral of (s - then) f. S
and D follow from the velocities and positions of then and now in the ring. Left out are the noise that
entered since then, the rotation of R within the age, and, for the cable's direction, the effect of attitude
and bias within the age.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.estimation.covariance import enter
from autopilot.estimation.history import carry_back, past3, past4, row_before
from autopilot.estimation.records import (
    ACCEL_BIAS,
    ACROSS,
    AIDED_SIZE,
    AIR,
    ATTITUDE,
    BAROMETER,
    CAMERA,
    DIRECTION,
    GNSS,
    GYRO_BIAS,
    HEADING,
    LENGTH,
    MOUNTING,
    POSITION,
    PUSH,
    Q_CABLE,
    Q_RATE,
    QUAT,
    RATE,
    SIZE,
    V_QUAD,
    VELOCITY,
    X_QUAD,
    AidEstimate,
    EstimatorState,
    EstimatorTuning,
    History,
    LoadEstimate,
    VehicleEstimate,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, add, axpy, cross, dot, scale, sub
from autopilot.geometry.packed import with_field
from autopilot.geometry.s2 import normalise, tangent
from autopilot.geometry.so3 import Quat, quat_exp, quat_multiply, quat_normalise, rotation_from_quat


class Past(NamedTuple):
    """The state when a reading was taken, and the relation of its errors to those of now."""

    age: float
    x_quad: Vec3
    v_quad: Vec3
    quat_wxyz: Quat
    q_cable: Vec3
    across: Vec3
    along: Vec3
    q_cable_dot: Vec3
    R: Mat3  # of now
    gained: Vec3  # S, m/s
    moved: Vec3  # D, m
    bend: float  # 1 + age^2 k / 2


@kernel
def look_back(state: EstimatorState, history: History, tuning: EstimatorTuning, age: float) -> Past:
    """The state `age` seconds ago."""
    ring = history.ring
    row, share = row_before(state.head, ring, state.time_s - age)
    vehicle, load = state.vehicle, state.load
    x, v = past3(ring, row, share, X_QUAD), past3(ring, row, share, V_QUAD)
    q = normalise(past3(ring, row, share, Q_CABLE))
    across = normalise(tangent(q, past3(ring, row, share, ACROSS)))
    g = tuning.gravity
    gained = sub(vehicle.v_quad, v)
    gained = (gained[0], gained[1], gained[2] + g * age)
    moved = axpy(age, vehicle.v_quad, sub(x, vehicle.x_quad))
    moved = (moved[0], moved[1], moved[2] + 0.5 * g * age * age)
    a = vehicle.accel_quad
    k = dot(q, (a[0], a[1], a[2] + g)) / load.length
    return Past(
        age,
        x,
        v,
        quat_normalise(past4(ring, row, share, QUAT)),
        q,
        across,
        cross(q, across),
        past3(ring, row, share, Q_RATE),
        rotation_from_quat(vehicle.quat_wxyz),
        gained,
        moved,
        1.0 + 0.5 * age * age * k,
    )


@kernel
def _attitude_cross(history: History, k: int, i: int, s: float, v: Vec3) -> None:
    """Enter s (attitude x v)_i."""
    if i == 0:
        enter(history, k, ATTITUDE + 1, s * v[2])
        enter(history, k, ATTITUDE + 2, -s * v[1])
    elif i == 1:
        enter(history, k, ATTITUDE + 2, s * v[0])
        enter(history, k, ATTITUDE, -s * v[2])
    else:
        enter(history, k, ATTITUDE, s * v[1])
        enter(history, k, ATTITUDE + 1, -s * v[0])


@kernel
def enter_position(history: History, k: int, past: Past, i: int) -> None:
    """Enter component i of the vehicle's position then."""
    enter(history, k, POSITION + i, 1.0)
    enter(history, k, VELOCITY + i, -past.age)
    _attitude_cross(history, k, i, 1.0, past.moved)
    s = -0.5 * past.age * past.age
    for j in range(3):
        enter(history, k, ACCEL_BIAS + j, s * past.R[i][j])


@kernel
def enter_velocity(history: History, k: int, past: Past, i: int) -> None:
    """Enter component i of the vehicle's velocity then."""
    enter(history, k, VELOCITY + i, 1.0)
    _attitude_cross(history, k, i, -1.0, past.gained)
    for j in range(3):
        enter(history, k, ACCEL_BIAS + j, past.age * past.R[i][j])


@kernel
def enter_attitude(history: History, k: int, past: Past, axis: Vec3) -> None:
    """Enter the attitude error then about a world axis."""
    for i in range(3):
        enter(history, k, ATTITUDE + i, axis[i])
        about = axis[0] * past.R[0][i] + axis[1] * past.R[1][i] + axis[2] * past.R[2][i]
        enter(history, k, GYRO_BIAS + i, past.age * about)


@kernel
def enter_direction(history: History, k: int, past: Past, first: float, second: float) -> None:
    """Enter `first` and `second` times the two components of the cable's direction then."""
    enter(history, k, DIRECTION, past.bend * first)
    enter(history, k, DIRECTION + 1, past.bend * second)
    enter(history, k, RATE, -past.age * first)
    enter(history, k, RATE + 1, -past.age * second)


@kernel
def with_vehicle(state: EstimatorState, vehicle: VehicleEstimate, resets: float) -> EstimatorState:
    """The state with its vehicle replaced."""
    return with_field(with_field(state, "vehicle", vehicle), "resets", resets)


@kernel
def with_load(state: EstimatorState, load: LoadEstimate, resets: float) -> EstimatorState:
    """The state with its load replaced."""
    return with_field(with_field(state, "load", load), "resets", resets)


@kernel
def with_aids(state: EstimatorState, aids: AidEstimate) -> EstimatorState:
    """The state with its aids replaced."""
    return with_field(state, "aids", aids)


@kernel
def heard(state: EstimatorState, age: float, size: int) -> EstimatorState:
    """The state whose ring is corrected at least as far back as `age` from now on, with at least `size`
    errors in use."""
    state = with_field(state, "memory_s", max(state.memory_s, age))
    return with_field(state, "size", max(state.size, size))


@kernel
def vehicle_at(v: VehicleEstimate, age_s: float, rejected: float) -> VehicleEstimate:
    """The vehicle with another age and count of refusals."""
    return VehicleEstimate(
        v.x_quad,
        v.v_quad,
        v.quat_wxyz,
        v.omega_body,
        v.gyro_bias,
        v.accel_bias,
        v.accel_quad,
        age_s,
        rejected,
        v.source,
    )


@kernel
def load_at(load: LoadEstimate, age_s: float, rejected: float, source: float) -> LoadEstimate:
    """The load with another age, count of refusals and source."""
    return LoadEstimate(
        load.x_load,
        load.v_load,
        load.q_cable,
        load.q_cable_dot,
        load.across,
        load.length,
        load.covariance,
        load.taut,
        load.tension,
        load.pull,
        load.pulled_s,
        load.held_s,
        age_s,
        rejected,
        source,
    )


@kernel
def moved_load(load: LoadEstimate, vehicle: VehicleEstimate, history: History, plain: float) -> LoadEstimate:
    """The load and its cable corrected by `error`; while the cable is taut, the load is at its end."""
    e = history.error[0]
    along = cross(load.q_cable, load.across)
    off = add(scale(e[DIRECTION], load.across), scale(e[DIRECTION + 1], along))
    turned = add(scale(e[RATE], load.across), scale(e[RATE + 1], along))
    q = normalise(add(load.q_cable, off))
    across = normalise(tangent(q, load.across))
    q_dot = tangent(q, add(load.q_cable_dot, turned))
    length = load.length + e[LENGTH]
    x_load, v_load = load.x_load, load.v_load
    if load.taut > 0.0:
        x_load = axpy(length, q, vehicle.x_quad)
        v_load = axpy(length, q_dot, vehicle.v_quad)
    elif load.source == CAMERA and plain > 0.0:
        # the load's position is known relative to the vehicle, whose position a plain receiver measures no
        # better
        x_load = add(x_load, (e[POSITION], e[POSITION + 1], 0.0))
    return LoadEstimate(
        x_load,
        v_load,
        q,
        q_dot,
        across,
        length,
        load.covariance,
        load.taut,
        load.tension,
        load.pull,
        load.pulled_s,
        load.held_s,
        load.age_s,
        load.rejected,
        load.source,
    )


@kernel
def inject(state: EstimatorState, history: History) -> EstimatorState:
    """The state corrected by `error`, and the ring with it."""
    e, v, a = history.error[0], state.vehicle, state.aids
    turned = quat_exp((e[ATTITUDE], e[ATTITUDE + 1], e[ATTITUDE + 2]))
    moved = (e[POSITION], e[POSITION + 1], e[POSITION + 2])
    shift = (e[GYRO_BIAS], e[GYRO_BIAS + 1], e[GYRO_BIAS + 2])
    vehicle = VehicleEstimate(
        add(v.x_quad, moved),
        add(v.v_quad, (e[VELOCITY], e[VELOCITY + 1], e[VELOCITY + 2])),
        quat_normalise(quat_multiply(turned, v.quat_wxyz)),
        sub(v.omega_body, shift),
        add(v.gyro_bias, shift),
        add(v.accel_bias, (e[ACCEL_BIAS], e[ACCEL_BIAS + 1], e[ACCEL_BIAS + 2])),
        v.accel_quad,
        v.age_s,
        v.rejected,
        v.source,
    )
    aids = a
    if state.size >= AIDED_SIZE:
        aids = AidEstimate(
            (a.mounting[0] + e[MOUNTING], a.mounting[1] + e[MOUNTING + 1]),
            a.heading + e[HEADING],
            a.barometer + e[BAROMETER],
            add(a.gnss, (e[GNSS], e[GNSS + 1], e[GNSS + 2])),
            a.horizontal_slow,
            a.vertical_slow,
            a.reversion,
            add(a.debt, moved) if a.reversion < 1.0 else a.debt,
            a.field,
            a.magnetic_age,
            a.barometer_age,
            a.rejected,
        )
    air = state.air
    pushed = air.vehicle
    if state.size == SIZE:
        pushed = (pushed[0] + e[PUSH], pushed[1] + e[PUSH + 1])
    air = with_field(air, "load", (air.load[0] + e[AIR], air.load[1] + e[AIR + 1]))
    air = with_field(air, "vehicle", pushed)
    carry_back(state.head, history, state.memory_s)
    load = moved_load(state.load, vehicle, history, 1.0 if a.reversion < 1.0 else 0.0)
    state = with_vehicle(with_aids(state, aids), vehicle, state.resets)
    return with_load(with_field(state, "air", air), load, state.resets)
