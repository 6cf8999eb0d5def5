"""Prediction over one IMU sample: strapdown for the vehicle, a driven pendulum for the cable.

The pendulum needs neither thrust nor masses: while the cable is taut the load feels gravity and the cable
alone, so that the direction q from vehicle to load obeys

    L q'' = -P_q (x_Q'' + g e3) - L |q'|^2 q,        P_q = I - q q^T,

and x_Q'' + g e3 = R a is what the accelerometer reads.

Every quantity's error is taken as isotropic: one covariance serves its three axes, which keeps the filter a
handful of scalars and free of any frame.
"""

from __future__ import annotations

from autopilot.estimation.records import (
    HISTORY_LENGTH,
    Q_CABLE,
    QUAT,
    X_LOAD,
    X_QUAD,
    Covariance2,
    EstimatorState,
    EstimatorTuning,
    History,
    ImuReading,
    LoadEstimate,
    VehicleEstimate,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, apply, axpy, dot, norm, scale, sub
from autopilot.geometry.s2 import normalise, tangent
from autopilot.geometry.so3 import quat_exp, quat_multiply, quat_normalise, rotation_from_quat

TAUT_ABOVE = 0.985  # share of the cable length at which a slack cable counts as taut
SLACK_BELOW = 0.965  # and at which a taut one counts as slack
SLACK_CABLE_ACCEL_STD = 20.0  # rad/s^2: no model holds while slack
SLACK_LOAD_ACCEL_STD = 10.0  # m/s^2: free fall or rest on the ground, it is not known which


@kernel
def grow2(cov: Covariance2, dt: float, rate_std: float) -> Covariance2:
    """Covariance of (value, rate) after dt with white noise of `rate_std` dt on the rate."""
    aa, ab, bb = cov
    return (aa + 2.0 * dt * ab + dt * dt * bb, ab + dt * bb, bb + rate_std * rate_std * dt * dt)


@kernel
def remember(state: EstimatorState, history: History) -> None:
    """Write the state into its row of the ring."""
    row = history[state.head]
    row[0] = state.time_s
    for i in range(3):
        row[X_QUAD + i] = state.vehicle.x_quad[i]
        row[X_LOAD + i] = state.load.x_load[i]
        row[Q_CABLE + i] = state.load.q_cable[i]
    for i in range(4):
        row[QUAT + i] = state.vehicle.quat_wxyz[i]


@kernel
def _mean(a: Vec3, b: Vec3) -> Vec3:
    return scale(0.5, add(a, b))


@kernel
def predict_vehicle(
    vehicle: VehicleEstimate, imu: ImuReading, last: ImuReading, tuning: EstimatorTuning, dt: float
) -> VehicleEstimate:
    """Strapdown integration by the trapezoidal rule over the last two samples."""
    gyro = sub(_mean(imu.gyro, last.gyro), vehicle.gyro_bias)
    accel = sub(_mean(imu.accel, last.accel), vehicle.accel_bias)
    half = quat_multiply(vehicle.quat_wxyz, quat_exp(scale(0.5 * dt, gyro)))
    quat = quat_normalise(quat_multiply(vehicle.quat_wxyz, quat_exp(scale(dt, gyro))))
    force = apply(rotation_from_quat(half), accel)  # specific force, ENU
    accel_quad = (force[0], force[1], force[2] - tuning.gravity)

    # a bias acts with a minus sign: v' = R (a - b), theta' = omega - b
    pp, pv, pb, vv, vb, bb = vehicle.covariance
    h = 0.5 * dt * dt
    pp, pv, pb = (
        pp + 2.0 * dt * pv - 2.0 * h * pb + dt * dt * vv - 2.0 * dt * h * vb + h * h * bb,
        pv - dt * pb + dt * vv - dt * dt * vb - h * vb + dt * h * bb,
        pb + dt * vb - h * bb,
    )
    vv, vb = vv - 2.0 * dt * vb + dt * dt * bb, vb - dt * bb
    vv += tuning.accel_std * tuning.accel_std * dt * dt
    bb += tuning.accel_bias_walk * tuning.accel_bias_walk * dt
    aa, ag, gg = vehicle.attitude_covariance
    aa = aa - 2.0 * dt * ag + dt * dt * gg + tuning.gyro_std * tuning.gyro_std * dt * dt
    ag = ag - dt * gg
    gg = gg + tuning.gyro_bias_walk * tuning.gyro_bias_walk * dt
    return VehicleEstimate(
        axpy(0.5 * dt * dt, accel_quad, axpy(dt, vehicle.v_quad, vehicle.x_quad)),
        axpy(dt, accel_quad, vehicle.v_quad),
        quat,
        sub(imu.gyro, vehicle.gyro_bias),
        vehicle.gyro_bias,
        vehicle.accel_bias,
        accel_quad,
        (pp, pv, pb, vv, vb, bb),
        (aa, ag, gg),
        vehicle.age_s + dt,
        vehicle.rejected,
    )


@kernel
def predict_load(
    load: LoadEstimate, vehicle: VehicleEstimate, tuning: EstimatorTuning, dt: float
) -> LoadEstimate:
    """The pendulum while taut; while slack nothing but a wide noise. `vehicle` is already at the new time."""
    q, q_dot = load.q_cable, load.q_cable_dot
    if load.taut > 0.0:
        accel_quad = vehicle.accel_quad
        force = (accel_quad[0], accel_quad[1], accel_quad[2] + tuning.gravity)
        pull = scale(-1.0 / tuning.cable_length, tangent(q, force))
        q_ddot = axpy(-dot(q_dot, q_dot), q, pull)
        accel_load = axpy(tuning.cable_length, q_ddot, accel_quad)
        tension = max(0.0, -tuning.load_mass * (dot(q, accel_load) + tuning.gravity * q[2]))
        cable_std, load_std = tuning.cable_accel_std, tuning.load_accel_std
    else:
        q_ddot = (0.0, 0.0, 0.0)
        accel_load = (0.0, 0.0, 0.0)
        tension = 0.0
        cable_std, load_std = SLACK_CABLE_ACCEL_STD, SLACK_LOAD_ACCEL_STD
    q_next = normalise(axpy(0.5 * dt * dt, q_ddot, axpy(dt, q_dot, q)))
    x_load = axpy(0.5 * dt * dt, accel_load, axpy(dt, load.v_load, load.x_load))
    distance = norm(sub(x_load, vehicle.x_quad))
    taut = load.taut
    if distance > TAUT_ABOVE * tuning.cable_length:
        taut = 1.0
    elif distance < SLACK_BELOW * tuning.cable_length:
        taut, tension = 0.0, 0.0
    return LoadEstimate(
        x_load,
        axpy(dt, accel_load, load.v_load),
        q_next,
        tangent(q_next, axpy(dt, q_ddot, q_dot)),
        grow2(load.covariance, dt, load_std),
        grow2(load.cable_covariance, dt, cable_std),
        taut,
        tension,
        load.age_s + dt,
        load.rejected,
    )


@kernel
def predict(
    state: EstimatorState, history: History, imu: ImuReading, tuning: EstimatorTuning, dt: float
) -> EstimatorState:
    """The state dt seconds on; `history` receives it."""
    vehicle = predict_vehicle(state.vehicle, imu, state.last_imu, tuning, dt)
    predicted = EstimatorState(
        state.time_s + dt,
        vehicle,
        predict_load(state.load, vehicle, tuning, dt),
        imu,
        state.resets,
        (state.head + 1) % HISTORY_LENGTH,
    )
    remember(predicted, history)
    return predicted
