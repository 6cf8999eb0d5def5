"""Correction of a vehicle on the ground: no velocity, no rate. It gives tilt and the gyroscope's bias.

A vehicle that wind slides over the ground does not rest there: its fixes show it.
"""

from __future__ import annotations

from math import sqrt

from autopilot.estimation.correction import inject_error
from autopilot.estimation.covariance import (
    add_jacobian_entry,
    compute_gain_rows,
    fuse_scalars,
    start_correction,
    start_scalar,
)
from autopilot.estimation.records import (
    GYRO_BIAS,
    RECEIVER,
    VELOCITY,
    ZERO_VELOCITY,
    EstimatorState,
    EstimatorTuning,
    History,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, norm, sub

IDLE_SHARE = 0.3  # of the vehicle's weight: with less thrust it is on the ground, unless it falls
STILL_RATE, STILL_FORCE = 0.1, 1.0  # rad/s, m/s^2 about gravity: above these, the vehicle does not stand
STILL_SPEED = 0.2  # m/s, estimated
STANDING_SHARE = 0.05  # of the vehicle's weight: with less thrust its rotors stand or idle
SPEED_STD = 0.02  # m/s


@kernel
def is_carried_by_ground(
    state: EstimatorState, tuning: EstimatorTuning, thrust: float, max_share: float
) -> bool:
    """Whether the vehicle is on the ground, by its IMU and a thrust below this share of its weight."""
    vehicle, imu = state.vehicle, state.last_imu
    return (
        vehicle.source == RECEIVER
        and thrust < max_share * tuning.quad_mass * tuning.gravity
        and norm(imu.gyro) < STILL_RATE
        and abs(norm(imu.accel) - tuning.gravity) < STILL_FORCE
    )


@kernel
def slides(
    state: EstimatorState, tuning: EstimatorTuning, thrust: float, velocity: Vec3, speed_std: float
) -> bool:
    """Whether a fix of this velocity (m/s, with this deviation) shows that wind slides a vehicle whose rotors
    stand over the ground, faster or slower than estimated."""
    difference = sub(velocity, state.vehicle.v_quad)
    level = sqrt(difference[0] * difference[0] + difference[1] * difference[1])
    return is_carried_by_ground(state, tuning, thrust, STANDING_SHARE) and level > max(
        STILL_SPEED, tuning.gate_sigma * speed_std
    )


@kernel
def correct_zero_velocity(
    state: EstimatorState, history: History, tuning: EstimatorTuning, thrust: float
) -> EstimatorState:
    """The state of a vehicle that rests on the ground, corrected; otherwise the state unchanged."""
    if not (
        is_carried_by_ground(state, tuning, thrust, IDLE_SHARE) and norm(state.vehicle.v_quad) < STILL_SPEED
    ):
        return state
    n, vehicle, imu = state.size, state.vehicle, state.last_imu
    start_correction(history)
    for i in range(3):
        start_scalar(history, i, -vehicle.v_quad[i], SPEED_STD * SPEED_STD)
        add_jacobian_entry(history, i, VELOCITY + i, 1.0)
        start_scalar(history, 3 + i, imu.gyro[i] - vehicle.gyro_bias[i], tuning.gyro_std * tuning.gyro_std)
        add_jacobian_entry(history, 3 + i, GYRO_BIAS + i, 1.0)
    compute_gain_rows(history, 0, 6, n)
    nis = fuse_scalars(history, 6, n)
    history.consistency[ZERO_VELOCITY, 0] += 1.0
    history.consistency[ZERO_VELOCITY, 1] += nis
    return inject_error(state, history)
