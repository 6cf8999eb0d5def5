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

from autopilot.estimation.covariance import add_jacobian_entry
from autopilot.estimation.history import (
    correct_past_states,
    interpolate3,
    interpolate4,
    reset_past_states,
    row_before,
)
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
    EstimatorState,
    EstimatorTuning,
    History,
    LoadEstimate,
    SensorErrors,
    VehicleEstimate,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, add, axpy, cross, dot, scale, sub
from autopilot.geometry.packed import with_field
from autopilot.geometry.s2 import normalise, tangent
from autopilot.geometry.so3 import Quat, quat_exp, quat_multiply, quat_normalise, rotation_from_quat


class PastState(NamedTuple):
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
    velocity_gain: Vec3  # S, m/s
    displacement: Vec3  # D, m
    direction_growth: float  # 1 + age^2 k / 2


@kernel
def past_state(state: EstimatorState, history: History, tuning: EstimatorTuning, age: float) -> PastState:
    """The state `age` seconds ago."""
    ring = history.ring
    row, share = row_before(state.head, ring, state.time_s - age)
    vehicle, load = state.vehicle, state.load
    x, v = interpolate3(ring, row, share, X_QUAD), interpolate3(ring, row, share, V_QUAD)
    q = normalise(interpolate3(ring, row, share, Q_CABLE))
    across = normalise(tangent(q, interpolate3(ring, row, share, ACROSS)))
    g = tuning.gravity
    velocity_gain = sub(vehicle.v_quad, v)
    velocity_gain = (velocity_gain[0], velocity_gain[1], velocity_gain[2] + g * age)
    displacement = axpy(age, vehicle.v_quad, sub(x, vehicle.x_quad))
    displacement = (displacement[0], displacement[1], displacement[2] + 0.5 * g * age * age)
    a = vehicle.accel_quad
    k = dot(q, (a[0], a[1], a[2] + g)) / load.length
    return PastState(
        age,
        x,
        v,
        quat_normalise(interpolate4(ring, row, share, QUAT)),
        q,
        across,
        cross(q, across),
        interpolate3(ring, row, share, Q_RATE),
        rotation_from_quat(vehicle.quat_wxyz),
        velocity_gain,
        displacement,
        1.0 + 0.5 * age * age * k,
    )


@kernel
def _add_attitude_cross_jacobian(history: History, k: int, i: int, s: float, v: Vec3) -> None:
    """Enter s (attitude x v)_i."""
    if i == 0:
        add_jacobian_entry(history, k, ATTITUDE + 1, s * v[2])
        add_jacobian_entry(history, k, ATTITUDE + 2, -s * v[1])
    elif i == 1:
        add_jacobian_entry(history, k, ATTITUDE + 2, s * v[0])
        add_jacobian_entry(history, k, ATTITUDE, -s * v[2])
    else:
        add_jacobian_entry(history, k, ATTITUDE, s * v[1])
        add_jacobian_entry(history, k, ATTITUDE + 1, -s * v[0])


@kernel
def add_position_jacobian(history: History, k: int, past: PastState, i: int) -> None:
    """Enter component i of the vehicle's position then."""
    add_jacobian_entry(history, k, POSITION + i, 1.0)
    add_jacobian_entry(history, k, VELOCITY + i, -past.age)
    _add_attitude_cross_jacobian(history, k, i, 1.0, past.displacement)
    s = -0.5 * past.age * past.age
    for j in range(3):
        add_jacobian_entry(history, k, ACCEL_BIAS + j, s * past.R[i][j])


@kernel
def add_velocity_jacobian(history: History, k: int, past: PastState, i: int) -> None:
    """Enter component i of the vehicle's velocity then."""
    add_jacobian_entry(history, k, VELOCITY + i, 1.0)
    _add_attitude_cross_jacobian(history, k, i, -1.0, past.velocity_gain)
    for j in range(3):
        add_jacobian_entry(history, k, ACCEL_BIAS + j, past.age * past.R[i][j])


@kernel
def add_attitude_jacobian(history: History, k: int, past: PastState, axis: Vec3) -> None:
    """Enter the attitude error then about a world axis."""
    for i in range(3):
        add_jacobian_entry(history, k, ATTITUDE + i, axis[i])
        bias_share = axis[0] * past.R[0][i] + axis[1] * past.R[1][i] + axis[2] * past.R[2][i]
        add_jacobian_entry(history, k, GYRO_BIAS + i, past.age * bias_share)


@kernel
def add_direction_jacobian(history: History, k: int, past: PastState, first: float, second: float) -> None:
    """Enter `first` and `second` times the two components of the cable's direction then."""
    add_jacobian_entry(history, k, DIRECTION, past.direction_growth * first)
    add_jacobian_entry(history, k, DIRECTION + 1, past.direction_growth * second)
    add_jacobian_entry(history, k, RATE, -past.age * first)
    add_jacobian_entry(history, k, RATE + 1, -past.age * second)


@kernel
def with_vehicle(state: EstimatorState, vehicle: VehicleEstimate, resets: float) -> EstimatorState:
    """The state with its vehicle replaced."""
    return with_field(with_field(state, "vehicle", vehicle), "resets", resets)


@kernel
def with_load(state: EstimatorState, load: LoadEstimate, resets: float) -> EstimatorState:
    """The state with its load replaced."""
    return with_field(with_field(state, "load", load), "resets", resets)


@kernel
def with_sensor_errors(state: EstimatorState, sensor_errors: SensorErrors) -> EstimatorState:
    """The state with its sensor errors replaced."""
    return with_field(state, "sensor_errors", sensor_errors)


@kernel
def with_capacity(state: EstimatorState, age: float, size: int) -> EstimatorState:
    """The state whose ring is corrected at least as far back as `age` from now on, with at least `size`
    errors in use."""
    state = with_field(state, "memory_s", max(state.memory_s, age))
    return with_field(state, "size", max(state.size, size))


@kernel
def vehicle_with_status(v: VehicleEstimate, age_s: float, rejected: float) -> VehicleEstimate:
    """The vehicle with another age and count of rejections."""
    return with_field(with_field(v, "age_s", age_s), "rejected", rejected)


@kernel
def restarted_vehicle(
    old: VehicleEstimate, history: History, x: Vec3, v: Vec3, quat: Quat, age_s: float, source: float
) -> VehicleEstimate:
    """The vehicle where a reading places it; its past is forgotten."""
    reset_past_states(history, X_QUAD, 3, (x[0], x[1], x[2], 0.0))
    reset_past_states(history, V_QUAD, 3, (v[0], v[1], v[2], 0.0))
    reset_past_states(history, QUAT, 4, quat)
    vehicle = with_field(with_field(with_field(old, "x_quad", x), "v_quad", v), "quat_wxyz", quat)
    return with_field(vehicle_with_status(vehicle, age_s, 0.0), "source", source)


@kernel
def load_with_status(load: LoadEstimate, age_s: float, rejected: float, source: float) -> LoadEstimate:
    """The load with another age, count of rejections and source."""
    return with_field(with_field(with_field(load, "age_s", age_s), "rejected", rejected), "source", source)


@kernel
def corrected_load(
    load: LoadEstimate, vehicle: VehicleEstimate, history: History, plain_gnss: float
) -> LoadEstimate:
    """The load and its cable corrected by `error`; while the cable is taut, the load is at its end."""
    e = history.error[0]
    along = cross(load.q_cable, load.across)
    direction_change = add(scale(e[DIRECTION], load.across), scale(e[DIRECTION + 1], along))
    rate_change = add(scale(e[RATE], load.across), scale(e[RATE + 1], along))
    q = normalise(add(load.q_cable, direction_change))
    across = normalise(tangent(q, load.across))
    q_dot = tangent(q, add(load.q_cable_dot, rate_change))
    length = load.length + e[LENGTH]
    x_load, v_load = load.x_load, load.v_load
    if load.taut > 0.0:
        x_load = axpy(length, q, vehicle.x_quad)
        v_load = axpy(length, q_dot, vehicle.v_quad)
    elif load.source == CAMERA and plain_gnss > 0.0:
        # the load's position is known relative to the vehicle, whose position a plain receiver measures no
        # better
        x_load = add(x_load, (e[POSITION], e[POSITION + 1], 0.0))
    load = with_field(with_field(load, "x_load", x_load), "v_load", v_load)
    load = with_field(with_field(load, "q_cable", q), "q_cable_dot", q_dot)
    return with_field(with_field(load, "across", across), "length", length)


@kernel
def inject_error(state: EstimatorState, history: History) -> EstimatorState:
    """The state corrected by `error`, and the ring with it."""
    e, v, a = history.error[0], state.vehicle, state.sensor_errors
    rotation = quat_exp((e[ATTITUDE], e[ATTITUDE + 1], e[ATTITUDE + 2]))
    position_change = (e[POSITION], e[POSITION + 1], e[POSITION + 2])
    gyro_bias_change = (e[GYRO_BIAS], e[GYRO_BIAS + 1], e[GYRO_BIAS + 2])
    vehicle = VehicleEstimate(
        x_quad=add(v.x_quad, position_change),
        v_quad=add(v.v_quad, (e[VELOCITY], e[VELOCITY + 1], e[VELOCITY + 2])),
        quat_wxyz=quat_normalise(quat_multiply(rotation, v.quat_wxyz)),
        omega_body=sub(v.omega_body, gyro_bias_change),
        gyro_bias=add(v.gyro_bias, gyro_bias_change),
        accel_bias=add(v.accel_bias, (e[ACCEL_BIAS], e[ACCEL_BIAS + 1], e[ACCEL_BIAS + 2])),
        accel_quad=v.accel_quad,
        age_s=v.age_s,
        rejected=v.rejected,
        source=v.source,
        turning_accel=v.turning_accel,
    )
    sensor_errors = a
    if state.size >= AIDED_SIZE:
        pending = add(a.pending_correction, position_change) if a.reversion < 1.0 else a.pending_correction
        mounting = (a.mounting[0] + e[MOUNTING], a.mounting[1] + e[MOUNTING + 1])
        sensor_errors = with_field(with_field(a, "mounting", mounting), "heading", a.heading + e[HEADING])
        sensor_errors = with_field(sensor_errors, "barometer", a.barometer + e[BAROMETER])
        sensor_errors = with_field(sensor_errors, "gnss", add(a.gnss, (e[GNSS], e[GNSS + 1], e[GNSS + 2])))
        sensor_errors = with_field(sensor_errors, "pending_correction", pending)
    air = state.air
    vehicle_accel = air.vehicle_accel
    if state.size == SIZE:
        vehicle_accel = (vehicle_accel[0] + e[PUSH], vehicle_accel[1] + e[PUSH + 1])
    air = with_field(air, "load_accel", (air.load_accel[0] + e[AIR], air.load_accel[1] + e[AIR + 1]))
    air = with_field(air, "vehicle_accel", vehicle_accel)
    correct_past_states(state.head, history, state.memory_s)
    load = corrected_load(state.load, vehicle, history, 1.0 if a.reversion < 1.0 else 0.0)
    state = with_vehicle(with_sensor_errors(state, sensor_errors), vehicle, state.resets)
    return with_load(with_field(state, "air", air), load, state.resets)
