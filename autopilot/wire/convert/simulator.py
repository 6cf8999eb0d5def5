"""The simulator link: HIL_SENSOR, ODOMETRY, LOAD_SENSOR, HIL_GPS down, HIL_ACTUATOR_CONTROLS up."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from autopilot.geometry.frames import (
    enu_from_ned,
    flu_from_frd,
    frd_from_flu,
    ned_from_enu,
    quat_enu_flu_from_ned_frd,
    quat_ned_frd_from_enu_flu,
)
from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic, geodetic_from_enu
from autopilot.wire.convert.scaling import course_cdeg, int16, saturated, uint16
from autopilot.wire.dialect import plumbline as mavlink

Forces = tuple[float, float, float, float]

ROTOR_FMAX = 1.96  # N, force of one rotor at full scale of HIL_ACTUATOR_CONTROLS (Table 4-1)
STANDARD_GRAVITY = 9.80665  # m/s^2, the g of HIL_STATE_QUATERNION's accelerations

ACCEL, GYRO, MAG = 0x7, 0x38, 0x1C0  # HIL_SENSOR.fields_updated
PRESSURE, TEMPERATURE = 0xA00, 0x1000
_LOCKSTEP = 1  # HIL_ACTUATOR_CONTROLS.flags
_ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
_CUSTOM = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED

_NAN3: Vec3 = (math.nan, math.nan, math.nan)
_GRIPPER = 4  # HIL_ACTUATOR_CONTROLS has room for sixteen: behind the rotors
_NO_CONTROLS = [0.0] * 11


class HilSensor(NamedTuple):
    """HIL_SENSOR: what the vehicle's own sensors read at `time_us`; `fields` says which are new."""

    time_us: int
    accel_body: Vec3  # specific force, m/s^2
    gyro_body: Vec3  # rad/s
    mag_body_gauss: Vec3
    pressure_pa: float
    pressure_altitude_m: float
    temperature_degC: float
    fields: int
    sensor_id: int = 0


def hil_sensor_message(
    time_us: int,
    accel_body: Vec3,
    gyro_body: Vec3,
    mag_body_gauss: Vec3,
    pressure_pa: float,
    pressure_altitude_m: float,
    temperature_degC: float,
    fields: int,
    sensor_id: int = 0,
) -> Any:
    """HIL_SENSOR, see `HilSensor`."""
    return mavlink.MAVLink_hil_sensor_message(
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


def read_hil_sensor(m: Any) -> HilSensor:
    """Inverse of `hil_sensor_message`."""
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
    """ODOMETRY: a tracker's view of the vehicle at `time_us`; one standard deviation for all three axes."""

    time_us: int
    position: Vec3
    quat_wxyz: Quat
    velocity: Vec3 | None  # world
    omega_body: Vec3 | None
    position_std: float  # m
    attitude_std: float  # rad
    velocity_std: float  # m/s
    reset_counter: int = 0


def _covariance(first: float, second: float) -> list[float]:
    """Upper triangle, row by row, of the 6x6 matrix diag(first, first, first, second, second, second)."""
    a, b = first, second
    return [a, 0, 0, 0, 0, 0, a, 0, 0, 0, 0, a, 0, 0, 0, b, 0, 0, b, 0, b]


def odometry_message(
    time_us: int,
    position: Vec3,
    quat_wxyz: Quat,
    velocity: Vec3 | None,
    omega_body: Vec3 | None,
    position_std: float,
    attitude_std: float,
    velocity_std: float,
    reset_counter: int = 0,
) -> Any:
    """ODOMETRY, see `Odometry`. Position and velocity in MAV_FRAME_LOCAL_NED."""
    x, y, z = ned_from_enu(position)
    return mavlink.MAVLink_odometry_message(
        time_us,
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_LOCAL_NED,
        x,
        y,
        z,
        quat_ned_frd_from_enu_flu(quat_wxyz),
        *(_NAN3 if velocity is None else ned_from_enu(velocity)),
        *(_NAN3 if omega_body is None else frd_from_flu(omega_body)),
        _covariance(position_std * position_std, attitude_std * attitude_std),
        _covariance(math.nan if velocity is None else velocity_std * velocity_std, math.nan),
        reset_counter,
        mavlink.MAV_ESTIMATOR_TYPE_MOCAP,
        100,
    )


def read_odometry(m: Any) -> Odometry:
    """Inverse of `odometry_message`."""
    measured = not math.isnan(m.velocity_covariance[0])
    q = m.q
    return Odometry(
        m.time_usec,
        enu_from_ned((m.x, m.y, m.z)),
        quat_enu_flu_from_ned_frd((q[0], q[1], q[2], q[3])),
        enu_from_ned((m.vx, m.vy, m.vz)) if measured else None,
        None if math.isnan(m.rollspeed) else flu_from_frd((m.rollspeed, m.pitchspeed, m.yawspeed)),
        _root(m.pose_covariance[0]),
        _root(m.pose_covariance[15]),
        _root(m.velocity_covariance[0]),
        m.reset_counter,
    )


def _root(variance: float) -> float:
    return math.sqrt(variance) if variance >= 0.0 else math.nan


class LoadSensor(NamedTuple):
    """LOAD_SENSOR: a reading of a load tracker (0), a camera (1) or a cable-angle sensor (2)."""

    time_us: int
    position: Vec3 | None
    velocity: Vec3 | None
    direction_body: Vec3 | None  # unit vector from vehicle to load
    position_std: float  # m
    velocity_std: float  # m/s
    direction_std: float  # rad
    sensor_id: int = 0


def load_sensor_message(
    time_us: int,
    position: Vec3 | None,
    velocity: Vec3 | None,
    direction_body: Vec3 | None,
    position_std: float,
    velocity_std: float,
    direction_std: float,
    sensor_id: int = 0,
) -> Any:
    """LOAD_SENSOR, see `LoadSensor`."""
    fields = 0
    ned, velocity_ned, direction_frd = _NAN3, _NAN3, _NAN3
    if position is not None:
        fields |= mavlink.PLUMBLINE_LOAD_POSITION
        ned = ned_from_enu(position)
    if velocity is not None:
        fields |= mavlink.PLUMBLINE_LOAD_VELOCITY
        velocity_ned = ned_from_enu(velocity)
    if direction_body is not None:
        fields |= mavlink.PLUMBLINE_LOAD_DIRECTION
        direction_frd = frd_from_flu(direction_body)
    return mavlink.MAVLink_load_sensor_message(
        time_us,
        *ned,
        *velocity_ned,
        *direction_frd,
        position_std,
        velocity_std,
        direction_std,
        fields,
        sensor_id,
    )


def read_load_sensor(m: Any) -> LoadSensor:
    """Inverse of `load_sensor_message`."""
    return LoadSensor(
        m.time_usec,
        enu_from_ned((m.x, m.y, m.z)) if m.fields & mavlink.PLUMBLINE_LOAD_POSITION else None,
        enu_from_ned((m.vx, m.vy, m.vz)) if m.fields & mavlink.PLUMBLINE_LOAD_VELOCITY else None,
        flu_from_frd((m.dx, m.dy, m.dz)) if m.fields & mavlink.PLUMBLINE_LOAD_DIRECTION else None,
        m.position_std,
        m.velocity_std,
        m.direction_std,
        m.sensor_id,
    )


class HilGps(NamedTuple):
    """HIL_GPS: the wire keeps 1e-7 degrees (11 mm), 1 mm of height, 1 cm/s, 1 cm of standard deviation."""

    time_us: int
    fix_type: int  # GPS_FIX_TYPE
    position: Vec3
    velocity: Vec3
    horizontal_std: float  # m
    vertical_std: float  # m
    satellites: int


def hil_gps_message(
    time_us: int,
    fix_type: int,
    position: Vec3,
    velocity: Vec3,
    horizontal_std: float,
    vertical_std: float,
    satellites: int,
    *,
    home: Home,
) -> Any:
    """HIL_GPS, see `HilGps`."""
    latitude, longitude, altitude = geodetic_from_enu(position, home)
    north, east, down = ned_from_enu(velocity)
    return mavlink.MAVLink_hil_gps_message(
        time_us,
        fix_type,
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
        saturated(satellites, 0, 255),
    )


def read_hil_gps(m: Any, home: Home) -> HilGps:
    """Inverse of `hil_gps_message`."""
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
    """HIL_STATE_QUATERNION: the true vehicle; coarse in position (11 mm), velocity (1 cm/s), force (1 mg)."""

    time_us: int
    quat_wxyz: Quat
    omega_body: Vec3
    position: Vec3
    velocity: Vec3
    airspeed: float  # m/s
    accel_body: Vec3  # specific force, m/s^2


def hil_state_quaternion_message(
    time_us: int,
    quat_wxyz: Quat,
    omega_body: Vec3,
    position: Vec3,
    velocity: Vec3,
    airspeed: float,
    accel_body: Vec3,
    *,
    home: Home,
) -> Any:
    """HIL_STATE_QUATERNION, see `HilStateQuaternion`."""
    p, q, r = frd_from_flu(omega_body)
    latitude, longitude, altitude = geodetic_from_enu(position, home)
    north, east, down = ned_from_enu(velocity)
    ax, ay, az = frd_from_flu(accel_body)
    speed = uint16(airspeed * 100.0)
    mg = 1000.0 / STANDARD_GRAVITY
    return mavlink.MAVLink_hil_state_quaternion_message(
        time_us,
        quat_ned_frd_from_enu_flu(quat_wxyz),
        p,
        q,
        r,
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
    """Inverse of `hil_state_quaternion_message`."""
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
    forces: Forces  # N, of rotors 1 ... 4
    armed: bool
    lockstep: bool
    gripper_open: bool = False


def hil_actuator_controls_message(
    time_us: int, forces: Forces, armed: bool, lockstep: bool, gripper_open: bool = False
) -> Any:
    """HIL_ACTUATOR_CONTROLS, see `HilActuatorControls`: controls[i] = force of rotor i+1 / ROTOR_FMAX, and
    controls[4] = 1 while the gripper that holds the cable is open."""
    controls = [force / ROTOR_FMAX for force in forces]
    return mavlink.MAVLink_hil_actuator_controls_message(
        time_us,
        [*controls, 1.0 if gripper_open else 0.0, *_NO_CONTROLS],
        _ARMED | _CUSTOM if armed else _CUSTOM,
        _LOCKSTEP if lockstep else 0,
    )


def read_hil_actuator_controls(m: Any) -> HilActuatorControls:
    """Inverse of `hil_actuator_controls_message`."""
    f1, f2, f3, f4 = m.controls[:4]
    return HilActuatorControls(
        m.time_usec,
        (f1 * ROTOR_FMAX, f2 * ROTOR_FMAX, f3 * ROTOR_FMAX, f4 * ROTOR_FMAX),
        bool(m.mode & _ARMED),
        bool(m.flags & _LOCKSTEP),
        m.controls[_GRIPPER] > 0.5,
    )
