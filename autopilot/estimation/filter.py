"""The estimator as the flight core sees it: one call for each tick's readings."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.records import State
from autopilot.estimation.correct_load import correct_load
from autopilot.estimation.correct_pose import correct_pose
from autopilot.estimation.predict import predict
from autopilot.estimation.records import (
    EstimatorState,
    EstimatorTuning,
    History,
    ImuReading,
    LoadReading,
    PoseReading,
)
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.wire.parameters import ParameterTable

POSITION_STD_TO_FLY = 0.05  # m
ATTITUDE_STD_TO_FLY = 0.05  # rad


class Readings(NamedTuple):
    """What the sensors said since the last tick; poses and loads in the order in which they came.

    `imu` is None where the sample was no number or beyond any sensor's range: the last one serves again.
    """

    imu: ImuReading | None
    poses: tuple[PoseReading, ...] = ()
    loads: tuple[LoadReading, ...] = ()


def estimator_tuning(table: ParameterTable) -> EstimatorTuning:
    """The estimator's beliefs from the VEH_ and EST_ parameters."""
    return EstimatorTuning(
        cable_length=table["VEH_CABLE_LEN"],
        load_mass=table["VEH_LOAD_MASS"],
        gravity=table["VEH_GRAVITY"],
        gyro_std=table["EST_GYRO_STD"],
        accel_std=table["EST_ACC_STD"],
        gyro_bias_walk=table["EST_GYRO_WALK"],
        accel_bias_walk=table["EST_ACC_WALK"],
        cable_accel_std=table["EST_CABLE_STD"],
        load_accel_std=table["EST_LOAD_STD"],
        gate_sigma=table["EST_GATE"],
    )


def estimate(
    state: EstimatorState, history: History, readings: Readings, tuning: EstimatorTuning, dt: float
) -> EstimatorState:
    """The state after `dt` seconds and the readings. `history` is written in place."""
    state = predict(state, history, readings.imu or state.last_imu, tuning, dt)
    for pose in readings.poses:
        state = correct_pose(state, history, pose, tuning)
    if state.vehicle.rejected == 0.0:
        for load in readings.loads:
            state = correct_load(state, history, load, tuning)
    return state


def control_state(state: EstimatorState) -> State:
    """What the laws are told."""
    vehicle, load = state.vehicle, state.load
    return State(
        load.x_load,
        load.v_load,
        load.q_cable,
        load.q_cable_dot,
        vehicle.x_quad,
        vehicle.v_quad,
        rotation_from_quat(vehicle.quat_wxyz),
        vehicle.omega_body,
        vehicle.accel_quad,
    )


def complaints(state: EstimatorState, oldest_s: float) -> tuple[str, ...]:
    """What keeps the estimate from being flown on, in words for the operator; empty if nothing does."""
    vehicle, load = state.vehicle, state.load
    position_var, angle_var = POSITION_STD_TO_FLY**2, ATTITUDE_STD_TO_FLY**2
    found = []
    # each is written so that NaN complains
    if not vehicle.age_s <= oldest_s:
        found.append("no vehicle pose from a tracker")
    elif not 0.0 <= vehicle.covariance[0] <= position_var:
        found.append("vehicle position not settled")
    elif not 0.0 <= vehicle.attitude_covariance[0] <= angle_var:
        found.append("vehicle attitude not settled")
    if not load.age_s <= oldest_s:
        found.append("no load position from a tracker")
    elif not 0.0 <= load.covariance[0] <= position_var:
        found.append("load position not settled")
    return tuple(found)
