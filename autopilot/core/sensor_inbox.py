"""The autopilot's end of the simulator link: a datagram of sensor frames is one tick."""

from __future__ import annotations

import math
from math import nan
from typing import Any, NamedTuple

from autopilot.estimation.filter import Readings
from autopilot.estimation.history import reading_age
from autopilot.estimation.records import DirectionReading, GnssReading, ImuReading, LoadReading, PoseReading
from autopilot.geometry.linear import ZERO, norm, scale
from autopilot.wire.codec import decode
from autopilot.wire.convert import (
    MAG,
    PRESSURE,
    HilGps,
    Home,
    read_hil_gps,
    read_hil_sensor,
    read_load_sensor,
    read_odometry,
)
from autopilot.wire.dialect import plumbline as mavlink

# a tracker that claims to be perfect is believed to no more than this, so that the filter stays conditioned
LEAST_POSITION_STD_M = 2e-5
LEAST_ANGLE_STD_RAD = 2e-5
LEAST_VELOCITY_STD_M_S = 2e-4
LEAST_FIX_STD_M = 2e-3
LEAST_DIRECTION_STD_RAD = 1e-4
OLDEST_READING_S = 0.3  # older ones are dropped: the estimator's memory is no longer
GREATEST_ACCEL_M_S2, GREATEST_RATE_RAD_S = 2000.0, 500.0


class Tick(NamedTuple):
    """All that one datagram of the simulator said; `gps` is None where it held no fix."""

    now_us: int
    readings: Readings
    gps: HilGps | None
    fields_updated: int  # of HIL_SENSOR
    aside: tuple[Any, ...]  # messages that are no sensor's


def read_tick(datagram: bytes, home: Home, imu_age: float = 0.0) -> Tick | None:
    """The tick in a datagram, or None where there is none (garbage, another message).

    `imu_age` (s) is how old the inertial unit's samples are when they come.
    """
    messages, _ = decode(datagram)
    sensor = None
    odometry: list[Any] = []
    load: list[Any] = []
    gps = None
    aside = []
    for received in messages:
        message = received.message
        match message.get_msgId():
            case mavlink.MAVLINK_MSG_ID_HIL_SENSOR:
                sensor = read_hil_sensor(message)
            case mavlink.MAVLINK_MSG_ID_ODOMETRY:
                odometry.append(read_odometry(message))
            case mavlink.MAVLINK_MSG_ID_LOAD_SENSOR:
                load.append(read_load_sensor(message))
            case mavlink.MAVLINK_MSG_ID_HIL_GPS:
                gps = read_hil_gps(message, home)
            case _:
                aside.append(message)
    if sensor is None:
        return None
    now_us = sensor.time_us
    poses = tuple(pose for pose in (_pose(o, now_us, imu_age) for o in odometry) if pose is not None)
    loads = tuple(reading for reading in (_load(r, now_us, imu_age) for r in load) if reading is not None)
    seen = tuple(reading for reading in (_direction(r, now_us, imu_age) for r in load) if reading is not None)
    fix = None if gps is None else _fix(gps, now_us, imu_age)
    height = sensor.pressure_altitude_m - home.altitude_m if sensor.fields & PRESSURE else nan
    field = sensor.mag_body_gauss if sensor.fields & MAG else (nan, nan, nan)
    # written so that NaN fails
    sane = norm(sensor.accel_body) < GREATEST_ACCEL_M_S2 and norm(sensor.gyro_body) < GREATEST_RATE_RAD_S
    imu = ImuReading(sensor.gyro_body, sensor.accel_body) if sane else None
    readings = Readings(
        imu,
        poses,
        loads,
        () if fix is None else (fix,),
        seen,
        height if math.isfinite(height) else None,
        field if math.isfinite(norm(field)) and norm(field) > 0.0 else None,
    )
    return Tick(now_us, readings, gps, sensor.fields, tuple(aside))


def _age_s(now_us: int, time_us: int, imu_age: float) -> float | None:
    age = reading_age(float(now_us - time_us), imu_age)
    return age if time_us <= now_us and age <= OLDEST_READING_S else None


def _at_least(value: float, least: float) -> float:
    """`value`, but no less than `least`; also for NaN."""
    return value if value > least else least


def _pose(o: Any, now_us: int, imu_age: float) -> PoseReading | None:
    age = _age_s(now_us, o.time_us, imu_age)
    values = (*o.position, *o.quat_wxyz, *(o.velocity or ()))
    if age is None or not all(map(math.isfinite, values)):
        return None
    return PoseReading(
        age,
        o.position,
        o.quat_wxyz,
        o.velocity or ZERO,
        _at_least(o.position_std, LEAST_POSITION_STD_M),
        _at_least(o.attitude_std, LEAST_ANGLE_STD_RAD),
        -1.0 if o.velocity is None else _at_least(o.velocity_std, LEAST_VELOCITY_STD_M_S),
    )


def _load(r: Any, now_us: int, imu_age: float) -> LoadReading | None:
    age = _age_s(now_us, r.time_us, imu_age)
    if age is None or r.position is None or not all(map(math.isfinite, (*r.position, *(r.velocity or ())))):
        return None
    return LoadReading(
        age,
        r.position,
        r.velocity or ZERO,
        _at_least(r.position_std, LEAST_POSITION_STD_M),
        -1.0 if r.velocity is None else _at_least(r.velocity_std, LEAST_VELOCITY_STD_M_S),
    )


def _fix(gps: HilGps, now_us: int, imu_age: float) -> GnssReading | None:
    age = _age_s(now_us, gps.time_us, imu_age)
    values = (*gps.position, *gps.velocity, gps.horizontal_std, gps.vertical_std)
    if age is None or gps.fix_type < mavlink.GPS_FIX_TYPE_3D_FIX or not all(map(math.isfinite, values)):
        return None
    return GnssReading(
        age,
        gps.position,
        gps.velocity,
        _at_least(gps.horizontal_std, LEAST_FIX_STD_M),
        _at_least(gps.vertical_std, LEAST_FIX_STD_M),
        1.0 if gps.fix_type >= mavlink.GPS_FIX_TYPE_RTK_FLOAT else 0.0,
    )


def _direction(r: Any, now_us: int, imu_age: float) -> DirectionReading | None:
    age = _age_s(now_us, r.time_us, imu_age)
    if age is None or r.direction_body is None:
        return None
    length = norm(r.direction_body)
    if not 0.5 < length < 2.0:  # also for NaN
        return None
    return DirectionReading(
        age,
        scale(1.0 / length, r.direction_body),
        _at_least(r.direction_std, LEAST_DIRECTION_STD_RAD),
    )
