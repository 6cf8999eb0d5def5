"""The autopilot's end of the simulator link: a datagram of sensor frames is one tick, and fills the inbox."""

from __future__ import annotations

from typing import Any, NamedTuple

from autopilot.estimation.inbox import (
    DIRECTION,
    FIELD,
    FIX,
    HEIGHT,
    IMU,
    LOAD,
    NOT_MEASURED,
    POSE,
    is_sane,
    new_inbox,
    put_reading,
    put_vector,
)
from autopilot.estimation.records import (
    Array,
    DirectionReading,
    GnssReading,
    ImuReading,
    LoadReading,
    PoseReading,
)
from autopilot.geometry.linear import ZERO, Vec3
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


class Tick(NamedTuple):
    """All that one datagram of the simulator said; `gps` is None where it held no fix."""

    now_us: int
    readings: tuple[tuple[int, int, Any], ...]  # (kind, instant shown in us, record or vector)
    imu: ImuReading | None  # None where the sample was no number or beyond any sensor's range
    gps: HilGps | None
    fields_updated: int  # of HIL_SENSOR
    aside: tuple[Any, ...]  # messages that are no sensor's


def read_tick(datagram: bytes, home: Home) -> Tick | None:
    """The tick in a datagram, or None where there is none (garbage, another message)."""
    messages, _ = decode(datagram)
    sensor = None
    readings: list[tuple[int, int, Any]] = []
    gps = None
    aside = []
    for received in messages:
        message = received.message
        match message.get_msgId():
            case mavlink.MAVLINK_MSG_ID_HIL_SENSOR:
                sensor = read_hil_sensor(message)
            case mavlink.MAVLINK_MSG_ID_ODOMETRY:
                readings.append(_pose(read_odometry(message)))
            case mavlink.MAVLINK_MSG_ID_LOAD_SENSOR:
                readings += _of_load(read_load_sensor(message))
            case mavlink.MAVLINK_MSG_ID_HIL_GPS:
                gps = read_hil_gps(message, home)
            case _:
                aside.append(message)
    if sensor is None:
        return None
    now_us = sensor.time_us
    imu = ImuReading(sensor.gyro_body, sensor.accel_body)
    readings.append((IMU, now_us, imu))
    if gps is not None and gps.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX:
        readings.append(_fix(gps))
    if sensor.fields & PRESSURE:
        readings.append((HEIGHT, now_us, (sensor.pressure_altitude_m - home.altitude_m,)))
    if sensor.fields & MAG:
        readings.append((FIELD, now_us, sensor.mag_body_gauss))
    return Tick(now_us, tuple(readings), imu if is_sane(imu) else None, gps, sensor.fields, tuple(aside))


def fill(inbox: Array, tick: Tick) -> Array:
    """The inbox with the tick's readings in its first rows; a larger one where they would not fit."""
    if len(tick.readings) > len(inbox):
        inbox = new_inbox(2 * len(tick.readings))
    for at, (kind, shows_us, reading) in enumerate(tick.readings):
        if kind in (HEIGHT, FIELD):
            put_vector(inbox, at, kind, reading)
        else:
            put_reading(inbox, at, kind, shows_us, reading)
    return inbox


def _velocity(velocity: Vec3 | None, std: float) -> tuple[Vec3, float]:
    """A velocity and its stated deviation, as the inbox has them."""
    if velocity is None:
        return ZERO, NOT_MEASURED
    return velocity, 0.0 if std < 0.0 else std


def _pose(o: Any) -> tuple[int, int, PoseReading]:
    velocity, std = _velocity(o.velocity, o.velocity_std)
    reading = PoseReading(0.0, o.position, o.quat_wxyz, velocity, o.position_std, o.attitude_std, std)
    return POSE, o.time_us, reading


def _of_load(r: Any) -> list[tuple[int, int, Any]]:
    found: list[tuple[int, int, Any]] = []
    if r.position is not None:
        velocity, std = _velocity(r.velocity, r.velocity_std)
        found.append((LOAD, r.time_us, LoadReading(0.0, r.position, velocity, r.position_std, std)))
    if r.direction_body is not None:
        found.append((DIRECTION, r.time_us, DirectionReading(0.0, r.direction_body, r.direction_std)))
    return found


def _fix(gps: HilGps) -> tuple[int, int, GnssReading]:
    rtk = 1.0 if gps.fix_type >= mavlink.GPS_FIX_TYPE_RTK_FLOAT else 0.0
    stated = (gps.horizontal_std, gps.vertical_std)
    return FIX, gps.time_us, GnssReading(0.0, gps.position, gps.velocity, *stated, rtk)
