"""Correction by a pose tracker: position, attitude and, if measured, velocity of the vehicle."""

from __future__ import annotations

from autopilot.estimation.correction import (
    add_attitude_jacobian,
    add_position_jacobian,
    add_velocity_jacobian,
    corrected_load,
    inject_error,
    past_state,
    restarted_vehicle,
    vehicle_with_status,
    with_capacity,
    with_load,
    with_vehicle,
)
from autopilot.estimation.covariance import (
    compute_gain_rows,
    fuse_scalars,
    start_correction,
    start_scalar,
    within_gate,
    zero_covariance,
)
from autopilot.estimation.records import (
    ACCEL_BIAS,
    AIR,
    ATTITUDE,
    BAROMETER,
    GNSS,
    GYRO_BIAS,
    HEADING,
    MOUNTING,
    POSE,
    POSITION,
    PUSH,
    TRACKED_SIZE,
    TRACKER,
    VELOCITY,
    Array,
    EstimatorState,
    EstimatorTuning,
    History,
    PoseReading,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import IDENTITY as AXES
from autopilot.geometry.linear import ZERO, sub
from autopilot.geometry.so3 import quat_conjugate, quat_log, quat_multiply

REJECTIONS_BEFORE_RESET = 50.0
# An impact (the ground, a cable that comes taut) falls between two samples of the accelerometer: after
# REJECTIONS_BEFORE_IMPACT rejections the velocity may have changed by about IMPACT_SPEED_STD, m/s, soon after
# the last accepted reading, and the position is off by the resulting drift.
REJECTIONS_BEFORE_IMPACT, IMPACT_SPEED_STD = 4.0, 0.3
IMPACT_TIME_SHARE = 0.25  # of the time since then: how uncertain the instant of the impact is
INITIAL_SPEED_STD = 1.0  # m/s, where no velocity is measured
INITIAL_OFFSET_STD = 1.0  # m, of the barometer's zero


@kernel
def set_initial_covariance(
    history: History, position_var: float, velocity_var: float, attitude_var: float, tuning: EstimatorTuning
) -> None:
    """Set the covariance of a vehicle that starts: these variances, and no correlation with anything else."""
    P = history.covariance
    zero_covariance(P, POSITION, 15)
    for i in range(3):
        P[POSITION + i, POSITION + i] = position_var
        P[VELOCITY + i, VELOCITY + i] = velocity_var
        P[ATTITUDE + i, ATTITUDE + i] = attitude_var
        P[GYRO_BIAS + i, GYRO_BIAS + i] = tuning.gyro_bias_std * tuning.gyro_bias_std
        P[ACCEL_BIAS + i, ACCEL_BIAS + i] = tuning.accel_bias_std * tuning.accel_bias_std
    if P[MOUNTING, MOUNTING] == 0.0:
        for i in range(2):
            P[AIR + i, AIR + i] = tuning.air_std * tuning.air_std
            P[PUSH + i, PUSH + i] = tuning.push_std * tuning.push_std
        P[MOUNTING, MOUNTING] = tuning.mounting_std * tuning.mounting_std
        P[MOUNTING + 1, MOUNTING + 1] = P[MOUNTING, MOUNTING]
        P[HEADING, HEADING] = tuning.magnetic_bias * tuning.magnetic_bias
        P[BAROMETER, BAROMETER] = INITIAL_OFFSET_STD * INITIAL_OFFSET_STD
        for i in range(3):
            P[GNSS + i, GNSS + i] = 1.0


@kernel
def start_from_pose(
    state: EstimatorState, history: History, pose: PoseReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The vehicle set to the reading, with the reading's own uncertainty and that due to its age."""
    old, age = state.vehicle, pose.age_s
    measured = pose.velocity_std >= 0.0
    speed_std = pose.velocity_std if measured else INITIAL_SPEED_STD
    velocity_var = speed_std * speed_std
    set_initial_covariance(
        history,
        pose.position_std * pose.position_std + age * age * velocity_var,
        velocity_var,
        pose.attitude_std * pose.attitude_std,
        tuning,
    )
    P = history.covariance
    for i in range(3):
        P[POSITION + i, VELOCITY + i] = age * velocity_var
        P[VELOCITY + i, POSITION + i] = age * velocity_var
    velocity = pose.v_quad if measured else ZERO
    vehicle = restarted_vehicle(old, history, pose.x_quad, velocity, pose.quat_wxyz, age, TRACKER)
    start_correction(history)
    load = corrected_load(state.load, vehicle, history, 0.0)
    return with_load(with_vehicle(state, vehicle, state.resets + 1.0), load, state.resets + 1.0)


@kernel
def add_impact_uncertainty(P: Array, value: int, rate: int, std: float, age_s: float) -> None:
    """Make a value and its rate less certain: the rate has changed by `std` some `age_s` seconds ago."""
    variance = std * std
    P[value, value] += (1.0 + IMPACT_TIME_SHARE * IMPACT_TIME_SHARE) * age_s * age_s * variance
    P[value, rate] += age_s * variance
    P[rate, value] += age_s * variance
    P[rate, rate] += variance


@kernel
def correct_pose(
    state: EstimatorState, history: History, pose: PoseReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after the reading; `history` is corrected along with it.

    The first reading starts the vehicle; many rejected readings in a row restart it.
    """
    state = with_capacity(state, pose.age_s, TRACKED_SIZE)
    n = state.size
    if state.vehicle.source != TRACKER:
        return start_from_pose(state, history, pose, tuning)
    past = past_state(state, history, tuning, pose.age_s)
    innovation = sub(pose.x_quad, past.x_quad)
    position_var = pose.position_std * pose.position_std
    for i in range(3):
        start_scalar(history, i, innovation[i], position_var)
        add_position_jacobian(history, i, past, i)
    compute_gain_rows(history, 0, 3, n)
    if not within_gate(history, POSE, 3, tuning.gate_sigma):
        vehicle = state.vehicle
        if vehicle.rejected + 1.0 < REJECTIONS_BEFORE_RESET:
            if vehicle.rejected + 1.0 == REJECTIONS_BEFORE_IMPACT:
                for i in range(3):
                    add_impact_uncertainty(
                        history.covariance, POSITION + i, VELOCITY + i, IMPACT_SPEED_STD, vehicle.age_s
                    )
            rejected_vehicle = vehicle_with_status(vehicle, vehicle.age_s, vehicle.rejected + 1.0)
            return with_vehicle(state, rejected_vehicle, state.resets)
        return start_from_pose(state, history, pose, tuning)
    start_correction(history)
    velocity_var = pose.velocity_std * pose.velocity_std
    attitude_var = pose.attitude_std * pose.attitude_std
    difference = sub(pose.v_quad, past.v_quad)
    angle = quat_log(quat_multiply(pose.quat_wxyz, quat_conjugate(past.quat_wxyz)))
    count = 9 if pose.velocity_std >= 0.0 else 6
    for i in range(3):
        start_scalar(history, 3 + i, angle[i], attitude_var)
        add_attitude_jacobian(history, 3 + i, past, AXES[i])
        start_scalar(history, 6 + i, difference[i], velocity_var)
        add_velocity_jacobian(history, 6 + i, past, i)
    compute_gain_rows(history, 3, count, n)
    # the reading contains nothing of the gyroscope's noise since then, which is in the attitude of now; with
    # a gain K, the filter nevertheless removes Q (1 - (1 - K)^2) of its variance Q, which is added again
    # below
    P, gyro_var = history.covariance, state.vibration.attitude_var_rate * pose.age_s
    attitude_vars = (P[ATTITUDE, ATTITUDE], P[ATTITUDE + 1, ATTITUDE + 1], P[ATTITUDE + 2, ATTITUDE + 2])
    nis = fuse_scalars(history, count, n)
    for i in range(3):
        share_left = attitude_var / (attitude_vars[i] + attitude_var)
        P[ATTITUDE + i, ATTITUDE + i] += gyro_var * (1.0 - share_left * share_left)
    history.consistency[POSE, 0] += 1.0
    history.consistency[POSE, 1] += nis
    state = inject_error(state, history)
    return with_vehicle(state, vehicle_with_status(state.vehicle, pose.age_s, 0.0), state.resets)
