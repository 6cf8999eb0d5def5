"""What the simulator link and the estimator make of the sensors' readings: one tick, in machine code.

Readings pass through the rounding that the wire would give them (single precision in NED and FRD), so that a
flight without a wire is the same flight.
"""

from __future__ import annotations

from math import isfinite, nan, sqrt
from typing import NamedTuple

import numpy as np

from autopilot.estimation.correct_load import correct_load
from autopilot.estimation.correct_pose import correct_pose
from autopilot.estimation.filter import ATTITUDE_STD_TO_FLY, POSITION_STD_TO_FLY
from autopilot.estimation.predict import predict
from autopilot.estimation.records import (
    EstimatorState,
    EstimatorTuning,
    History,
    ImuReading,
    LoadReading,
    PoseReading,
)
from autopilot.geometry.frames import quat_enu_flu_from_ned_frd, quat_ned_frd_from_enu_flu
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, norm
from autopilot.sensor_link import (
    GREATEST_ACCEL_M_S2,
    GREATEST_RATE_RAD_S,
    LEAST_ANGLE_STD_RAD,
    LEAST_POSITION_STD_M,
    LEAST_VELOCITY_STD_M_S,
    OLDEST_READING_S,
)
from autopilot.wire.convert.simulator import ROTOR_FMAX
from gcs.sweep.world import IMU, LOAD, MOCAP, READING, SHOWS, Buffers, Floats, arrived
from sitl.plant.records import Rotors
from sitl.sensors.profile import Profile, stated_of


class LinkModel(NamedTuple):
    """The deviations that the trackers state, as they arrive; negative for velocities not measured."""

    pose_position_std: float
    pose_attitude_std: float
    pose_velocity_std: float
    load_position_std: float
    load_velocity_std: float


@kernel
def single(value: float) -> float:
    """`value` as a single-precision field of a message keeps it."""
    return np.float64(np.float32(value))


@kernel
def _single3(row: Floats, first: int) -> Vec3:
    return (single(row[first]), single(row[first + 1]), single(row[first + 2]))


@kernel
def _finite3(v: Vec3) -> bool:
    return isfinite(v[0]) and isfinite(v[1]) and isfinite(v[2])


@kernel
def wire_forces(forces: Rotors) -> Rotors:
    """Rotor forces (N) as HIL_ACTUATOR_CONTROLS carries them."""
    return (
        single(forces[0] / ROTOR_FMAX) * ROTOR_FMAX,
        single(forces[1] / ROTOR_FMAX) * ROTOR_FMAX,
        single(forces[2] / ROTOR_FMAX) * ROTOR_FMAX,
        single(forces[3] / ROTOR_FMAX) * ROTOR_FMAX,
    )


@kernel
def _pose(row: Floats, age_s: float, link: LinkModel) -> PoseReading:
    sent = quat_ned_frd_from_enu_flu((row[READING + 3], row[READING + 4], row[READING + 5], row[READING + 6]))
    quat = quat_enu_flu_from_ned_frd((single(sent[0]), single(sent[1]), single(sent[2]), single(sent[3])))
    v_quad = (0.0, 0.0, 0.0)
    if link.pose_velocity_std >= 0.0:
        v_quad = _single3(row, READING + 7)
    return PoseReading(
        age_s,
        _single3(row, READING),
        quat,
        v_quad,
        link.pose_position_std,
        link.pose_attitude_std,
        link.pose_velocity_std,
    )


@kernel
def _load(row: Floats, age_s: float, link: LinkModel) -> LoadReading:
    v_load = (0.0, 0.0, 0.0)
    if link.load_velocity_std >= 0.0:
        v_load = _single3(row, READING + 3)
    return LoadReading(age_s, _single3(row, READING), v_load, link.load_position_std, link.load_velocity_std)


@kernel
def estimate(
    state: EstimatorState,
    history: History,
    inertial: ImuReading,
    now_us: int,
    buffers: Buffers,
    link: LinkModel,
    tuning: EstimatorTuning,
    dt: float,
) -> tuple[EstimatorState, ImuReading]:
    """The estimate after the readings of this tick, and what the inertial unit said last.

    As `sitl.hil`, `autopilot.sensor_link` and `autopilot.estimation.filter.estimate` one after the other.
    """
    at = arrived(IMU, now_us, buffers)
    while at >= 0:
        row = buffers.queue[IMU, at]
        inertial = ImuReading(_single3(row, READING + 3), _single3(row, READING))
        at = arrived(IMU, now_us, buffers)
    used = state.last_imu
    if norm(inertial.accel) < GREATEST_ACCEL_M_S2 and norm(inertial.gyro) < GREATEST_RATE_RAD_S:
        used = inertial
    state = predict(state, history, used, tuning, dt)

    at = arrived(MOCAP, now_us, buffers)
    while at >= 0:
        row = buffers.queue[MOCAP, at]
        age_s = (now_us - row[SHOWS]) * 1e-6
        pose = _pose(row, age_s, link)
        q = pose.quat_wxyz
        sound = _finite3(pose.x_quad) and _finite3(pose.v_quad) and isfinite(q[0] + q[1] + q[2] + q[3])
        if 0.0 <= age_s <= OLDEST_READING_S and sound:
            state = correct_pose(state, history, pose, tuning)
        at = arrived(MOCAP, now_us, buffers)
    accepted = state.vehicle.rejected == 0.0
    at = arrived(LOAD, now_us, buffers)
    while at >= 0:
        row = buffers.queue[LOAD, at]
        age_s = (now_us - row[SHOWS]) * 1e-6
        load = _load(row, age_s, link)
        sound = _finite3(load.x_load) and _finite3(load.v_load)
        if accepted and 0.0 <= age_s <= OLDEST_READING_S and sound:
            state = correct_load(state, history, load, tuning)
        at = arrived(LOAD, now_us, buffers)
    return state, inertial


@kernel
def settled(state: EstimatorState, oldest_s: float) -> bool:
    """Whether `autopilot.estimation.filter.complaints` has nothing to say."""
    vehicle, load = state.vehicle, state.load
    position_var, angle_var = POSITION_STD_TO_FLY**2, ATTITUDE_STD_TO_FLY**2
    return (
        vehicle.age_s <= oldest_s
        and 0.0 <= vehicle.covariance[0] <= position_var
        and 0.0 <= vehicle.attitude_covariance[0] <= angle_var
        and load.age_s <= oldest_s
        and 0.0 <= load.covariance[0] <= position_var
    )


def link_model(profile: Profile, noise_scale: float) -> LinkModel:
    """What the trackers of a profile state, rounded as their messages round it."""
    stated = stated_of(profile, noise_scale)
    mocap, load = profile.mocap, profile.load_tracker

    def root(std: float) -> float:
        """Of a variance that was sent."""
        variance = float(np.float32(std * std))
        return sqrt(variance) if variance >= 0.0 else nan

    def at_least(value: float, least: float) -> float:
        return value if value > least else least

    measured = mocap is not None and mocap.velocity_noise_m_s is not None
    load_measured = load is not None and load.velocity_noise_m_s is not None
    return LinkModel(
        at_least(root(stated.mocap_position), LEAST_POSITION_STD_M),
        at_least(root(stated.mocap_attitude), LEAST_ANGLE_STD_RAD),
        at_least(root(stated.mocap_velocity), LEAST_VELOCITY_STD_M_S) if measured else -1.0,
        at_least(float(np.float32(stated.load_position)), LEAST_POSITION_STD_M),
        at_least(float(np.float32(stated.load_velocity)), LEAST_VELOCITY_STD_M_S) if load_measured else -1.0,
    )
