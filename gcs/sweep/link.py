"""What the simulator link and the estimator make of the sensors' readings: one tick, in machine code.

Readings pass through the rounding that the wire would give them (single precision in NED and FRD), so that a
flight without a wire is the same flight.
"""

from __future__ import annotations

from math import cos, isfinite, nan, pi, radians, sqrt
from typing import NamedTuple

import numpy as np

from autopilot.core.sensor_inbox import (
    GREATEST_ACCEL_M_S2,
    GREATEST_RATE_RAD_S,
    LEAST_ANGLE_STD_RAD,
    LEAST_DIRECTION_STD_RAD,
    LEAST_FIX_STD_M,
    LEAST_POSITION_STD_M,
    LEAST_VELOCITY_STD_M_S,
    OLDEST_READING_S,
)
from autopilot.estimation.filter import (
    ATTITUDE_STD_TO_FLY,
    COASTING_S,
    HEADING_STD_TO_FLY,
    LOAD_STD_TO_FLY,
    POSITION_STD_TO_FLY,
    PROMISE,
)
from autopilot.estimation.history import reading_age
from autopilot.estimation.measurements.barometer import correct_barometer
from autopilot.estimation.measurements.direction import correct_direction
from autopilot.estimation.measurements.gnss import correct_gnss
from autopilot.estimation.measurements.load import correct_load
from autopilot.estimation.measurements.magnetic import correct_magnetic
from autopilot.estimation.measurements.pose import correct_pose
from autopilot.estimation.measurements.standing import correct_standing
from autopilot.estimation.measurements.tautened import correct_tautened
from autopilot.estimation.predict import predict
from autopilot.estimation.records import (
    CAMERA,
    RECEIVER,
    DirectionReading,
    EstimatorState,
    EstimatorTuning,
    GnssReading,
    History,
    ImuReading,
    LoadReading,
    PoseReading,
)
from autopilot.geometry.frames import quat_enu_flu_from_ned_frd, quat_ned_frd_from_enu_flu
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, norm, scale
from autopilot.wire.convert import Home
from autopilot.wire.convert.geodesy import EARTH_RADIUS_M
from autopilot.wire.convert.scaling import saturated
from autopilot.wire.convert.simulator import ROTOR_FMAX
from gcs.sweep.world import (
    BARO,
    CABLE,
    GNSS,
    IMU,
    LOAD,
    MAG,
    MOCAP,
    READING,
    SHOWS,
    Buffers,
    Floats,
    arrived,
)
from sitl.plant.records import Rotors
from sitl.sensors.profile import Profile, stated_of


class LinkModel(NamedTuple):
    """The deviations that the trackers state, as they arrive; negative for velocities not measured."""

    pose_position_std: float
    pose_attitude_std: float
    pose_velocity_std: float
    load_position_std: float
    load_velocity_std: float
    direction_std: float
    fix_horizontal_std: float
    fix_vertical_std: float
    rtk: float  # 1.0: fixes with carrier phase
    home: Vec3  # degrees north and east, m
    metres_per_degree: float
    east_metres_per_degree: float
    cosine: float  # of the latitude


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
def _fix(row: Floats, age_s: float, link: LinkModel) -> GnssReading:
    """A fix as HIL_GPS carries it: position in 1e-7 degrees and millimetres, velocity in centimetres."""
    home, scale_north, scale_east = link.home, link.metres_per_degree, link.east_metres_per_degree
    east_deg = row[READING] / scale_east
    north_deg = row[READING + 1] / scale_north
    latitude = np.rint((home[0] + north_deg) / 1e-7)
    longitude = np.rint((home[1] + east_deg) / 1e-7)
    altitude = np.rint((home[2] + row[READING + 2]) * 1e3)
    position = (
        (longitude * 1e-7 - home[1]) * scale_north * link.cosine,
        (latitude * 1e-7 - home[0]) * scale_north,
        altitude * 1e-3 - home[2],
    )
    velocity = (
        np.rint(row[READING + 3] * 100.0) * 0.01,
        np.rint(row[READING + 4] * 100.0) * 0.01,
        -(np.rint(-row[READING + 5] * 100.0) * 0.01),
    )
    return GnssReading(age_s, position, velocity, link.fix_horizontal_std, link.fix_vertical_std, link.rtk)


@kernel
def _age(row: Floats, now_us: int, tuning: EstimatorTuning) -> float:
    return reading_age(now_us - row[SHOWS], tuning.imu_age)


@kernel
def _fresh(row: Floats, now_us: int, tuning: EstimatorTuning) -> bool:
    return bool(row[SHOWS] <= now_us and _age(row, now_us, tuning) <= OLDEST_READING_S)


@kernel
def inertial_of(inertial: ImuReading, now_us: int, buffers: Buffers) -> ImuReading:
    """What HIL_SENSOR says of the inertial unit: its newest reading, or again the last one."""
    at = arrived(IMU, now_us, buffers)
    while at >= 0:
        row = buffers.queue[IMU, at]
        inertial = ImuReading(_single3(row, READING + 3), _single3(row, READING))
        at = arrived(IMU, now_us, buffers)
    return inertial


@kernel
def by_poses(
    state: EstimatorState,
    history: History,
    now_us: int,
    buffers: Buffers,
    link: LinkModel,
    tuning: EstimatorTuning,
) -> EstimatorState:
    """The estimate after the pose tracker's readings of this tick."""
    at = arrived(MOCAP, now_us, buffers)
    while at >= 0:
        row = buffers.queue[MOCAP, at]
        pose = _pose(row, _age(row, now_us, tuning), link)
        q = pose.quat_wxyz
        sound = _finite3(pose.x_quad) and _finite3(pose.v_quad) and isfinite(q[0] + q[1] + q[2] + q[3])
        if sound and _fresh(row, now_us, tuning):
            state = correct_pose(state, history, pose, tuning)
        at = arrived(MOCAP, now_us, buffers)
    return state


@kernel
def by_loads(
    state: EstimatorState,
    history: History,
    now_us: int,
    buffers: Buffers,
    link: LinkModel,
    tuning: EstimatorTuning,
) -> EstimatorState:
    """The estimate after the load tracker's readings of this tick."""
    accepted = state.vehicle.rejected == 0.0
    at = arrived(LOAD, now_us, buffers)
    while at >= 0:
        row = buffers.queue[LOAD, at]
        load = _load(row, _age(row, now_us, tuning), link)
        sound = _finite3(load.x_load) and _finite3(load.v_load)
        if accepted and sound and _fresh(row, now_us, tuning):
            state = correct_load(state, history, load, tuning)
        at = arrived(LOAD, now_us, buffers)
    return state


@kernel
def by_field(
    state: EstimatorState, history: History, now_us: int, buffers: Buffers, tuning: EstimatorTuning
) -> EstimatorState:
    """The estimate after the magnetometer's newest reading of this tick."""
    newest = -1
    at = arrived(MAG, now_us, buffers)
    while at >= 0:
        newest = at
        at = arrived(MAG, now_us, buffers)
    if newest >= 0:
        field = _single3(buffers.queue[MAG, newest], READING)
        size = norm(field)
        if isfinite(size) and size > 0.0:
            state = correct_magnetic(state, history, field, tuning.magnetic_age, tuning)
    return state


@kernel
def by_fix(
    state: EstimatorState,
    history: History,
    now_us: int,
    buffers: Buffers,
    link: LinkModel,
    tuning: EstimatorTuning,
) -> EstimatorState:
    """The estimate after the receiver's newest fix of this tick."""
    newest = -1
    at = arrived(GNSS, now_us, buffers)
    while at >= 0:
        newest = at
        at = arrived(GNSS, now_us, buffers)
    if newest >= 0:
        row = buffers.queue[GNSS, newest]
        fix = _fix(row, _age(row, now_us, tuning), link)
        if _finite3(fix.position) and _finite3(fix.velocity) and _fresh(row, now_us, tuning):
            state = correct_gnss(state, history, fix, tuning)
    return state


@kernel
def by_height(
    state: EstimatorState,
    history: History,
    now_us: int,
    buffers: Buffers,
    link: LinkModel,
    tuning: EstimatorTuning,
) -> EstimatorState:
    """The estimate after the barometer's newest reading of this tick."""
    newest = -1
    at = arrived(BARO, now_us, buffers)
    while at >= 0:
        newest = at
        at = arrived(BARO, now_us, buffers)
    if newest >= 0:
        height = single(link.home[2] + buffers.queue[BARO, newest, READING]) - link.home[2]
        if isfinite(height):
            state = correct_barometer(state, history, height, tuning.barometer_age, tuning)
    return state


@kernel
def by_sights(
    state: EstimatorState,
    history: History,
    now_us: int,
    buffers: Buffers,
    link: LinkModel,
    tuning: EstimatorTuning,
) -> EstimatorState:
    """The estimate after the cable sensor's readings of this tick."""
    at = arrived(CABLE, now_us, buffers)
    while at >= 0:
        row = buffers.queue[CABLE, at]
        seen = _single3(row, READING)
        length = norm(seen)
        if row[READING + 3] > 0.0 and 0.5 < length < 2.0 and _fresh(row, now_us, tuning):
            sight = DirectionReading(_age(row, now_us, tuning), scale(1.0 / length, seen), link.direction_std)
            state = correct_direction(state, history, sight, tuning)
        at = arrived(CABLE, now_us, buffers)
    return state


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
    thrust: float,
) -> tuple[EstimatorState, ImuReading]:
    """The estimate after the readings of this tick, and what the inertial unit said last.

    As `sitl.hil`, `autopilot.core.sensor_inbox` and `autopilot.estimation.filter.estimate` one after the
    other.
    `thrust`, N, is what the rotors are believed to give.
    """
    inertial = inertial_of(inertial, now_us, buffers)
    used = state.last_imu
    if norm(inertial.accel) < GREATEST_ACCEL_M_S2 and norm(inertial.gyro) < GREATEST_RATE_RAD_S:
        used = inertial
    load = state.load
    state = predict(state, history, used, tuning, dt, thrust)
    state = correct_tautened(state, history, load, tuning)
    state = by_poses(state, history, now_us, buffers, link, tuning)
    state = by_field(state, history, now_us, buffers, tuning)
    state = by_fix(state, history, now_us, buffers, link, tuning)
    state = by_height(state, history, now_us, buffers, link, tuning)
    state = by_loads(state, history, now_us, buffers, link, tuning)
    state = by_sights(state, history, now_us, buffers, link, tuning)
    if state.vehicle.source == RECEIVER:
        state = correct_standing(state, history, tuning, thrust)
    return state, inertial


@kernel
def settled(state: EstimatorState, oldest_s: float) -> bool:
    """Whether `autopilot.estimation.filter.complaints` has nothing to say."""
    vehicle, load, doubt = state.vehicle, state.load, state.doubt
    if vehicle.source == RECEIVER:
        level = POSITION_STD_TO_FLY + PROMISE * state.aids.horizontal_slow
        flies = (
            vehicle.age_s <= max(oldest_s, COASTING_S)
            and doubt.horizontal <= level
            and doubt.relative <= level
            and doubt.tilt <= ATTITUDE_STD_TO_FLY
            and doubt.heading <= HEADING_STD_TO_FLY
        )
    else:
        flies = (
            vehicle.age_s <= oldest_s
            and doubt.horizontal <= POSITION_STD_TO_FLY
            and doubt.vertical <= POSITION_STD_TO_FLY
            and doubt.tilt <= ATTITUDE_STD_TO_FLY
            and doubt.heading <= ATTITUDE_STD_TO_FLY
        )
    if not flies:
        return False
    if load.source == CAMERA:
        return load.taut == 0.0 or (load.age_s <= oldest_s and doubt.load <= LOAD_STD_TO_FLY)
    return load.age_s <= oldest_s and doubt.load <= POSITION_STD_TO_FLY


def link_model(profile: Profile, noise_scale: float, home: Home) -> LinkModel:
    """What the trackers of a profile state, rounded as their messages round it."""
    stated = stated_of(profile, noise_scale)
    mocap, load = profile.mocap, profile.load_tracker

    def root(std: float) -> float:
        """Of a variance that was sent."""
        variance = float(np.float32(std * std))
        return sqrt(variance) if variance >= 0.0 else nan

    def at_least(value: float, least: float) -> float:
        return value if value > least else least

    metres, cosine = EARTH_RADIUS_M * pi / 180.0, cos(radians(home.latitude_deg))
    measured = mocap is not None and mocap.velocity_noise_m_s is not None
    load_measured = load is not None and load.velocity_noise_m_s is not None
    return LinkModel(
        at_least(root(stated.mocap_position), LEAST_POSITION_STD_M),
        at_least(root(stated.mocap_attitude), LEAST_ANGLE_STD_RAD),
        at_least(root(stated.mocap_velocity), LEAST_VELOCITY_STD_M_S) if measured else -1.0,
        at_least(float(np.float32(stated.load_position)), LEAST_POSITION_STD_M),
        at_least(float(np.float32(stated.load_velocity)), LEAST_VELOCITY_STD_M_S) if load_measured else -1.0,
        at_least(float(np.float32(stated.direction)), LEAST_DIRECTION_STD_RAD),
        at_least(saturated(stated.gnss_horizontal * 100.0, 0, 0xFFFE) * 0.01, LEAST_FIX_STD_M),
        at_least(saturated(stated.gnss_vertical * 100.0, 0, 0xFFFE) * 0.01, LEAST_FIX_STD_M),
        1.0 if profile.gnss is not None and profile.gnss.fix == "rtk" else 0.0,
        (home.latitude_deg, home.longitude_deg, home.altitude_m),
        metres,
        metres * cosine,
        cosine,
    )
