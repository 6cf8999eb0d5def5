"""The estimator as the flight core sees it: one call for each tick's readings."""

from __future__ import annotations

from math import radians
from typing import NamedTuple

from autopilot.control.records import State
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
from autopilot.geometry.linear import Vec3, sub
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.wire.parameter_table import ParameterTable

POSITION_STD_TO_FLY = 0.05  # m, with trackers, and beyond what a receiver promises
ATTITUDE_STD_TO_FLY = 0.05  # rad
HEADING_STD_TO_FLY = 0.15  # rad, by a magnetometer
LOAD_STD_TO_FLY = 0.1  # m from the vehicle, of a load that a camera sees
PROMISE = 1.2  # times the deviation that the receiver states
COASTING_S = 2.0  # that the IMU bridges between fixes


class Readings(NamedTuple):
    """What the sensors said since the last tick; each kind in the order in which it came.

    `imu` is None where the sample was no number or beyond any sensor's range: the last one serves again.
    """

    imu: ImuReading | None
    poses: tuple[PoseReading, ...] = ()
    loads: tuple[LoadReading, ...] = ()
    fixes: tuple[GnssReading, ...] = ()
    directions: tuple[DirectionReading, ...] = ()
    height_m: float | None = None  # by the barometer, over home
    field_body: Vec3 | None = None  # of the magnetometer


def estimator_tuning(table: ParameterTable) -> EstimatorTuning:
    """The estimator's beliefs from the VEH_ and EST_ parameters."""
    length = table["VEH_CABLE_LEN"]
    return EstimatorTuning(
        cable_length=length,
        quad_mass=table["VEH_QUAD_MASS"],
        load_mass=table["VEH_LOAD_MASS"],
        gravity=table["VEH_GRAVITY"],
        gyro_std=table["EST_GYRO_STD"],
        accel_std=table["EST_ACC_STD"],
        gyro_bias_std=table["EST_GYRO_BIAS"],
        accel_bias_std=table["EST_ACC_BIAS"],
        gyro_bias_walk=table["EST_GYRO_WALK"],
        accel_bias_walk=table["EST_ACC_WALK"],
        cable_accel_std=table["EST_CABLE_STD"],
        load_drag=table["EST_LOAD_DRAG"],
        length_std=table["EST_LEN_STD"],
        gate_sigma=table["EST_GATE"],
        imu_age=1e-3 * table["VEH_IMU_DELAY"],
        rtk_white=table["EST_RTK_NEW"],
        gnss_white=table["EST_GPS_NEW"],
        gnss_time=table["EST_GPS_TAU"],
        rtk_speed_std=table["EST_RTK_V_STD"],
        gnss_speed_std=table["EST_GPS_V_STD"],
        barometer_std=table["EST_BARO_STD"],
        barometer_walk=table["EST_BARO_WALK"],
        barometer_age=1e-3 * table["EST_BARO_LAT"],
        magnetic_std=table["EST_MAG_STD"],
        magnetic_bias=table["EST_MAG_BIAS"],
        magnetic_age=1e-3 * table["EST_MAG_LAT"],
        declination=radians(table["EST_MAG_DECL"]),
        mounting_std=table["EST_CAM_BIAS"],
        gear_height=table["EST_GEAR_H"],
        load_height=table["EST_LOAD_H"],
        laid_forward=table["EST_LAID_FWD"] * length,
        laid_std=table["EST_LAID_STD"] * length,
    )


def estimate(
    state: EstimatorState,
    history: History,
    readings: Readings,
    tuning: EstimatorTuning,
    dt: float,
    thrust: float = 0.0,
) -> EstimatorState:
    """The state after `dt` seconds and the readings. `history` is written in place.

    `thrust` (N) is what the rotors are believed to give.
    """
    load = state.load
    state = predict(state, history, readings.imu or state.last_imu, tuning, dt, thrust)
    state = correct_tautened(state, history, load, tuning)
    for pose in readings.poses:
        state = correct_pose(state, history, pose, tuning)
    if readings.field_body is not None:
        state = correct_magnetic(state, history, readings.field_body, tuning.magnetic_age, tuning)
    for fix in readings.fixes:
        state = correct_gnss(state, history, fix, tuning)
    if readings.height_m is not None:
        state = correct_barometer(state, history, readings.height_m, tuning.barometer_age, tuning)
    if state.vehicle.rejected == 0.0:
        for reading in readings.loads:
            state = correct_load(state, history, reading, tuning)
    for direction in readings.directions:
        state = correct_direction(state, history, direction, tuning)
    if state.vehicle.source == RECEIVER:
        state = correct_standing(state, history, tuning, thrust)
    return state


def control_state(state: EstimatorState) -> State:
    """What the laws are told.

    A plain receiver places the vehicle by metres, and every correction of its velocity moves the place by
    decimetres at once: those are passed on over seconds, so that the load is not sent after them.
    """
    vehicle, load, debt = state.vehicle, state.load, state.aids.debt
    return State(
        sub(load.x_load, debt),
        load.v_load,
        load.q_cable,
        load.q_cable_dot,
        sub(vehicle.x_quad, debt),
        vehicle.v_quad,
        rotation_from_quat(vehicle.quat_wxyz),
        vehicle.omega_body,
        vehicle.accel_quad,
    )


def complaints(state: EstimatorState, oldest_s: float, carries: bool = True) -> tuple[str, ...]:
    """What keeps the estimate from being flown on, in words for the operator; empty if nothing does.

    Where nothing is carried the load need not be known.
    """
    of_load = _of_load(state, oldest_s) if carries else ()
    return (*_of_vehicle(state, oldest_s), *of_load)


def _of_vehicle(state: EstimatorState, oldest_s: float) -> tuple[str, ...]:
    # each is written so that NaN complains
    vehicle, doubt = state.vehicle, state.doubt
    if vehicle.source == RECEIVER:
        aids = state.aids
        level = POSITION_STD_TO_FLY + PROMISE * aids.horizontal_slow
        if not vehicle.age_s <= max(oldest_s, COASTING_S):
            return ("no position from the receiver",)
        if not (doubt.horizontal <= level and doubt.relative <= level):
            return (f"vehicle position not settled, good to {doubt.horizontal:.1f} m",)
        if not doubt.tilt <= ATTITUDE_STD_TO_FLY:
            return ("vehicle attitude not settled",)
        if not doubt.heading <= HEADING_STD_TO_FLY:
            return ("vehicle heading not settled",)
        return ()
    if not vehicle.age_s <= oldest_s:
        return ("no vehicle pose from a tracker",)
    if not max(doubt.horizontal, doubt.vertical) <= POSITION_STD_TO_FLY:
        return ("vehicle position not settled",)
    if not max(doubt.tilt, doubt.heading) <= ATTITUDE_STD_TO_FLY:
        return ("vehicle attitude not settled",)
    return ()


def _of_load(state: EstimatorState, oldest_s: float) -> tuple[str, ...]:
    load, doubt = state.load, state.doubt
    if load.source == CAMERA:
        if load.taut == 0.0:  # it lies where it was laid, seen or not
            return ()
        if not load.age_s <= oldest_s:
            return ("no direction to the load from the camera",)
        return () if doubt.load <= LOAD_STD_TO_FLY else ("load position not settled",)
    if not load.age_s <= oldest_s:
        return ("no load position from a tracker",)
    return () if doubt.load <= POSITION_STD_TO_FLY else ("load position not settled",)
