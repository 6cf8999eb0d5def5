"""Correction by a pose tracker: position, attitude and, if measured, velocity of the vehicle."""

from __future__ import annotations

from autopilot.estimation.history import look_back, renew, shift, turn
from autopilot.estimation.records import (
    ACCEL_BIAS_STD,
    GYRO_BIAS_STD,
    HISTORY_LENGTH,
    QUAT,
    X_QUAD,
    Covariance3,
    EstimatorState,
    EstimatorTuning,
    History,
    PoseReading,
    VehicleEstimate,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, apply_transposed, axpy, dot, scale, sub
from autopilot.geometry.so3 import (
    quat_conjugate,
    quat_exp,
    quat_log,
    quat_multiply,
    quat_normalise,
    rotation_from_quat,
)

REJECTIONS_BEFORE_RESET = 20.0


@kernel
def gate(innovation: Vec3, variance: float, sigma: float) -> bool:
    """Whether the innovation of three axes lies within `sigma` standard deviations of each."""
    return dot(innovation, innovation) <= 3.0 * sigma * sigma * variance


@kernel
def start_vehicle(vehicle: VehicleEstimate, pose: PoseReading) -> VehicleEstimate:
    """The vehicle set to the reading, with the reading's own uncertainty and that of its age."""
    measured = pose.velocity_std >= 0.0
    age = pose.age_s
    position_var = pose.position_std * pose.position_std
    velocity_var = pose.velocity_std * pose.velocity_std if measured else 1.0
    return VehicleEstimate(
        pose.x_quad,
        pose.v_quad if measured else (0.0, 0.0, 0.0),
        pose.quat_wxyz,
        vehicle.omega_body,
        vehicle.gyro_bias,
        vehicle.accel_bias,
        vehicle.accel_quad,
        (
            position_var + age * age * velocity_var,
            age * velocity_var,
            0.0,
            velocity_var,
            0.0,
            ACCEL_BIAS_STD * ACCEL_BIAS_STD,
        ),
        (pose.attitude_std * pose.attitude_std, 0.0, GYRO_BIAS_STD * GYRO_BIAS_STD),
        pose.age_s,
        0.0,
    )


@kernel
def with_vehicle(state: EstimatorState, vehicle: VehicleEstimate, resets: float) -> EstimatorState:
    """The state with its vehicle replaced."""
    return EstimatorState(state.time_s, vehicle, state.load, state.last_imu, resets, state.head)


@kernel
def refuse_pose(v: VehicleEstimate) -> VehicleEstimate:
    """The vehicle with one more reading refused."""
    return VehicleEstimate(
        v.x_quad,
        v.v_quad,
        v.quat_wxyz,
        v.omega_body,
        v.gyro_bias,
        v.accel_bias,
        v.accel_quad,
        v.covariance,
        v.attitude_covariance,
        v.age_s,
        v.rejected + 1.0,
    )


@kernel
def _update3(cov: Covariance3, h: Vec3, variance: float) -> tuple[float, float, float, Covariance3]:
    """Gains of a scalar measurement of h . (position, velocity, bias), and the covariance after it."""
    pp, pv, pb, vv, vb, bb = cov
    hp = pp * h[0] + pv * h[1] + pb * h[2]
    hv = pv * h[0] + vv * h[1] + vb * h[2]
    hb = pb * h[0] + vb * h[1] + bb * h[2]
    s = 1.0 / (h[0] * hp + h[1] * hv + h[2] * hb + variance)
    kp, kv, kb = s * hp, s * hv, s * hb
    after = (pp - kp * hp, pv - kp * hv, pb - kp * hb, vv - kv * hv, vb - kv * hb, bb - kb * hb)
    return kp, kv, kb, after


@kernel
def past_variance(cov: Covariance3, age: float) -> float:
    """Variance of the position `age` seconds ago, seen from the present: p - age v - age^2 / 2 b."""
    pp, pv, pb, vv, vb, bb = cov
    h = 0.5 * age * age
    return pp - 2.0 * age * pv - 2.0 * h * pb + age * age * vv + 2.0 * age * h * vb + h * h * bb


@kernel
def correct_pose(
    state: EstimatorState, history: History, pose: PoseReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after the reading; `history` is corrected along with it.

    The first reading starts the vehicle; readings refused many times in a row start it anew.
    """
    vehicle = state.vehicle
    since = state.time_s - pose.age_s
    past = look_back(state.head, history, since, X_QUAD)
    innovation = sub(pose.x_quad, (past[0], past[1], past[2]))
    position_var = pose.position_std * pose.position_std
    starting = vehicle.age_s == float("inf")
    if not starting and not gate(
        innovation, past_variance(vehicle.covariance, pose.age_s) + position_var, tuning.gate_sigma
    ):
        if vehicle.rejected + 1.0 < REJECTIONS_BEFORE_RESET:
            return with_vehicle(state, refuse_pose(vehicle), state.resets)
        starting = True
    if starting:
        started = with_vehicle(state, start_vehicle(vehicle, pose), state.resets + 1.0)
        renew(history, X_QUAD, pose.x_quad)
        for i in range(HISTORY_LENGTH):
            for j in range(4):
                history[i, QUAT + j] = pose.quat_wxyz[j]
        return started

    R = rotation_from_quat(vehicle.quat_wxyz)
    age = pose.age_s
    kp, kv, kb, cov = _update3(vehicle.covariance, (1.0, -age, -0.5 * age * age), position_var)
    moved, faster = scale(kp, innovation), scale(kv, innovation)
    x_quad = add(vehicle.x_quad, moved)
    v_quad = axpy(kv, innovation, vehicle.v_quad)
    accel_bias = axpy(kb, apply_transposed(R, innovation), vehicle.accel_bias)
    if pose.velocity_std >= 0.0:
        difference = sub(pose.v_quad, axpy(-age, vehicle.accel_quad, v_quad))
        kp, kv, kb, cov = _update3(cov, (0.0, 1.0, age), pose.velocity_std * pose.velocity_std)
        moved, faster = axpy(kp, difference, moved), axpy(kv, difference, faster)
        x_quad = axpy(kp, difference, x_quad)
        v_quad = axpy(kv, difference, v_quad)
        accel_bias = axpy(kb, apply_transposed(R, difference), accel_bias)
    shift(state.head, history, since, X_QUAD, moved, faster)

    past_quat = quat_normalise(look_back(state.head, history, since, QUAT))
    angle = quat_log(quat_multiply(quat_conjugate(past_quat), pose.quat_wxyz))
    aa, ag, gg = vehicle.attitude_covariance
    ha, hg = aa + age * ag, ag + age * gg
    s = 1.0 / (ha + age * hg + pose.attitude_std * pose.attitude_std)
    turned = quat_exp(scale(s * ha, angle))
    turn(state.head, history, since, turned)
    corrected = VehicleEstimate(
        x_quad,
        v_quad,
        quat_normalise(quat_multiply(vehicle.quat_wxyz, turned)),
        axpy(-s * hg, angle, vehicle.omega_body),
        axpy(s * hg, angle, vehicle.gyro_bias),
        accel_bias,
        vehicle.accel_quad,
        cov,
        (aa - s * ha * ha, ag - s * ha * hg, gg - s * hg * hg),
        pose.age_s,
        0.0,
    )
    return with_vehicle(state, corrected, state.resets)
