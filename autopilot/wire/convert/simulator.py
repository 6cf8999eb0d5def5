"""The simulator link: HIL_SENSOR, ODOMETRY, LOAD_SENSOR, HIL_GPS down, HIL_ACTUATOR_CONTROLS up.

Both ends are machine code: `x_values` returns the numbers of a message in the order of the wire, arrays
spread out, which `autopilot.wire.compiled` writes; `x_record`, or `read_x` where nothing can be missing,
reads the records of that module as well as pymavlink's objects. A vector that was not measured is NaN.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from autopilot.geometry.frames import (
    enu_from_ned,
    flu_from_frd,
    frd_from_flu,
    ned_from_enu,
    quat_enu_flu_from_ned_frd,
    quat_ned_frd_from_enu_flu,
)
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import Vec3
from autopilot.geometry.packed import Row
from autopilot.geometry.so3 import Quat
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic, geodetic_from_enu
from autopilot.wire.convert.scaling import STANDARD_GRAVITY, course_cdeg, int16, saturated, uint16
from autopilot.wire.dialect import plumbline as mavlink

# of each rotor, in N; rotors that a vehicle does not have: 0
Forces = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float, float
]

NO_FORCES: Forces = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
FULL_SPEED_RPM = 10_000.0  # of a rotor at its greatest force, whatever its size
ROTOR_FMAX = 1.96  # N, force of one rotor at full scale of HIL_ACTUATOR_CONTROLS (Table 4-1)
SIMULATOR_COMPONENT = 26  # sends the messages of the common dialect
SPEED_REPORT_US = 20_000  # period of the ticks at which the speed controllers report the speeds of the rotors

ACCEL, GYRO, MAG = 0x7, 0x38, 0x1C0  # HIL_SENSOR.fields_updated
PRESSURE, TEMPERATURE = 0xA00, 0x1000
_LOCKSTEP = 1  # HIL_ACTUATOR_CONTROLS.flags
_ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
_CUSTOM = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED

_NAN3: Vec3 = (math.nan, math.nan, math.nan)
_GRIPPER, _WINCH = 4, 5  # of HIL_ACTUATOR_CONTROLS: between the first four rotors and the others
REEL_MAX = 2.0  # m/s, rate of a winch whose control is 1


def padded_forces(forces: Sequence[float]) -> Forces:
    """The forces of a vehicle, with zeros for the rotors that it does not have."""
    f = (*forces, *NO_FORCES[len(forces) :])
    return (f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11], f[12], f[13])


@register_jitable
def forces_from_row(row: Row, at: int) -> Forces:
    """Fourteen numbers of a row."""
    return (
        row[at],
        row[at + 1],
        row[at + 2],
        row[at + 3],
        row[at + 4],
        row[at + 5],
        row[at + 6],
        row[at + 7],
        row[at + 8],
        row[at + 9],
        row[at + 10],
        row[at + 11],
        row[at + 12],
        row[at + 13],
    )


class HilSensor(NamedTuple):
    """HIL_SENSOR: the readings of the onboard sensors at `time_us`; `fields` states which are new."""

    time_us: int
    accel_body: Vec3  # specific force, m/s^2
    gyro_body: Vec3  # rad/s
    mag_body_gauss: Vec3
    pressure_pa: float
    pressure_altitude_m: float
    temperature_degC: float
    fields: int
    sensor_id: int = 0


@register_jitable
def hil_sensor_values(
    time_us: int,
    accel_body: Vec3,
    gyro_body: Vec3,
    mag_body_gauss: Vec3,
    pressure_pa: float,
    pressure_altitude_m: float,
    temperature_degC: float,
    fields: int,
    sensor_id: int = 0,
) -> tuple[float, ...]:
    """HIL_SENSOR, see `HilSensor`."""
    return (
        time_us,
        *frd_from_flu(accel_body),
        *frd_from_flu(gyro_body),
        *frd_from_flu(mag_body_gauss),
        pressure_pa * 0.01,
        0.0,
        pressure_altitude_m,
        temperature_degC,
        fields,
        sensor_id,
    )


@register_jitable
def read_hil_sensor(m: Any) -> HilSensor:
    """Inverse of `hil_sensor_values`."""
    return HilSensor(
        m.time_usec,
        flu_from_frd((m.xacc, m.yacc, m.zacc)),
        flu_from_frd((m.xgyro, m.ygyro, m.zgyro)),
        flu_from_frd((m.xmag, m.ymag, m.zmag)),
        m.abs_pressure * 100.0,
        m.pressure_alt,
        m.temperature,
        m.fields_updated,
        m.id,
    )


class Odometry(NamedTuple):
    """ODOMETRY: a tracker's reading of the vehicle at `time_us`; one standard deviation for all axes."""

    time_us: int
    position: Vec3
    quat_wxyz: Quat
    velocity: Vec3  # world
    omega_body: Vec3
    position_std: float  # m
    attitude_std: float  # rad
    velocity_std: float  # m/s
    reset_counter: int = 0


@register_jitable
def _covariance(first: float, second: float) -> tuple[float, ...]:
    """Upper triangle, row by row, of the 6x6 matrix diag(first, first, first, second, second, second)."""
    a, b, o = first, second, 0.0
    return (a, o, o, o, o, o, a, o, o, o, o, a, o, o, o, b, o, o, b, o, b)


@register_jitable
def odometry_values(
    time_us: int,
    position: Vec3,
    quat_wxyz: Quat,
    velocity: Vec3,
    omega_body: Vec3,
    position_std: float,
    attitude_std: float,
    velocity_std: float,
    reset_counter: int = 0,
) -> tuple[float, ...]:
    """ODOMETRY, see `Odometry`. Position and velocity in MAV_FRAME_LOCAL_NED."""
    velocity_variance = velocity_std * velocity_std if velocity[0] == velocity[0] else math.nan
    return (
        time_us,
        *ned_from_enu(position),
        *quat_ned_frd_from_enu_flu(quat_wxyz),
        *ned_from_enu(velocity),
        *frd_from_flu(omega_body),
        *_covariance(position_std * position_std, attitude_std * attitude_std),
        *_covariance(velocity_variance, math.nan),
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_LOCAL_NED,
        reset_counter,
        mavlink.MAV_ESTIMATOR_TYPE_MOCAP,
        100,
    )


@register_jitable
def odometry_record(m: Any) -> Any:
    """The record of an ODOMETRY; vectors that were not measured are NaN."""
    q = m.q
    return Odometry(
        m.time_usec,
        enu_from_ned((m.x, m.y, m.z)),
        quat_enu_flu_from_ned_frd((q[0], q[1], q[2], q[3])),
        _NAN3 if math.isnan(m.velocity_covariance[0]) else enu_from_ned((m.vx, m.vy, m.vz)),
        flu_from_frd((m.rollspeed, m.pitchspeed, m.yawspeed)),
        _root(m.pose_covariance[0]),
        _root(m.pose_covariance[15]),
        _root(m.velocity_covariance[0]),
        m.reset_counter,
    )


@register_jitable
def _root(variance: float) -> float:
    return math.sqrt(variance) if variance >= 0.0 else math.nan


class LoadSensor(NamedTuple):
    """LOAD_SENSOR: a reading of a load tracker (0), a camera (1) or a cable-angle sensor (2)."""

    time_us: int
    position: Vec3
    velocity: Vec3
    direction_body: Vec3  # unit vector from vehicle to load
    position_std: float  # m
    velocity_std: float  # m/s
    direction_std: float  # rad
    sensor_id: int = 0


@register_jitable
def load_sensor_values(
    time_us: int,
    position: Vec3,
    velocity: Vec3,
    direction_body: Vec3,
    position_std: float,
    velocity_std: float,
    direction_std: float,
    sensor_id: int = 0,
) -> tuple[float, ...]:
    """LOAD_SENSOR, see `LoadSensor`."""
    fields = 0
    if position[0] == position[0]:
        fields |= mavlink.PLUMBLINE_LOAD_POSITION
    if velocity[0] == velocity[0]:
        fields |= mavlink.PLUMBLINE_LOAD_VELOCITY
    if direction_body[0] == direction_body[0]:
        fields |= mavlink.PLUMBLINE_LOAD_DIRECTION
    return (
        time_us,
        *ned_from_enu(position),
        *ned_from_enu(velocity),
        *frd_from_flu(direction_body),
        position_std,
        velocity_std,
        direction_std,
        fields,
        sensor_id,
    )


@register_jitable
def load_sensor_record(m: Any) -> Any:
    """The record of a LOAD_SENSOR; vectors that were not measured are NaN."""
    return LoadSensor(
        m.time_usec,
        enu_from_ned((m.x, m.y, m.z)) if m.fields & mavlink.PLUMBLINE_LOAD_POSITION else _NAN3,
        enu_from_ned((m.vx, m.vy, m.vz)) if m.fields & mavlink.PLUMBLINE_LOAD_VELOCITY else _NAN3,
        flu_from_frd((m.dx, m.dy, m.dz)) if m.fields & mavlink.PLUMBLINE_LOAD_DIRECTION else _NAN3,
        m.position_std,
        m.velocity_std,
        m.direction_std,
        m.sensor_id,
    )


class HilGps(NamedTuple):
    """HIL_GPS; resolution on the wire: 1e-7 degrees (11 mm), 1 mm height, 1 cm/s, 1 cm standard deviation."""

    time_us: int
    fix_type: int  # GPS_FIX_TYPE
    position: Vec3
    velocity: Vec3
    horizontal_std: float  # m
    vertical_std: float  # m
    satellites: int


@register_jitable
def hil_gps_values(
    time_us: int,
    fix_type: int,
    position: Vec3,
    velocity: Vec3,
    horizontal_std: float,
    vertical_std: float,
    satellites: int,
    home: Home,
) -> tuple[float, ...]:
    """HIL_GPS, see `HilGps`."""
    latitude, longitude, altitude = geodetic_from_enu(position, home)
    north, east, down = ned_from_enu(velocity)
    return (
        time_us,
        latitude,
        longitude,
        altitude,
        saturated(horizontal_std * 100.0, 0, 0xFFFE),
        saturated(vertical_std * 100.0, 0, 0xFFFE),
        saturated(math.hypot(north, east) * 100.0, 0, 0xFFFE),
        int16(north * 100.0),
        int16(east * 100.0),
        int16(down * 100.0),
        course_cdeg(north, east),
        fix_type,
        saturated(satellites, 0, 255),
        0,  # the first receiver
        0,  # no yaw
    )


@register_jitable
def read_hil_gps(m: Any, home: Home) -> HilGps:
    """Inverse of `hil_gps_values`."""
    return HilGps(
        m.time_usec,
        m.fix_type,
        enu_from_geodetic(m.lat, m.lon, m.alt, home),
        enu_from_ned((m.vn * 0.01, m.ve * 0.01, m.vd * 0.01)),
        m.eph * 0.01,
        m.epv * 0.01,
        m.satellites_visible,
    )


class HilStateQuaternion(NamedTuple):
    """HIL_STATE_QUATERNION: the true vehicle; resolution: position 11 mm, velocity 1 cm/s, force 1 mg."""

    time_us: int
    quat_wxyz: Quat
    omega_body: Vec3
    position: Vec3
    velocity: Vec3
    airspeed: float  # m/s
    accel_body: Vec3  # specific force, m/s^2


@register_jitable
def hil_state_quaternion_values(
    time_us: int,
    quat_wxyz: Quat,
    omega_body: Vec3,
    position: Vec3,
    velocity: Vec3,
    airspeed: float,
    accel_body: Vec3,
    home: Home,
) -> tuple[float, ...]:
    """HIL_STATE_QUATERNION, see `HilStateQuaternion`."""
    latitude, longitude, altitude = geodetic_from_enu(position, home)
    north, east, down = ned_from_enu(velocity)
    ax, ay, az = frd_from_flu(accel_body)
    speed = uint16(airspeed * 100.0)
    mg = 1000.0 / STANDARD_GRAVITY
    return (
        time_us,
        *quat_ned_frd_from_enu_flu(quat_wxyz),
        *frd_from_flu(omega_body),
        latitude,
        longitude,
        altitude,
        int16(north * 100.0),
        int16(east * 100.0),
        int16(down * 100.0),
        speed,
        speed,
        int16(ax * mg),
        int16(ay * mg),
        int16(az * mg),
    )


def read_hil_state_quaternion(m: Any, home: Home) -> HilStateQuaternion:
    """Inverse of `hil_state_quaternion_values`."""
    q = m.attitude_quaternion
    g = STANDARD_GRAVITY * 1e-3
    return HilStateQuaternion(
        m.time_usec,
        quat_enu_flu_from_ned_frd((q[0], q[1], q[2], q[3])),
        flu_from_frd((m.rollspeed, m.pitchspeed, m.yawspeed)),
        enu_from_geodetic(m.lat, m.lon, m.alt, home),
        enu_from_ned((m.vx * 0.01, m.vy * 0.01, m.vz * 0.01)),
        m.true_airspeed * 0.01,
        flu_from_frd((m.xacc * g, m.yacc * g, m.zacc * g)),
    )


class HilActuatorControls(NamedTuple):
    """HIL_ACTUATOR_CONTROLS: the answer to the HIL_SENSOR of `time_us`."""

    time_us: int
    forces: Forces  # N
    armed: bool
    lockstep: bool
    gripper_open: bool = False
    reel_rate: float = 0.0  # m/s, at which the winch lets the cable out


@register_jitable
def hil_actuator_controls_values(
    time_us: int,
    forces: Forces,
    armed: bool,
    lockstep: bool,
    gripper_open: bool = False,
    reel_rate: float = 0.0,
) -> tuple[float, ...]:
    """HIL_ACTUATOR_CONTROLS, see `HilActuatorControls`: controls[i] = force of rotor i+1 / ROTOR_FMAX for the
    first four, controls[4] = 1 while the gripper that holds the cable is open, controls[5] = winch rate /
    REEL_MAX, controls[6 + i] = force of rotor i+5 / ROTOR_FMAX.
    """
    flags = _LOCKSTEP if lockstep else 0
    mode = _ARMED | _CUSTOM if armed else _CUSTOM
    gripper = 1.0 if gripper_open else 0.0
    return (
        time_us,
        flags,
        forces[0] / ROTOR_FMAX,
        forces[1] / ROTOR_FMAX,
        forces[2] / ROTOR_FMAX,
        forces[3] / ROTOR_FMAX,
        gripper,
        reel_rate / REEL_MAX,
        forces[4] / ROTOR_FMAX,
        forces[5] / ROTOR_FMAX,
        forces[6] / ROTOR_FMAX,
        forces[7] / ROTOR_FMAX,
        forces[8] / ROTOR_FMAX,
        forces[9] / ROTOR_FMAX,
        forces[10] / ROTOR_FMAX,
        forces[11] / ROTOR_FMAX,
        forces[12] / ROTOR_FMAX,
        forces[13] / ROTOR_FMAX,
        mode,
    )


@register_jitable
def read_hil_actuator_controls(m: Any) -> HilActuatorControls:
    """Inverse of `hil_actuator_controls_values`."""
    controls = m.controls
    return HilActuatorControls(
        m.time_usec,
        (
            controls[0] * ROTOR_FMAX,
            controls[1] * ROTOR_FMAX,
            controls[2] * ROTOR_FMAX,
            controls[3] * ROTOR_FMAX,
            controls[6] * ROTOR_FMAX,
            controls[7] * ROTOR_FMAX,
            controls[8] * ROTOR_FMAX,
            controls[9] * ROTOR_FMAX,
            controls[10] * ROTOR_FMAX,
            controls[11] * ROTOR_FMAX,
            controls[12] * ROTOR_FMAX,
            controls[13] * ROTOR_FMAX,
            controls[14] * ROTOR_FMAX,
            controls[15] * ROTOR_FMAX,
        ),
        (m.mode & _ARMED) != 0,
        (m.flags & _LOCKSTEP) != 0,
        controls[_GRIPPER] > 0.5,
        controls[_WINCH] * REEL_MAX,
    )


@register_jitable
def rotor_speed_rpm(force: float, max_force: float) -> float:
    """Speed (rpm) of a rotor that gives this force and can give `max_force` (N; the nominal one if
    unlimited), as a speed controller reports it: a whole number, negative for backwards. The force grows with
    the square of the speed."""
    full_force = max_force if 0.0 < max_force < math.inf else ROTOR_FMAX
    speed = np.rint(math.sqrt(abs(force) / full_force) * FULL_SPEED_RPM)
    return if_above(force, 0.0, speed, -speed)


@register_jitable
def force_at(rpm: float, max_force: float) -> float:
    """Inverse of `rotor_speed_rpm`, N."""
    full_force = max_force if 0.0 < max_force < math.inf else ROTOR_FMAX
    share = rpm / FULL_SPEED_RPM
    return full_force * share * abs(share)


@register_jitable
def esc_status_values(time_us: int, index: int, rpm: tuple[float, float, float, float]) -> tuple[float, ...]:
    """ESC_STATUS of four rotors from number `index` on, counted from 0: the numbers in the order of the wire.
    Voltage and current are not simulated: 0."""
    return (time_us, *rpm, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, index)
