"""Correction by standing on the ground: no velocity, no rate. It gives tilt and the gyroscope's bias."""

from __future__ import annotations

from autopilot.estimation.correction import inject
from autopilot.estimation.covariance import absorb, begin, enter, gather, scalar
from autopilot.estimation.records import (
    GYRO_BIAS,
    RECEIVER,
    REST,
    VELOCITY,
    EstimatorState,
    EstimatorTuning,
    History,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import norm

IDLE_SHARE = 0.3  # of the vehicle's weight: with less thrust it stands, unless it falls
STILL_RATE, STILL_FORCE = 0.1, 1.0  # rad/s, m/s^2 about gravity: above these, the vehicle does not stand
STILL_SPEED = 0.5  # m/s, estimated
SPEED_STD = 0.02  # m/s


@kernel
def stands(state: EstimatorState, tuning: EstimatorTuning, thrust: float) -> bool:
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
def correct_standing(
    state: EstimatorState, history: History, tuning: EstimatorTuning, thrust: float
) -> EstimatorState:
    """The state of a vehicle that rests on the ground, corrected; otherwise the state unchanged."""
    if not stands(state, tuning, thrust):
        return state
    n, vehicle, imu = state.size, state.vehicle, state.last_imu
    begin(history)
    for i in range(3):
        scalar(history, i, -vehicle.v_quad[i], SPEED_STD * SPEED_STD)
        enter(history, i, VELOCITY + i, 1.0)
        scalar(history, 3 + i, imu.gyro[i] - vehicle.gyro_bias[i], tuning.gyro_std * tuning.gyro_std)
        enter(history, 3 + i, GYRO_BIAS + i, 1.0)
    gather(history, 0, 6, n)
    nis = absorb(history, 6, n)
    history.consistency[REST, 0] += 1.0
    history.consistency[REST, 1] += nis
    return inject(state, history)
