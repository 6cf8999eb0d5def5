"""Common telemetry of a vehicle, built from ENU and FLU; any ground station reads it.

`x_message` returns the fields as they are sent, `x_values` only their numbers, for the messages that machine
code writes. `now_us` is the time since boot.
"""

from __future__ import annotations

import math

from numba.extending import register_jitable

from autopilot.geometry.frames import quat_ned_frd_from_enu_flu
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.so3 import Quat
from autopilot.wire.codec import Fields, layout_of
from autopilot.wire.convert.axes import frd_from_flu, ned_from_enu
from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.convert.scaling import STANDARD_GRAVITY, course_cdeg, int16, int32, saturated, uint16
from autopilot.wire.dialect import plumbline as mavlink

_UPRIGHT: Quat = (1.0, 0.0, 0.0, 0.0)
_NO_OFFSET: Quat = (0.0, 0.0, 0.0, 0.0)  # ATTITUDE_QUATERNION.repr_offset_q: none is given
_NO_HEADING = 0xFFFF
_UINT32 = 0xFFFFFFFF
# GPS_RAW_INT: the dilutions HDOP and VDOP, which PX4's simulated receiver states: no satellites are modelled
_DILUTIONS, _NO_DILUTIONS = (70, 110), (0xFFFF, 0xFFFF)
_NO_ACCURACIES = (0, 0, 0)  # GPS_RAW_INT: of speed and heading, and the heading itself
_GLOBAL_POSITION_INT = layout_of(mavlink.MAVLink_global_position_int_message)
_GPS_RAW_INT = layout_of(mavlink.MAVLink_gps_raw_int_message)
_HOME_POSITION = layout_of(mavlink.MAVLink_home_position_message)
_GPS_GLOBAL_ORIGIN = layout_of(mavlink.MAVLink_gps_global_origin_message)
_WINCH_STATUS = layout_of(mavlink.MAVLink_winch_status_message)
_POSITION_VELOCITY_ACCELERATION = 0xC00  # POSITION_TARGET_TYPEMASK: yaw and yaw rate are not given


@register_jitable
def boot_ms(now_us: int) -> int:
    """time_boot_ms of a message."""
    return now_us // 1000 & 0xFFFF_FFFF


@register_jitable
def euler_ned_frd(quat_wxyz: Quat) -> Vec3:
    """(roll, pitch, yaw) in rad of MAVLink, from the attitude body FLU to world ENU; yaw 0 is north."""
    w, x, y, z = quat_ned_frd_from_enu_flu(quat_wxyz)
    sine = 2.0 * (w * y - z * x)
    if not sine > -1.0:
        sine = -1.0
    elif sine > 1.0:
        sine = 1.0
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(sine),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


@register_jitable
def heading_cdeg(quat_wxyz: Quat) -> int:
    """Heading in 0 ... 35999 hundredths of a degree from north; 65535 (unknown) for an attitude of NaN."""
    yaw = euler_ned_frd(quat_wxyz)[2]
    return _NO_HEADING if math.isnan(yaw) else round(math.degrees(yaw) * 100.0) % 36000


@register_jitable
def attitude_values(now_us: int, quat_wxyz: Quat, omega_body: Vec3) -> tuple[float, ...]:
    """ATTITUDE: the numbers in the order of the wire."""
    return (boot_ms(now_us), *euler_ned_frd(quat_wxyz), *frd_from_flu(omega_body))


@register_jitable
def attitude_quaternion_values(now_us: int, quat_wxyz: Quat, omega_body: Vec3) -> tuple[float, ...]:
    """ATTITUDE_QUATERNION: the numbers in the order of the wire."""
    return (
        boot_ms(now_us),
        *quat_ned_frd_from_enu_flu(quat_wxyz),
        *frd_from_flu(omega_body),
        *_NO_OFFSET,
    )


@register_jitable
def local_position_ned_values(now_us: int, position: Vec3, velocity: Vec3) -> tuple[float, ...]:
    """LOCAL_POSITION_NED: the numbers in the order of the wire."""
    return (boot_ms(now_us), *ned_from_enu(position), *ned_from_enu(velocity))


@register_jitable
def global_position_int_values(
    now_us: int, position: Vec3, velocity: Vec3, heading: int, home: Home
) -> tuple[float, ...]:
    """GLOBAL_POSITION_INT: the numbers in the order of the wire; `heading` in hundredths of a degree."""
    latitude, longitude, altitude = geodetic_from_enu(position, home)
    north, east, down = ned_from_enu(velocity)
    return (
        boot_ms(now_us),
        latitude,
        longitude,
        altitude,
        int32(position[2] * 1e3),
        int16(north * 100.0),
        int16(east * 100.0),
        int16(down * 100.0),
        heading,
    )


def global_position_int_message(
    now_us: int, position: Vec3, velocity: Vec3, quat_wxyz: Quat | None, home: Home
) -> Fields:
    """GLOBAL_POSITION_INT; without an attitude the heading is unknown."""
    heading = _NO_HEADING if quat_wxyz is None else heading_cdeg(quat_wxyz)
    return _GLOBAL_POSITION_INT, global_position_int_values(now_us, position, velocity, heading, home)


def _accuracy_mm(std: float) -> int:
    """An accuracy of GPS_RAW_INT, for a standard deviation in m; 0: unknown."""
    return 0 if math.isnan(std) else saturated(std * 1000.0, 1, _UINT32)


def gps_raw_int_message(
    now_us: int,
    fix_type: int,
    position: Vec3,
    velocity: Vec3,
    horizontal_std: float,
    vertical_std: float,
    satellites: int,
    home: Home,
) -> Fields:
    """GPS_RAW_INT, with the standard deviations in m as its accuracies (NaN: unknown, as in the velocity);
    the ellipsoid lies at sea level."""
    latitude, longitude, altitude = geodetic_from_enu(position, home)
    north, east, _ = ned_from_enu(velocity)
    speed = math.hypot(north, east)
    return _GPS_RAW_INT, (
        now_us,
        latitude,
        longitude,
        altitude,
        *(_DILUTIONS if fix_type >= mavlink.GPS_FIX_TYPE_2D_FIX else _NO_DILUTIONS),
        0xFFFF if math.isnan(speed) else saturated(speed * 100.0, 0, 0xFFFE),
        course_cdeg(north, east),
        fix_type,
        saturated(satellites, 0, 255),
        altitude,
        _accuracy_mm(horizontal_std),
        _accuracy_mm(vertical_std),
        *_NO_ACCURACIES,
    )


@register_jitable
def altitude_values(now_us: int, height: float, home: Home) -> tuple[float, ...]:
    """ALTITUDE: the numbers in the order of the wire, for a height in m above home; the ground is flat at
    home's altitude."""
    above_sea = home.altitude_m + height
    return (now_us, height, above_sea, height, height, home.altitude_m, height)


@register_jitable
def vfr_hud_values(
    velocity: Vec3, quat_wxyz: Quat, height: float, throttle: float, home: Home
) -> tuple[float, ...]:
    """VFR_HUD: the numbers in the order of the wire; `throttle` is a fraction, the airspeed is that in still
    air."""
    heading = heading_cdeg(quat_wxyz)
    east, north, up = velocity
    level = east * east + north * north
    share = 0.0
    if throttle > 0.0:
        share = throttle if throttle < 1.0 else 1.0
    return (
        math.sqrt(level + up * up),
        math.sqrt(level),
        home.altitude_m + height,
        up,
        0 if heading == _NO_HEADING else heading // 100,
        uint16(share * 100.0),
    )


def home_position_message(now_us: int, launch: Vec3, home: Home) -> Fields:
    """HOME_POSITION: where a return leads, ENU from the origin of the world."""
    north, east, down = ned_from_enu(launch)
    return _HOME_POSITION, (
        *geodetic_from_enu(launch, home),
        north,
        east,
        down,
        *_UPRIGHT,
        0.0,
        0.0,
        0.0,
        now_us,
    )


def gps_global_origin_message(now_us: int, home: Home) -> Fields:
    """GPS_GLOBAL_ORIGIN: the origin of LOCAL_POSITION_NED."""
    return _GPS_GLOBAL_ORIGIN, (*geodetic_from_enu(ZERO, home), now_us)


@register_jitable
def position_target_local_ned_values(
    now_us: int, position: Vec3, velocity: Vec3, acceleration: Vec3
) -> tuple[float, ...]:
    """POSITION_TARGET_LOCAL_NED, the setpoint in force: the numbers in the order of the wire."""
    return (
        boot_ms(now_us),
        *ned_from_enu(position),
        *ned_from_enu(velocity),
        *ned_from_enu(acceleration),
        0.0,
        0.0,
        _POSITION_VELOCITY_ACCELERATION,
        mavlink.MAV_FRAME_LOCAL_NED,
    )


@register_jitable
def attitude_target_values(
    now_us: int, quat_wxyz: Quat, omega_body: Vec3, thrust_fraction: float
) -> tuple[float, ...]:
    """ATTITUDE_TARGET, the setpoint of the inner loop: the numbers in the order of the wire."""
    return (
        boot_ms(now_us),
        *quat_ned_frd_from_enu_flu(quat_wxyz),
        *frd_from_flu(omega_body),
        thrust_fraction,
        0,
    )


def winch_status_message(
    now_us: int, cable_length: float, tension: float, rate: float = 0.0, released: bool = False
) -> Fields:
    """WINCH_STATUS: `tension` in N, sent as the weight of that many kg; `rate` in m/s at which the cable gets
    longer; `released`: cable and load are let go of. Voltage and current are unknown."""
    moving = mavlink.MAV_WINCH_STATUS_MOVING if rate != 0.0 else 0
    abandoned = mavlink.MAV_WINCH_STATUS_ABANDON_LINE if released else 0
    return _WINCH_STATUS, (
        now_us,
        cable_length,
        rate,
        tension / STANDARD_GRAVITY,
        math.nan,
        math.nan,
        mavlink.MAV_WINCH_STATUS_HEALTHY | moving | abandoned,
        0x7FFF,
    )
