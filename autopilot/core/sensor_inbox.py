"""The autopilot's end of the simulator link: a datagram of sensor frames is one tick, and fills the inbox."""

from __future__ import annotations

from collections.abc import Callable
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from autopilot.estimation.inbox import (
    DIRECTION,
    FIELD,
    FIX,
    HEIGHT,
    IMU,
    KIND,
    LOAD,
    NOT_MEASURED,
    POSE,
    READING,
    REPEATED_SAMPLE,
    ROTOR_SPEEDS,
    SAMPLE_TIME_US,
    new_inbox,
)
from autopilot.estimation.records import (
    PLAIN,
    RTK_FIXED,
    RTK_FLOAT,
    Array,
    DirectionReading,
    GnssReading,
    ImuReading,
    LoadReading,
    PoseReading,
)
from autopilot.geometry.entry import entry_point_of, kernel_address_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.packed import Row, pack, packed, unpack, width
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.compiled import MAX_PAYLOAD_BYTES, Bytes, frame_end, match_frame, unpack_payload
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import (
    ACCEL,
    GYRO,
    MAG,
    PRESSURE,
    HilGps,
    HilSensor,
    load_sensor_record,
    odometry_record,
    read_hil_gps,
    read_hil_sensor,
)
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.simulator_frames import ESC_STATUS, HIL_GPS, HIL_SENSOR, LOAD_SENSOR, ODOMETRY

# results of `_read` in place of a number of readings
_OTHER_CONTENT = -1  # it holds more than whole, plain frames of the sensors
_NO_TICK = -2  # no HIL_SENSOR

_SENSORS = (
    mavlink.MAVLINK_MSG_ID_HIL_SENSOR,
    mavlink.MAVLINK_MSG_ID_ODOMETRY,
    mavlink.MAVLINK_MSG_ID_LOAD_SENSOR,
    mavlink.MAVLINK_MSG_ID_HIL_GPS,
    mavlink.MAVLINK_MSG_ID_ESC_STATUS,
)
INERTIAL = ACCEL | GYRO  # of HIL_SENSOR.fields_updated: the bits of a new sample


class SlowSensors(NamedTuple):
    """The fields of HIL_SENSOR that are not new at each tick, as last read; zeros: never."""

    field_gauss: Vec3 = ZERO
    pressure_pa: float = 0.0
    pressure_altitude_m: float = 0.0
    temperature_degC: float = 0.0


_NO_SENSOR = HilSensor(0, ZERO, ZERO, ZERO, 0.0, 0.0, 0.0, 0, 0)
_NO_FIX = HilGps(0, 0, ZERO, ZERO, 0.0, 0.0, 0)


class Tick(NamedTuple):
    """The contents of one datagram of the simulator, except for the readings, which are in the inbox."""

    now_us: int
    readings: int  # how many
    fields_updated: int  # of HIL_SENSOR
    has_fix: bool  # there was a HIL_GPS
    other_messages: tuple[Any, ...]  # messages that are not from sensors


@kernel
def _put(inbox: Array, at: int, kind: int, shows_us: int, reading: Any) -> int:
    """Write a reading's record into a row, if there is one left; returns the next row."""
    if at < inbox.shape[0]:
        inbox[at, KIND], inbox[at, SAMPLE_TIME_US] = kind, shows_us
        pack(reading, inbox[at], READING)
    return at + 1


@kernel
def _put_vector(inbox: Array, at: int, kind: int, vector: Vec3) -> int:
    """Write a reading of this instant into a row, if there is one left; returns the next row."""
    if at < inbox.shape[0]:
        inbox[at, KIND] = kind
        for i in range(3):
            inbox[at, READING + i] = vector[i]
    return at + 1


@kernel
def _put_pose(inbox: Array, at: int, m: Any) -> int:
    odometry = odometry_record(m)
    velocity, std = odometry.velocity, odometry.velocity_std
    if isnan(m.velocity_covariance[0]):
        velocity, std = ZERO, NOT_MEASURED
    elif std < 0.0:
        std = 0.0
    stds = (odometry.position_std, odometry.attitude_std, std)
    reading = PoseReading(0.0, odometry.position, odometry.quat_wxyz, velocity, stds[0], stds[1], stds[2])
    return _put(inbox, at, POSE, odometry.time_us, reading)


@kernel
def _put_load(inbox: Array, at: int, m: Any) -> int:
    sensor = load_sensor_record(m)
    if m.fields & mavlink.PLUMBLINE_LOAD_POSITION:
        velocity, std = ZERO, NOT_MEASURED
        if m.fields & mavlink.PLUMBLINE_LOAD_VELOCITY:
            velocity, std = sensor.velocity, 0.0 if sensor.velocity_std < 0.0 else sensor.velocity_std
        reading = LoadReading(0.0, sensor.position, velocity, sensor.position_std, std)
        at = _put(inbox, at, LOAD, sensor.time_us, reading)
    if m.fields & mavlink.PLUMBLINE_LOAD_DIRECTION:
        direction = DirectionReading(0.0, sensor.direction_body, sensor.direction_std)
        at = _put(inbox, at, DIRECTION, sensor.time_us, direction)
    return at


@kernel
def _put_speeds(inbox: Array, at: int, m: Any) -> int:
    """Write the speeds that the controllers of four rotors report into a row, if there is one left; returns
    the next row."""
    if at < inbox.shape[0]:
        inbox[at, KIND], inbox[at, READING] = ROTOR_SPEEDS, m.index
        for i in range(4):
            inbox[at, READING + 1 + i] = m.rpm[i]
    return at + 1


@kernel
def _put_fix(inbox: Array, at: int, gps: HilGps) -> int:
    rtk = PLAIN
    if gps.fix_type >= mavlink.GPS_FIX_TYPE_RTK_FLOAT:
        rtk = RTK_FLOAT if gps.fix_type == mavlink.GPS_FIX_TYPE_RTK_FLOAT else RTK_FIXED
    fix = GnssReading(0.0, gps.position, gps.velocity, gps.horizontal_std, gps.vertical_std, rtk)
    return _put(inbox, at, FIX, gps.time_us, fix)


@kernel
def _read(
    datagram: bytes, home: Row, since_us: int, inbox: Array, imu: Row, slow: Row, fix: Row, payload: Bytes
) -> tuple[int, int, int, bool]:
    """The number of readings in a datagram, its time, HIL_SENSOR.fields_updated, and whether there was a
    HIL_GPS. As many readings as there is room for are written into the inbox, in the order in which they are
    absorbed. If the tick is later than `since_us`, the inertial sample is also written into `imu`,
    `SlowSensors` into `slow` and the HIL_GPS into `fix`.
    """
    home_position = unpack(Home, home, 0)
    sensor, gps = _NO_SENSOR, _NO_FIX
    has_sensor = has_fix = False
    count = start = 0
    while start < len(datagram):
        end = frame_end(datagram, start)
        if end == 0:
            return (_OTHER_CONTENT, 0, 0, False)
        if match_frame(HIL_SENSOR, datagram, start, payload):
            sensor, has_sensor = read_hil_sensor(unpack_payload(HIL_SENSOR, payload)), True
        elif match_frame(ODOMETRY, datagram, start, payload):
            count = _put_pose(inbox, count, unpack_payload(ODOMETRY, payload))
        elif match_frame(LOAD_SENSOR, datagram, start, payload):
            count = _put_load(inbox, count, unpack_payload(LOAD_SENSOR, payload))
        elif match_frame(ESC_STATUS, datagram, start, payload):
            count = _put_speeds(inbox, count, unpack_payload(ESC_STATUS, payload))
        elif match_frame(HIL_GPS, datagram, start, payload):
            gps, has_fix = read_hil_gps(unpack_payload(HIL_GPS, payload), home_position), True
        else:
            return (_OTHER_CONTENT, 0, 0, False)
        start = end
    if not has_sensor:
        return (_NO_TICK, 0, 0, False)
    now_us = sensor.time_us
    sample = ImuReading(sensor.gyro_body, sensor.accel_body)
    new = sensor.fields & INERTIAL == INERTIAL
    count = _put(inbox, count, IMU, now_us if new else REPEATED_SAMPLE, sample)
    if has_fix and gps.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX:
        count = _put_fix(inbox, count, gps)
    if sensor.fields & PRESSURE:
        height = sensor.pressure_altitude_m - home_position.altitude_m
        count = _put_vector(inbox, count, HEIGHT, (height, 0.0, 0.0))
    if sensor.fields & MAG:
        count = _put_vector(inbox, count, FIELD, sensor.mag_body_gauss)
    if now_us > since_us:
        pack(sample, imu, 0)
        last = unpack(SlowSensors, slow, 0)
        field = sensor.mag_body_gauss if sensor.fields & MAG else last.field_gauss
        if sensor.fields & PRESSURE:
            baro = (sensor.pressure_pa, sensor.pressure_altitude_m, sensor.temperature_degC)
        else:
            baro = (last.pressure_pa, last.pressure_altitude_m, last.temperature_degC)
        pack(SlowSensors(field, baro[0], baro[1], baro[2]), slow, 0)
        if has_fix:
            pack(gps, fix, 0)
    return (count, now_us, sensor.fields, has_fix)


def address_of_read(inbox: SensorInbox) -> int:
    """The address of the kernel that reads datagrams for this inbox, compiled or loaded if necessary."""
    return kernel_address_of(_read, b"", *inbox.arguments(0))


class SensorInbox:
    """Reads datagrams of sensors into the rows that the estimate is made from."""

    def __init__(self, home: Home, rows: Array) -> None:
        self.rows = rows
        self.home = packed(home)
        self.imu = np.full(width(ImuReading), np.nan)  # `ImuReading` of the last tick
        self.slow = packed(SlowSensors())
        self.fix = np.zeros(width(HilGps))  # `HilGps`, the last one
        self.payload = np.zeros(MAX_PAYLOAD_BYTES, np.uint8)
        self._writer = FrameWriter(1, 1)
        self._entry: Callable[..., tuple[int, int, int, bool]] | None = (
            None  # machine code, once it was needed
        )

    def arguments(self, since_us: int) -> Any:
        """The arguments of `_read` besides the datagram."""
        return (self.home, since_us, self.rows, self.imu, self.slow, self.fix, self.payload)

    def read(self, datagram: bytes, since_us: int) -> Tick | None:
        """The tick in a datagram, or None if there is none (garbage, another message).

        Its readings are in the first rows of `rows`, which may have grown. The sample and the fix are kept
        only of a tick later than `since_us`.
        """
        other_messages: tuple[Any, ...] = ()
        arguments = self.arguments(since_us)
        if self._entry is None:
            self._entry = entry_point_of(_read, datagram, *arguments)
        count, now_us, fields, has_fix = self._entry(datagram, *arguments)
        if count == _OTHER_CONTENT:
            messages = [one.message for one in decode(datagram)[0]]
            other_messages = tuple(message for message in messages if message.get_msgId() not in _SENSORS)
            sensors = (message for message in messages if message.get_msgId() in _SENSORS)
            datagram = b"".join(map(self._writer.frame, sensors))
            count, now_us, fields, has_fix = self._entry(datagram, *arguments)
        if count > len(self.rows):
            self.rows = new_inbox(2 * count)
            self._entry(datagram, *self.arguments(since_us))
        return Tick(now_us, count, fields, has_fix, other_messages) if count >= 0 else None
