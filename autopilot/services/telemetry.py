"""The streamed messages: one table from message id to sender, default interval and builder.

A builder makes its messages from one `Snapshot`, as fields if they are sent often; numbers too large for a
scaled field saturate. Messages of the private dialect are sent from a separate component, so that ground
stations that do not know them do not count them as losses of the autopilot.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.geometry.linear import cross, dot
from autopilot.services.esc_streams import esc_info, esc_status
from autopilot.services.heartbeat import (
    HEARTBEAT_US,
    heartbeat_message,
    load_heartbeat_message,
    winch_heartbeat_message,
)
from autopilot.services.identity import (
    AUTO,
    AUTO_MISSION,
    AUTOPILOT_COMPONENT,
    DIALECT_COMPONENT,
    FOLLOW_MODE,
    LOAD_COMPONENT,
    WINCH_COMPONENT,
    Identity,
    autopilot_version_message,
    protocol_version_message,
)
from autopilot.services.instant import (
    DEBUG_VECTORS,
    NAMED_VALUES,
    altitude_of,
    attitude_of,
    attitude_quaternion_of,
    attitude_target_of,
    cascade_errors_of,
    debug_vectors_of,
    global_position_int_of,
    load_setpoint_of,
    load_state_of,
    local_position_ned_of,
    named_values_of,
    position_target_local_ned_of,
    rotor_state_of,
    servo_output_raw_of,
    vfr_hud_of,
)
from autopilot.services.sensor_streams import (
    actuator_output_status,
    flight_information,
    highres_imu,
    odometry,
    rc_channels,
    scaled_imu,
    scaled_pressure,
)
from autopilot.services.snapshot import GEOFENCE, HEIGHT_LIMIT_PARAMETER, PREARM, Snapshot
from autopilot.services.streams import OFF
from autopilot.wire.codec import layout_of
from autopilot.wire.convert.axes import ned_from_enu
from autopilot.wire.convert.battery import (
    BatteryReading,
    battery_ca,
    battery_mv,
    battery_percent,
    battery_status_message,
)
from autopilot.wire.convert.flight import filter_state_message
from autopilot.wire.convert.scaling import uint16
from autopilot.wire.convert.telemetry import (
    boot_ms,
    global_position_int_message,
    gps_global_origin_message,
    gps_raw_int_message,
    home_position_message,
    winch_status_message,
)
from autopilot.wire.dialect import plumbline as mavlink

Builder = Callable[[Snapshot, Identity], tuple[Any, ...]]

_ATTITUDE = layout_of(mavlink.MAVLink_attitude_message)
_ATTITUDE_QUATERNION = layout_of(mavlink.MAVLink_attitude_quaternion_message)
_LOCAL_POSITION_NED = layout_of(mavlink.MAVLink_local_position_ned_message)
_LOAD_STATE = layout_of(mavlink.MAVLink_load_state_message)
_LOAD_SETPOINT = layout_of(mavlink.MAVLink_load_setpoint_message)
_CASCADE_ERRORS = layout_of(mavlink.MAVLink_cascade_errors_message)
_ROTOR_STATE = layout_of(mavlink.MAVLink_rotor_state_message)
_GLOBAL_POSITION_INT = layout_of(mavlink.MAVLink_global_position_int_message)
_ALTITUDE = layout_of(mavlink.MAVLink_altitude_message)
_VFR_HUD = layout_of(mavlink.MAVLink_vfr_hud_message)
_POSITION_TARGET_LOCAL_NED = layout_of(mavlink.MAVLink_position_target_local_ned_message)
_ATTITUDE_TARGET = layout_of(mavlink.MAVLink_attitude_target_message)
_SERVO_OUTPUT_RAW = layout_of(mavlink.MAVLink_servo_output_raw_message)
_DEBUG_VECT = layout_of(mavlink.MAVLink_debug_vect_message)
_NAMED_VALUE_FLOAT = layout_of(mavlink.MAVLink_named_value_float_message)

_UINT16 = 0xFFFF  # "unknown" in most unsigned fields
_INT16 = 0x7FFF  # "unknown" temperature
_IN_MISSION_MODE, _SUSPENDED = 1, 2  # MISSION_CURRENT.mission_mode


def _heartbeat(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (heartbeat_message(s, identity),)


def _sys_status(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    # some tools read a missing health bit as a breach
    health = s.sensors_healthy | (0 if s.breach else GEOFENCE)
    present = s.sensors_present | PREARM
    enabled = present if s.fence_enabled else present & ~GEOFENCE
    battery = _battery(s)
    return (
        mavlink.MAVLink_sys_status_message(
            onboard_control_sensors_present=present,
            onboard_control_sensors_enabled=enabled,
            onboard_control_sensors_health=health,
            load=0,
            voltage_battery=battery_mv(battery),
            current_battery=battery_ca(battery),
            battery_remaining=battery_percent(battery),
            drop_rate_comm=0,
            errors_comm=0,
            errors_count1=0,
            errors_count2=0,
            errors_count3=0,
            errors_count4=0,
        ),
    )


def _battery(s: Snapshot) -> BatteryReading:
    return BatteryReading(s.battery_voltage, s.battery_current, s.battery_used_mah, s.battery_remaining)


def _battery_status(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (battery_status_message(_battery(s), s.charge_levels),)


def _extended_sys_state(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    vtol = mavlink.MAV_VTOL_STATE_UNDEFINED
    return (mavlink.MAVLink_extended_sys_state_message(vtol, s.landed_state),)


def _gps_raw_int(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    fix = s.gps
    if fix is None:
        unknown = (_UINT16,) * 4
        none = mavlink.GPS_FIX_TYPE_NO_GPS
        return (mavlink.MAVLink_gps_raw_int_message(s.now_us, none, 0, 0, 0, *unknown, 255),)
    accuracy = (fix.horizontal_std, fix.vertical_std, fix.satellites)
    return (gps_raw_int_message(fix.time_us, fix.fix_type, fix.position, fix.velocity, *accuracy, s.home),)


def _global_position_int(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_GLOBAL_POSITION_INT, global_position_int_of(s, s.home)),)


def _gps_global_origin(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (gps_global_origin_message(s.now_us, s.home),)


def _home_position(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (home_position_message(s.now_us, s.home_position, s.home),)


def _local_position_ned(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_LOCAL_POSITION_NED, local_position_ned_of(s)),)


def _attitude(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_ATTITUDE, attitude_of(s)),)


def _attitude_quaternion(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_ATTITUDE_QUATERNION, attitude_quaternion_of(s)),)


def _altitude(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_ALTITUDE, altitude_of(s, s.home)),)


def _vfr_hud(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_VFR_HUD, vfr_hud_of(s, s.home)),)


def _fence_status(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    too_high = HEIGHT_LIMIT_PARAMETER in s.last_breach
    kind = mavlink.FENCE_BREACH_MAXALT if too_high else mavlink.FENCE_BREACH_BOUNDARY
    return (
        mavlink.MAVLink_fence_status_message(
            breach_status=1 if s.breach else 0,
            breach_count=min(s.breaches, 65535),
            breach_type=kind if s.last_breach else mavlink.FENCE_BREACH_NONE,
            breach_time=(s.breach_us // 1000) % 2**32,
        ),
    )


def _in_mission_mode(s: Snapshot) -> bool:
    """Whether the mode is the one that flies the mission."""
    return (s.main_mode, s.sub_mode) == (AUTO, AUTO_MISSION)


def _mission_current(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    total = _UINT16
    if s.mission_total:  # without home, where home is an item: the last item has this number
        total = uint16(s.mission_total - identity.flavour.home_is_item)
    mission, fence, rally = s.plan_ids
    return (
        mavlink.MAVLink_mission_current_message(
            uint16(s.mission_current),
            total,
            s.mission_state,
            mission_mode=_IN_MISSION_MODE if _in_mission_mode(s) else _SUSPENDED,
            mission_id=mission,
            fence_id=fence,
            rally_points_id=rally,
        ),
    )


def _system_time(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (mavlink.MAVLink_system_time_message(s.boot_unix_us + s.now_us, boot_ms(s.now_us)),)


def _estimator_status(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    unknown = math.nan  # of height above the ground and of airspeed, which are not measured
    ratios = (*s.test_ratios, unknown, unknown)
    # a deviation that grows without readings is no accuracy of a position that counts as unknown
    horizontal = s.horizontal_std if s.estimator_flags & mavlink.ESTIMATOR_POS_HORIZ_ABS else unknown
    vertical = s.vertical_std if s.estimator_flags & mavlink.ESTIMATOR_POS_VERT_ABS else unknown
    return (
        mavlink.MAVLink_estimator_status_message(s.now_us, s.estimator_flags, *ratios, horizontal, vertical),
    )


def _ekf_status_report(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    flags = s.estimator_flags & _UINT16
    # as ArduPilot, the roots; 0 is unknown, as is the height above the ground
    roots = [math.sqrt(ratio) if ratio > 0.0 else 0.0 for ratio in s.test_ratios]
    return (mavlink.MAVLink_ekf_status_report_message(flags, *(*roots, 0.0)),)


def _vibration(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (mavlink.MAVLink_vibration_message(s.now_us, *s.vibration, s.clipped_samples, 0, 0),)


def _wind_cov(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    if math.isnan(s.wind[0]):
        return ()
    height, unknown = s.home.altitude_m + s.x_quad[2], math.nan
    return (
        mavlink.MAVLink_wind_cov_message(
            s.now_us, *ned_from_enu(s.wind), *(unknown,) * 2, height, *(unknown,) * 2
        ),
    )


def _current_mode(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    mode = identity.flavour.mode(s.main_mode, s.sub_mode, s.requested_mode)
    if mode is None:
        return ()
    return (mavlink.MAVLink_current_mode_message(mode.standard, mode.custom_mode, mode.custom_mode),)


def _available_modes_monitor(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (mavlink.MAVLink_available_modes_monitor_message(0),)


def _protocol_version(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (protocol_version_message(),)


def _position_target_local_ned(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    if math.isnan(s.x_quad_d[0]):
        return ()
    return ((_POSITION_TARGET_LOCAL_NED, position_target_local_ned_of(s)),)


def _attitude_target(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_ATTITUDE_TARGET, attitude_target_of(s)),)


def _servo_output_raw(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_SERVO_OUTPUT_RAW, servo_output_raw_of(s)),)


def _debug_vect(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    named = zip(debug_vectors_of(s), DEBUG_VECTORS, strict=True)
    return tuple((_DEBUG_VECT, (s.now_us, *vector, name)) for vector, name in named)


def _named_value_float(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    named = zip(named_values_of(s), NAMED_VALUES, strict=True)
    return tuple((_NAMED_VALUE_FLOAT, (boot_ms(s.now_us), value, name)) for value, name in named)


def _winch_status(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    length = s.distance if s.taut else s.cable_length  # a slack cable is longer than its ends are apart
    return (winch_status_message(s.now_us, length, s.tension, s.reel_rate, s.released),)


def _autopilot_version(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (autopilot_version_message(identity),)


def _load_state(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_LOAD_STATE, load_state_of(s)),)


def _filter_state(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return () if s.built_in is None else (filter_state_message(s.now_us, *s.built_in),)


def _load_setpoint(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_LOAD_SETPOINT, load_setpoint_of(s)),)


def _cascade_errors(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_CASCADE_ERRORS, cascade_errors_of(s)),)


def _rotor_state(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return ((_ROTOR_STATE, rotor_state_of(s)),)


def _load_heartbeat(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (load_heartbeat_message(s),)


def _winch_heartbeat(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    if (s.main_mode, s.sub_mode) == FOLLOW_MODE:
        return ()  # FollowMe of MAVSDK takes it for the autopilot's: the mode has ended, no more targets
    return (winch_heartbeat_message(s),)


def _load_global_position_int(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    return (global_position_int_message(s.now_us, s.x_load, s.v_load, None, s.home),)


def _load_attitude(s: Snapshot, identity: Identity) -> tuple[Any, ...]:
    """The cable as an attitude without yaw; its z axis points from vehicle to load."""
    d, d_dot = ned_from_enu(s.q_cable), ned_from_enu(s.q_cable_dot)
    roll = math.asin(max(-1.0, min(1.0, -d[1])))
    pitch = math.atan2(d[0], d[2])
    omega = cross(d, d_dot)
    x_axis = (math.cos(pitch), 0.0, -math.sin(pitch))
    rates = (dot(omega, x_axis), dot(omega, cross(d, x_axis)), 0.0)
    return ((_ATTITUDE, (boot_ms(s.now_us), roll, pitch, 0.0, *rates)),)


class Stream(NamedTuple):
    """One row of the table."""

    component: int
    interval_us: int  # default; OFF: sent on request only
    build: Builder


def _interval_us(hertz: int) -> int:
    return 1_000_000 // hertz


_AUTOPILOT, _DIALECT = AUTOPILOT_COMPONENT, DIALECT_COMPONENT

STREAMS: dict[int, Stream] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: Stream(_AUTOPILOT, HEARTBEAT_US, _heartbeat),
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: Stream(_AUTOPILOT, _interval_us(2), _sys_status),
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: Stream(_AUTOPILOT, _interval_us(1), _system_time),
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: Stream(_AUTOPILOT, _interval_us(1), _extended_sys_state),
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: Stream(_AUTOPILOT, _interval_us(1), _battery_status),
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: Stream(_AUTOPILOT, _interval_us(2), _gps_raw_int),
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: Stream(_AUTOPILOT, _interval_us(1), _home_position),
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: Stream(_AUTOPILOT, _interval_us(1), _mission_current),
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS: Stream(_AUTOPILOT, _interval_us(1), _fence_status),
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: Stream(_AUTOPILOT, _interval_us(1), _estimator_status),
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: Stream(_AUTOPILOT, _interval_us(1), _ekf_status_report),
    mavlink.MAVLINK_MSG_ID_VIBRATION: Stream(_AUTOPILOT, _interval_us(1), _vibration),
    mavlink.MAVLINK_MSG_ID_WIND_COV: Stream(_AUTOPILOT, _interval_us(1), _wind_cov),
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: Stream(_AUTOPILOT, _interval_us(1), scaled_pressure),
    mavlink.MAVLINK_MSG_ID_SCALED_IMU: Stream(_AUTOPILOT, OFF, scaled_imu),
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: Stream(_AUTOPILOT, OFF, highres_imu),
    mavlink.MAVLINK_MSG_ID_ODOMETRY: Stream(_AUTOPILOT, OFF, odometry),
    mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: Stream(_AUTOPILOT, OFF, actuator_output_status),
    mavlink.MAVLINK_MSG_ID_ESC_STATUS: Stream(_AUTOPILOT, OFF, esc_status),
    mavlink.MAVLINK_MSG_ID_ESC_INFO: Stream(_AUTOPILOT, OFF, esc_info),
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: Stream(_AUTOPILOT, OFF, rc_channels),
    mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION: Stream(_AUTOPILOT, OFF, flight_information),
    mavlink.MAVLINK_MSG_ID_ATTITUDE: Stream(_AUTOPILOT, _interval_us(25), _attitude),
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: Stream(_AUTOPILOT, _interval_us(25), _attitude_quaternion),
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: Stream(_AUTOPILOT, _interval_us(20), _local_position_ned),
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Stream(_AUTOPILOT, _interval_us(10), _global_position_int),
    mavlink.MAVLINK_MSG_ID_ALTITUDE: Stream(_AUTOPILOT, _interval_us(5), _altitude),
    mavlink.MAVLINK_MSG_ID_VFR_HUD: Stream(_AUTOPILOT, _interval_us(5), _vfr_hud),
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: Stream(
        _AUTOPILOT, _interval_us(10), _position_target_local_ned
    ),
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: Stream(_AUTOPILOT, _interval_us(10), _attitude_target),
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: Stream(_AUTOPILOT, _interval_us(5), _servo_output_raw),
    mavlink.MAVLINK_MSG_ID_DEBUG_VECT: Stream(_AUTOPILOT, _interval_us(5), _debug_vect),
    mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: Stream(_AUTOPILOT, _interval_us(5), _named_value_float),
    mavlink.MAVLINK_MSG_ID_WINCH_STATUS: Stream(WINCH_COMPONENT, _interval_us(2), _winch_status),
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: Stream(_AUTOPILOT, OFF, _autopilot_version),
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: Stream(_AUTOPILOT, OFF, _gps_global_origin),
    mavlink.MAVLINK_MSG_ID_PROTOCOL_VERSION: Stream(_AUTOPILOT, OFF, _protocol_version),
    # not streamed: tools that do not know these messages would count them as lost
    mavlink.MAVLINK_MSG_ID_CURRENT_MODE: Stream(_AUTOPILOT, OFF, _current_mode),
    mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR: Stream(_AUTOPILOT, OFF, _available_modes_monitor),
    mavlink.MAVLINK_MSG_ID_LOAD_STATE: Stream(_DIALECT, _interval_us(20), _load_state),
    mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT: Stream(_DIALECT, _interval_us(10), _load_setpoint),
    mavlink.MAVLINK_MSG_ID_CASCADE_ERRORS: Stream(_DIALECT, _interval_us(5), _cascade_errors),
    mavlink.MAVLINK_MSG_ID_ROTOR_STATE: Stream(_DIALECT, _interval_us(5), _rotor_state),
    mavlink.MAVLINK_MSG_ID_FILTER_STATE: Stream(_DIALECT, _interval_us(50), _filter_state),
}

# Intervals on a link to a program that differ from the defaults, as in PX4's profile `onboard`
PROGRAM_INTERVALS_US: dict[int, int] = {
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: _interval_us(50),
    mavlink.MAVLINK_MSG_ID_ODOMETRY: _interval_us(30),
    mavlink.MAVLINK_MSG_ID_ESC_STATUS: _interval_us(5),
    mavlink.MAVLINK_MSG_ID_ESC_INFO: _interval_us(1),
}

_DATA_STREAM_GROUPS: dict[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: (
        mavlink.MAVLINK_MSG_ID_SCALED_IMU,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,
    ),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
    ),
    mavlink.MAV_DATA_STREAM_RAW_CONTROLLER: (
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
    ),
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: (
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
    ),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD, mavlink.MAVLINK_MSG_ID_ALTITUDE),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_VIBRATION,
    ),
}
# The messages of each group of REQUEST_DATA_STREAM
DATA_STREAM_GROUPS = _DATA_STREAM_GROUPS | {
    mavlink.MAV_DATA_STREAM_ALL: tuple(sum(_DATA_STREAM_GROUPS.values(), ()))
}

# Other parts of the vehicle send messages with ids that the autopilot uses as well: their keys have a bit
# above the 24 bits of a message id, so that they differ from the keys above
MESSAGE_ID_MASK = (1 << 24) - 1
# The winch's HEARTBEAT is sent on a link only after a message on this link was addressed to the winch:
# DroneKit and `set_mode` of pymavlink take the last HEARTBEAT for that of the vehicle
WINCH_HEARTBEAT = 1 << 25 | mavlink.MAVLINK_MSG_ID_HEARTBEAT
COMPONENT_STREAMS: dict[int, Stream] = {
    WINCH_HEARTBEAT: Stream(WINCH_COMPONENT, HEARTBEAT_US, _winch_heartbeat)
}
# The load as a separate MAVLink system
LOAD_SYSTEM_BIT = 1 << 24
LOAD_STREAMS: dict[int, Stream] = {
    LOAD_SYSTEM_BIT | mavlink.MAVLINK_MSG_ID_HEARTBEAT: Stream(LOAD_COMPONENT, HEARTBEAT_US, _load_heartbeat),
    LOAD_SYSTEM_BIT | mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Stream(
        LOAD_COMPONENT, _interval_us(5), _load_global_position_int
    ),
    LOAD_SYSTEM_BIT | mavlink.MAVLINK_MSG_ID_ATTITUDE: Stream(
        LOAD_COMPONENT, _interval_us(5), _load_attitude
    ),
}

# Sent immediately to every link, in addition to their rate, when the values picked here have changed
WATCHED: dict[int, Callable[[Snapshot], tuple[Any, ...]]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: lambda s: (s.armed, s.main_mode, s.sub_mode, s.system_status),
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: lambda s: (s.landed_state,),
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: lambda s: (
        s.mission_current,
        s.mission_total,
        s.mission_state,
        _in_mission_mode(s),
        s.plan_ids,
    ),
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: lambda s: (s.home, s.home_position),
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS: lambda s: (s.breach, s.breaches),
}
