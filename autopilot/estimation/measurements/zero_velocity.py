"""Correction of a vehicle on the ground: no velocity, no rate. It gives tilt and the gyroscope's bias."""

from __future__ import annotations

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
from autopilot.geometry.linear import norm

IDLE_SHARE = 0.3  # of the vehicle's weight: with less thrust it is on the ground, unless it falls
STILL_RATE, STILL_FORCE = 0.1, 1.0  # rad/s, m/s^2 about gravity: above these, the vehicle does not stand
STILL_SPEED = 0.5  # m/s, estimated
SPEED_STD = 0.02  # m/s


@kernel
def is_on_ground(state: EstimatorState, tuning: EstimatorTuning, thrust: float) -> bool:
    """Whether the vehicle rests on the ground, by thrust and IMU."""
    vehicle, imu = state.vehicle, state.last_imu
    return (
        vehicle.source == RECEIVER
        and thrust < IDLE_SHARE * tuning.quad_mass * tuning.gravity
        and norm(imu.gyro) < STILL_RATE
        and abs(norm(imu.accel) - tuning.gravity) < STILL_FORCE
        and norm(vehicle.v_quad) < STILL_SPEED
    )


@kernel
def correct_zero_velocity(
    state: EstimatorState, history: History, tuning: EstimatorTuning, thrust: float
) -> EstimatorState:
    """The state of a vehicle that rests on the ground, corrected; otherwise the state unchanged."""
    if not is_on_ground(state, tuning, thrust):
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
