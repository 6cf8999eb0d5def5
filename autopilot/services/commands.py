"""COMMAND_LONG, COMMAND_INT and the messages SET_MODE and MISSION_SET_CURRENT, which act as commands.

`PARSERS` states for each command how its parameters become a request, or why they are refused. The function
that decides on a request is an argument. Every command addressed to the vehicle gets one COMMAND_ACK, sent to
the requesting client only; a command for another system is not answered.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from autopilot.geometry.linear import Vec3
from autopilot.services import snapshot
from autopilot.services.identity import AUTO, AUTO_TAKEOFF, SUPPORTED_MODES, Flavour, Identity, Mode
from autopilot.services.records import Announce, Decide, Output, Peer, RefusalCleared, Send, SendText, Verdict
from autopilot.services.requests import (
    MAX_SPEED_M_S,
    MIN_SPEED_M_S,
    Arm,
    ChangeAltitude,
    ChangeSpeed,
    Continue,
    EnableFence,
    EndpointRequest,
    GetMessageInterval,
    Grab,
    InjectFailure,
    Land,
    Orbit,
    Pause,
    Reboot,
    Release,
    Reposition,
    Request,
    RequestCapabilities,
    RequestMessage,
    ResetParameters,
    ReturnHome,
    RunPrearmChecks,
    SetCurrent,
    SetHome,
    SetMessageInterval,
    SetMode,
    StartMission,
    StoreParameters,
    Takeoff,
    Terminate,
    Winch,
)
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import turn_heading
from autopilot.wire.parameter_table import decimal_from_float32
from missions.model import LookAt, TurnHeading

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
_REFUSED = (DENIED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)

FORCE_ARM = (2989.0, 21196.0)  # the magic numbers in use: ArduPilot and QGroundControl, PX4 and MAVSDK
# For this time a client that missed the ACK may repeat its command: QGroundControl after 3 s, others earlier
REPEAT_US = 4_000_000
DUPLICATE_US = 1_000_000  # for this time a frame that the network has duplicated may arrive again
_MODE_BYTE = 0xFF  # a mode parameter above this is a packed custom mode
GRIPPERS = WINCHES = (0.0, 1.0)  # by number; 0: all
_SPEEDS, _VERTICAL_SPEEDS = range(4), (2, 3)  # SPEED_TYPE
_SPEED_UNCHANGED = (0.0, -1.0)  # of DO_REPOSITION
_SPEED_LIMITS = f"{MIN_SPEED_M_S:g} ... {MAX_SPEED_M_S:g} m/s"
_WINCH_ACTIONS = "1 (by a length), 2 (at a rate), 5 (hold) and 6 (retract) are"
_NO_CHANGE, _DEFAULT_SPEED = -1.0, -2.0  # of a speed
_PRESENT_ITEM = -1  # of DO_SET_MISSION_CURRENT
# ORBIT_YAW_BEHAVIOUR: the nose points to the centre (True), keeps its heading (False), or does as before
_ORBIT_YAWS: dict[float, bool | None] = {
    mavlink.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TO_CIRCLE_CENTER: True,
    mavlink.ORBIT_YAW_BEHAVIOUR_HOLD_INITIAL_HEADING: False,
    mavlink.ORBIT_YAW_BEHAVIOUR_UNCONTROLLED: None,
    mavlink.ORBIT_YAW_BEHAVIOUR_UNCHANGED: None,
}
_ORBIT_YAWS_NOT_OFFERED = (
    mavlink.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE,
    mavlink.ORBIT_YAW_BEHAVIOUR_RC_CONTROLLED,
)
# "not a number" in an integer coordinate; the second is the one to which MAVSDK converts NaN
_NO_COORDINATES = (2**31 - 1, -(2**31))
MAX_INTERVAL_US = 2**31 - 1  # that MESSAGE_INTERVAL can state; longer ones count as this one

_AMSL_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_ABOVE_HOME_FRAMES = (
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
)


class Call(NamedTuple):
    """A command as it arrived: `frame` None for COMMAND_LONG, whose coordinates are degrees."""

    command: int
    p: tuple[float, float, float, float]
    x: float  # param5: latitude in degE7 (COMMAND_INT) or degrees
    y: float  # param6
    z: float  # param7
    frame: int | None


class Context(NamedTuple):
    """What a parser needs to know about the vehicle."""

    home: Home
    flavour: Flavour
    rotors: int = 4


Parser = Callable[[Call, Context], Request | Verdict]


def _refused(text: str) -> Verdict:
    return Verdict(DENIED, text)


def _as_integer(value: float) -> int | None:
    """`value` as an integer, or None if it is not a whole number."""
    return int(value) if math.isfinite(value) and value.is_integer() else None


def _altitude_above_home(call: Call, context: Context) -> float | None:
    """param7 as height above home [m]; None for NaN."""
    if math.isnan(call.z):
        return None
    above_sea = call.frame in _AMSL_FRAMES or (call.frame is None and not context.flavour.takeoff_above_home)
    return call.z - context.home.altitude_m if above_sea else call.z


def _position_enu(call: Call, context: Context) -> Vec3 | None:
    """param5 ... param7 as ENU from home [m]; NaN stays NaN, None for invalid coordinates or frame."""
    if call.frame is None:
        latitude, longitude = call.x * 1e7, call.y * 1e7
    elif call.frame in _AMSL_FRAMES or call.frame in _ABOVE_HOME_FRAMES:
        latitude, longitude = call.x, call.y
    else:
        return None
    if abs(latitude) > 90e7 or abs(longitude) > 180e7 or math.isinf(call.z):
        return None
    up = call.z
    if call.frame not in _ABOVE_HOME_FRAMES:
        up -= context.home.altitude_m
    if math.isnan(latitude) or math.isnan(longitude):
        return (math.nan, math.nan, up)
    east, north, _ = enu_from_geodetic(round(latitude), round(longitude), 0, context.home)
    return (east, north, up)


def _arm(call: Call, context: Context) -> Request | Verdict:
    if call.p[0] not in (0.0, 1.0):
        return _refused(f"Arm: action (param1) = {call.p[0]:g}; must be 1 (arm) or 0 (disarm)")
    return Arm(arm=call.p[0] == 1.0, force=call.p[1] in FORCE_ARM)


def _takeoff(call: Call, context: Context) -> Request | Verdict:
    if call.frame is not None and call.frame not in (*_AMSL_FRAMES, *_ABOVE_HOME_FRAMES):
        return _refused(f"Take-off: frame {call.frame}; must be 0, 3, 5 or 6")
    if math.isinf(call.z):
        return _refused(f"Take-off: altitude {call.z:g} m (param7); must be a number, or NaN: the default")
    altitude_m = _altitude_above_home(call, context)
    if altitude_m is not None and altitude_m <= 0.0:
        reference = "above home" if altitude_m == call.z else f"above sea level, {altitude_m:g} m above home"
        return _refused(f"Take-off: altitude {call.z:g} m {reference} (param7); must be above home")
    return Takeoff(altitude_m)


def _mode_of_pair(main: int, sub: int, context: Context) -> Request | Verdict:
    mode = context.flavour.mode(main, sub)
    if mode is None:
        return _refused(context.flavour.mode_refusal(f"Mode {main}/{sub} unknown"))
    return _supported_mode(mode, SetMode(mode.main, mode.sub, None, mode.name), context)


def _mode_of_number(number: int, context: Context) -> Request | Verdict:
    mode = context.flavour.mode_of_number(number)
    if mode is None:
        return _refused(context.flavour.mode_refusal(f"Mode {number} unknown"))
    return _supported_mode(mode, SetMode(mode.main, mode.sub, number, mode.name), context)


def _supported_mode(mode: Mode, request: SetMode, context: Context) -> Request | Verdict:
    if mode.pair not in SUPPORTED_MODES:
        return _refused(context.flavour.mode_refusal(f"{mode.name} not flown"))
    return request


def _set_mode(call: Call, context: Context) -> Request | Verdict:
    flags, number = _as_integer(call.p[0]), _as_integer(call.p[1])
    sub = 0 if math.isnan(call.p[2]) else _as_integer(call.p[2])
    if flags is None or number is None or sub is None or number < 0:
        return _refused("Set mode: flags, main mode and sub-mode (param1 ... param3) must be whole numbers")
    if not flags & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return Verdict(
            UNSUPPORTED, "Set mode: only custom modes are known; the flags (param1) must have bit 0"
        )
    if number <= _MODE_BYTE and context.flavour.modes_are_packed:
        return _mode_of_pair(number, sub, context)
    return _mode_of_number(number, context)


def _set_standard_mode(call: Call, context: Context) -> Request | Verdict:
    standard = _as_integer(call.p[0])
    mode = None if standard is None else context.flavour.mode_of_standard(standard)
    if mode is None:
        return Verdict(UNSUPPORTED, f"Set mode: standard mode (param1) {call.p[0]:g} is none of those flown")
    return SetMode(mode.main, mode.sub, mode.custom_mode, mode.name)


def _start_mission(call: Call, context: Context) -> Request | Verdict:
    if math.isnan(call.p[0]):
        return StartMission(None)
    first = _as_integer(call.p[0])
    if first is None or first < 0:
        return _refused(f"Mission start: first item (param1) = {call.p[0]:g}; must be an item number")
    return StartMission(first)


def _pause_continue(call: Call, context: Context) -> Request | Verdict:
    choice: dict[float, Request] = {0.0: Pause(), 1.0: Continue()}
    request = choice.get(call.p[0])
    return request or _refused(f"Pause: action (param1) = {call.p[0]:g}; must be 0 (pause) or 1 (continue)")


def _set_current(call: Call, context: Context) -> Request | Verdict:
    seq, reset = _as_integer(call.p[0]), call.p[1]
    if seq is None or seq < _PRESENT_ITEM:
        text = f"Set current item: item (param1) = {call.p[0]:g}; must be an item number"
        return _refused(f"{text}, or -1 (the present one)")
    if reset not in (0.0, 1.0) and not math.isnan(reset):
        return _refused(f"Set current item: reset (param2) = {reset:g}; must be 0 (no) or 1 (yes)")
    return SetCurrent(None if seq == _PRESENT_ITEM else seq, reset == 1.0)


def _reposition(call: Call, context: Context) -> Request | Verdict:
    position = _position_enu(call, context)
    if position is None:
        return _refused("Reposition: no such place; must be latitude and longitude of a global frame")
    east, north, up = (None if math.isnan(value) else value for value in position)
    speed = None if call.p[0] in _SPEED_UNCHANGED or math.isnan(call.p[0]) else call.p[0]
    if speed is not None and not MIN_SPEED_M_S <= speed <= MAX_SPEED_M_S:
        text = f"Reposition: speed (param1) = {speed:g} m/s; must be {_SPEED_LIMITS}"
        return _refused(f"{text}, or 0 or -1 (unchanged)")
    if math.isinf(call.p[3]):
        return _refused(f"Reposition: yaw (param4) = {call.p[3]:g} rad; must be a number, or NaN: unchanged")
    yaw = _yaw(call, context)
    if east is None and up is None and yaw is None:
        return Pause()  # ground stations send this for "hold here"
    flags = _as_integer(call.p[1]) or 0
    change_mode = bool(flags & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
    return Reposition(east, north, up, change_mode, speed, yaw)


def _yaw(call: Call, context: Context) -> float | None:
    """param4 as a heading from east to north [rad], or None. ArduPilot ignores it, and its clients send 0."""
    if not context.flavour.uses_reposition_yaw or not math.isfinite(call.p[3]):
        return None
    return 0.5 * math.pi - call.p[3]


def _orbit(call: Call, context: Context) -> Request | Verdict:
    position = _position_enu(call, context)
    if position is None:
        return _refused("Orbit: no such place; must be latitude and longitude of a global frame")
    if math.isinf(call.p[0]) or call.p[0] == 0.0:
        text = f"Orbit: radius (param1) = {call.p[0]:g} m; must be a number other than 0"
        return _refused(f"{text}, or NaN (the present or default one)")
    if math.isinf(call.p[1]):
        return _refused(f"Orbit: speed (param2) = {call.p[1]:g} m/s; must be finite")
    behaviour = call.p[2]
    if behaviour in _ORBIT_YAWS_NOT_OFFERED:
        text = f"Orbit: yaw behaviour (param3) {behaviour:g} is not offered; 0 (nose to the centre), "
        return Verdict(UNSUPPORTED, f"{text}1 (heading kept), 2 and 5 (as before) are")
    if behaviour not in _ORBIT_YAWS and not math.isnan(behaviour):
        return _refused(f"Orbit: yaw behaviour (param3) = {behaviour:g}; must be 0, 1, 2 or 5")
    east, north, up = (None if math.isnan(value) else value for value in position)
    radius, speed = (None if math.isnan(value) else value for value in call.p[:2])
    return Orbit(radius, speed, east, north, up, faces_centre=_ORBIT_YAWS.get(behaviour))


def _do_orbit(call: Call, context: Context) -> Request | Verdict:
    """A circle. MAVSDK sends its height above sea level in frame 3, as PX4 reads it in any frame; a height
    above home is sent in frame 6."""
    if call.frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT:
        call = call._replace(frame=mavlink.MAV_FRAME_GLOBAL)
    return _orbit(call, context)


def _change_altitude(call: Call, context: Context) -> Request | Verdict:
    frame = _as_integer(call.p[1])
    if not math.isfinite(call.p[0]) or frame not in (*_AMSL_FRAMES, *_ABOVE_HOME_FRAMES):
        return _refused(
            f"Change altitude: height (param1) = {call.p[0]:g} m in frame (param2) {call.p[1]:g}; "
            "must be a number, in one of the frames 0, 3, 5, 6"
        )
    return ChangeAltitude(call.p[0] - (context.home.altitude_m if frame in _AMSL_FRAMES else 0.0))


def _loiter(call: Call, context: Context) -> Request | Verdict:
    """Fly to the position (0, 0 and NaN: here) and stay there."""
    if call.x == 0.0 and call.y == 0.0:
        call = call._replace(x=math.nan, y=math.nan, z=call.z or math.nan)
    position = _position_enu(call, context)
    if position is None:
        return _refused("Loiter: no such place; must be latitude and longitude of a global frame")
    east, north, up = (None if math.isnan(value) else value for value in position)
    return Pause() if east is None and up is None else Reposition(east, north, up, True)


def _loiter_turns(call: Call, context: Context) -> Request | Verdict:
    if not (math.isfinite(call.p[0]) and call.p[0] > 0.0):
        return _refused(f"Loiter: turns (param1) = {call.p[0]:g}; must be > 0")
    if call.x == 0.0 and call.y == 0.0:
        call = call._replace(x=math.nan, y=math.nan, z=call.z or math.nan)
    orbit = _orbit(call._replace(p=(call.p[2], math.nan, math.nan, 0.0)), context)
    return replace(orbit, turns=call.p[0]) if isinstance(orbit, Orbit) else orbit


def _calibrate(call: Call, context: Context) -> Request | Verdict:
    parameters = (*call.p, call.x, call.y, call.z)
    if not any(value for value in parameters):
        return Verdict(ACCEPTED)  # all 0: stop a calibration, of which none is under way
    return Verdict(UNSUPPORTED, "Calibration: sensors are simulated, their errors are what SIM_ says")


def _change_speed(call: Call, context: Context) -> Request | Verdict:
    kind = _as_integer(call.p[0])
    if kind not in _SPEEDS:
        return _refused(
            f"Change speed: speed type (param1) = {call.p[0]:g}; must be 0 (air), 1 (ground), 2 (climb) "
            "or 3 (descent)"
        )
    if kind in _VERTICAL_SPEEDS or call.p[1] == _NO_CHANGE:
        return Verdict(ACCEPTED)  # changes nothing, as in a mission: the load is lifted with MIS_LIFT_SPEED
    if call.p[1] == _DEFAULT_SPEED:
        return ChangeSpeed(None)
    if not MIN_SPEED_M_S <= call.p[1] <= MAX_SPEED_M_S:
        text = f"Change speed: speed (param2) = {call.p[1]:g} m/s; must be {_SPEED_LIMITS}"
        return _refused(f"{text}, or -1 (no change) or -2 (default)")
    return ChangeSpeed(call.p[1])


def _set_home(call: Call, context: Context) -> Request | Verdict:
    if call.p[0] not in (0.0, 1.0):
        text = f"Set home: place (param1) = {call.p[0]:g}; must be 1 (here) or 0 (param5 ... param7)"
        return _refused(text)
    if call.p[0] == 1.0:
        return SetHome(None)
    position = _position_enu(call, context)
    if position is None or any(math.isnan(value) for value in position):
        return _refused(
            "Set home: no such place; must be latitude, longitude and altitude (param5 ... param7) of a "
            "global frame"
        )
    return SetHome(position)


def _terminate(call: Call, context: Context) -> Request | Verdict:
    if call.p[0] != 1.0:
        return _refused(f"Terminate: action (param1) = {call.p[0]:g}; must be 1 (stop the rotors)")
    return Terminate()


def _reboot(call: Call, context: Context) -> Request | Verdict:
    if call.p[0] == 1.0:
        return Reboot()
    return Verdict(UNSUPPORTED, f"Reboot: action (param1) {call.p[0]:g} is not offered; 1 (reboot) is")


def _store_parameters(call: Call, context: Context) -> Request | Verdict:
    if call.p[0] in (0.0, 1.0):
        return StoreParameters(save=call.p[0] == 1.0)
    if call.p[0] == 2.0:
        return ResetParameters()
    text = f"Storage: action (param1) {call.p[0]:g} is not offered"
    return Verdict(UNSUPPORTED, f"{text}; 0 (load), 1 (save) and 2 (reset) are")


def _request_message(call: Call, context: Context) -> Request | Verdict:
    message_id = _as_integer(call.p[0])
    return Verdict(UNSUPPORTED) if message_id is None else RequestMessage(message_id, call.p[1])


def _set_message_interval(call: Call, context: Context) -> Request | Verdict:
    message_id = _as_integer(call.p[0])
    interval = call.p[1]
    if message_id is None:
        return Verdict(UNSUPPORTED)
    if not math.isfinite(interval) or (interval < 0.0 and interval != -1.0):
        return _refused(
            f"Message interval: interval (param2) = {interval:g} us; must be > 0, 0 (default) or -1 (off)"
        )
    return SetMessageInterval(message_id, min(math.ceil(interval), MAX_INTERVAL_US))


def _get_message_interval(call: Call, context: Context) -> Request | Verdict:
    message_id = _as_integer(call.p[0])
    return Verdict(UNSUPPORTED) if message_id is None else GetMessageInterval(message_id)


def _request_capabilities(call: Call, context: Context) -> Request | Verdict:
    return RequestCapabilities()


def _gripper(call: Call, context: Context) -> Request | Verdict:
    if call.p[0] not in GRIPPERS and not math.isnan(call.p[0]):
        return _refused(f"Gripper: gripper (param1) = {call.p[0]:g}; there is one, number 1")
    choice: dict[float, Request | Verdict] = {
        mavlink.GRIPPER_ACTION_RELEASE: Release(),
        mavlink.GRIPPER_ACTION_GRAB: Grab(),
        mavlink.GRIPPER_ACTION_HOLD: Verdict(ACCEPTED),  # the gripper stays as it is
    }
    return choice.get(call.p[1]) or _refused(
        f"Gripper: action (param2) = {call.p[1]:g}; must be 0 (release), 1 (grab) or 2 (hold)"
    )


def _winch(call: Call, context: Context) -> Request | Verdict:
    if call.p[0] not in WINCHES and not math.isnan(call.p[0]):
        return _refused(f"Winch: winch (param1) = {call.p[0]:g}; there is one, number 1")
    action, length, rate = call.p[1], *map(decimal_from_float32, call.p[2:])
    if action == mavlink.WINCH_RELATIVE_LENGTH_CONTROL:
        if not (math.isfinite(length) and math.isfinite(rate)):
            return _refused(
                f"Winch: length (param3) = {length:g} m at rate (param4) = {rate:g} m/s; must be numbers"
            )
        return Winch(length, abs(rate) if rate else None)
    if action == mavlink.WINCH_RATE_CONTROL:
        if not math.isfinite(rate):
            return _refused(f"Winch: rate (param4) = {rate:g} m/s; must be a number")
        return Winch(math.copysign(math.inf, rate), abs(rate)) if rate else Winch(0.0)
    if action == mavlink.WINCH_HOLD:
        return Winch(0.0)
    if action == mavlink.WINCH_RETRACT:
        return Winch(-math.inf)
    return Verdict(UNSUPPORTED, f"Winch: action (param2) {call.p[1]:g} is not offered; {_WINCH_ACTIONS}")


def _condition_yaw(call: Call, context: Context) -> Request | Verdict:
    angle, rate, sense, relative = call.p
    if not math.isfinite(angle) or abs(angle) > 360.0:
        return _refused(f"Yaw: angle (param1) = {angle:g} deg; must be -360 ... 360 deg")
    if sense not in (-1.0, 0.0, 1.0) or relative not in (0.0, 1.0):
        return _refused(
            f"Yaw: sense (param3) = {sense:g}, from (param4) = {relative:g}; must be "
            "-1 (counter-clockwise), 0 (the shorter way) or 1 (clockwise), from 0 (north) or 1 (here)"
        )
    return turn_heading(angle, rate, int(sense), bool(relative))


def _roi_location(call: Call, context: Context) -> Request | Verdict:
    position = _position_enu(call._replace(z=0.0), context)
    if position is None or math.isnan(position[0]):
        return _refused("ROI: no such place; must be latitude and longitude of a global frame")
    return LookAt(position[0], position[1])


def _roi(call: Call, context: Context) -> Request | Verdict:
    """The command whose param1 selects the kind; ArduPilot and MAVProxy leave it 0 and give a position."""
    has_position = not (math.isnan(call.x) or math.isnan(call.y)) and (call.x, call.y) != (0.0, 0.0)
    if call.p[0] in (mavlink.MAV_ROI_NONE, mavlink.MAV_ROI_LOCATION) and has_position:
        return _roi_location(call, context)
    if call.p[0] == mavlink.MAV_ROI_NONE:
        return LookAt(None, None)
    return Verdict(
        UNSUPPORTED, f"ROI: mode (param1) {call.p[0]:g} is not offered; 0 (none) and 3 (a place) are"
    )


def _enable_fence(call: Call, context: Context) -> Request | Verdict:
    if call.p[0] not in (0.0, 1.0):
        return _refused(f"Fence: action (param1) = {call.p[0]:g}; must be 0 (off) or 1 (on)")
    return EnableFence(call.p[0] == 1.0)


# bit of SIM_SENS_FAIL, and of SYS_STATUS; gyroscope and accelerometer are one unit, motion capture is sent as
# visual odometry
_FAILING_SENSORS: dict[int | None, tuple[int, int]] = {
    mavlink.FAILURE_UNIT_SENSOR_GYRO: (1, snapshot.GYRO),
    mavlink.FAILURE_UNIT_SENSOR_ACCEL: (1, snapshot.ACCEL),
    mavlink.FAILURE_UNIT_SENSOR_MAG: (64, snapshot.MAG),
    mavlink.FAILURE_UNIT_SENSOR_BARO: (32, snapshot.BARO),
    mavlink.FAILURE_UNIT_SENSOR_GPS: (16, snapshot.GPS),
    mavlink.FAILURE_UNIT_SENSOR_VIO: (2, snapshot.TRACKER),
}


def _inject_failure(call: Call, context: Context) -> Request | Verdict:
    unit, kind, instance = _as_integer(call.p[0]), _as_integer(call.p[1]), _as_integer(call.p[2])
    motor = unit == mavlink.FAILURE_UNIT_SYSTEM_MOTOR
    if not motor and unit not in _FAILING_SENSORS:
        return Verdict(
            UNSUPPORTED,
            (
                f"Failure: unit (param1) {call.p[0]:g} cannot fail; 0 (gyroscope), 1 (accelerometer), "
                "2 (magnetometer), 3 (barometer), 4 (GNSS), 6 (vehicle pose) and 101 (rotor) can"
            ),
        )
    if kind not in (mavlink.FAILURE_TYPE_OK, mavlink.FAILURE_TYPE_OFF):
        return Verdict(
            UNSUPPORTED, f"Failure: type (param2) {call.p[1]:g} is not offered; 0 (ok) and 1 (off) are"
        )
    fail = kind == mavlink.FAILURE_TYPE_OFF
    if motor:
        if instance is None or instance not in range(context.rotors + 1):
            return _refused(
                f"Failure: rotor (param3) = {call.p[2]:g}; must be 1 ... {context.rotors}, or 0 for all"
            )
        every = (1 << context.rotors) - 1
        return InjectFailure("SIM_ENGINE_FAIL", every if instance == 0 else 1 << (instance - 1), 0, fail)
    if instance not in (0, 1):
        return _refused(f"Failure: instance (param3) = {call.p[2]:g}; must be 1, or 0 for all: there is one")
    return InjectFailure("SIM_SENS_FAIL", *_FAILING_SENSORS[unit], fail=fail)


def _fixed_request(request: Request) -> Parser:
    return lambda call, context: request


def _unsupported(text: str) -> Parser:
    return lambda call, context: Verdict(UNSUPPORTED, text)


_NO_ACTUATOR = _unsupported(
    "Actuators: there are rotors, gripper and winch; DO_GRIPPER and DO_WINCH move these"
)


PARSERS: dict[int, Parser] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_NAV_TAKEOFF: _takeoff,
    mavlink.MAV_CMD_NAV_LAND: _fixed_request(Land()),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _fixed_request(ReturnHome()),
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_DO_SET_STANDARD_MODE: _set_standard_mode,
    mavlink.MAV_CMD_MISSION_START: _start_mission,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: _pause_continue,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: _set_current,
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    mavlink.MAV_CMD_DO_GRIPPER: _gripper,
    mavlink.MAV_CMD_DO_WINCH: _winch,
    mavlink.MAV_CMD_DO_ORBIT: _do_orbit,
    mavlink.MAV_CMD_DO_CHANGE_ALTITUDE: _change_altitude,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: _loiter,
    mavlink.MAV_CMD_NAV_LOITER_TIME: _loiter,  # nothing follows after the time: the load stays
    mavlink.MAV_CMD_NAV_LOITER_TO_ALT: _loiter,
    mavlink.MAV_CMD_NAV_LOITER_TURNS: _loiter_turns,
    mavlink.MAV_CMD_PREFLIGHT_CALIBRATION: _calibrate,
    mavlink.MAV_CMD_DO_SET_HOME: _set_home,
    mavlink.MAV_CMD_DO_FLIGHTTERMINATION: _terminate,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS: _fixed_request(RunPrearmChecks()),
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    mavlink.MAV_CMD_PREFLIGHT_STORAGE: _store_parameters,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_message_interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_message_interval,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _request_capabilities,
    mavlink.MAV_CMD_GET_HOME_POSITION: _fixed_request(
        RequestMessage(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 0.0)
    ),
    mavlink.MAV_CMD_DO_FENCE_ENABLE: _enable_fence,
    mavlink.MAV_CMD_INJECT_FAILURE: _inject_failure,
    mavlink.MAV_CMD_CONDITION_YAW: _condition_yaw,
    mavlink.MAV_CMD_DO_SET_ROI_LOCATION: _roi_location,
    mavlink.MAV_CMD_DO_SET_ROI_NONE: _fixed_request(LookAt(None, None)),
    mavlink.MAV_CMD_DO_SET_ROI: _roi,
    mavlink.MAV_CMD_NAV_ROI: _roi,
    mavlink.MAV_CMD_DO_SET_ACTUATOR: _NO_ACTUATOR,
    mavlink.MAV_CMD_DO_SET_SERVO: _NO_ACTUATOR,
    mavlink.MAV_CMD_DO_SET_RELAY: _NO_ACTUATOR,
    mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION: _fixed_request(
        RequestMessage(mavlink.MAVLINK_MSG_ID_PROTOCOL_VERSION, 0.0)
    ),
}


def _call_of_long(m: Any) -> Call:
    p = (m.param1, m.param2, m.param3, m.param4)
    return Call(m.command, p, m.param5, m.param6, m.param7, None)


def _call_of_int(m: Any) -> Call:
    p = (m.param1, m.param2, m.param3, m.param4)
    x, y = (math.nan if value in _NO_COORDINATES else float(value) for value in (m.x, m.y))
    return Call(m.command, p, x, y, m.z, m.frame)


def _is_relative(request: Request) -> bool:
    """Whether the request moves the vehicle on if it is executed again; all others lead to one state."""
    match request:
        case TurnHeading(relative=relative):
            return relative
        case Winch(length_m):
            return length_m != 0.0 and math.isfinite(length_m)
        case StartMission(first):
            return first is not None  # the mission begins again
    return False


def _is_takeoff(request: Request) -> bool:
    """Whether the request is refused once the vehicle executes it."""
    return isinstance(request, Takeoff) or (
        isinstance(request, SetMode) and (request.main, request.sub) == (AUTO, AUTO_TAKEOFF)
    )


class _ExecutedCommand(NamedTuple):
    """An accepted command, and when it, or its last repetition, arrived in which frame."""

    call: str
    at_us: int
    frame: bytes
    confirmation: int


class CommandService:
    """Commands in, COMMAND_ACK out; the `decide` given with each message decides on the request.

    A client that missed the ACK repeats its command. To execute it again leads to the same state, so this is
    done: the vehicle may have left that state since. Only relative commands are recognised as repetitions,
    and answered without being executed.
    """

    def __init__(self, home: Home, identity: Identity) -> None:
        self.context = Context(home, identity.flavour, identity.rotors)
        self._executed: dict[tuple[Peer, int], _ExecutedCommand] = {}
        self._last: tuple[Peer, int] | None = None

    def _decide_and_answer(
        self, call: str, command: int, request: Request, message: Any, peer: Peer, now_us: int, decide: Decide
    ) -> list[Output]:
        """Have a request decided; return the answer."""
        if _is_relative(request) and self._is_repetition(call, command, message, peer, now_us):
            self._record_executed(call, command, message, peer, now_us)
            return [_ack(command, ACCEPTED, peer)]
        verdict = decide(request)
        if verdict.result in _REFUSED and _is_takeoff(request) and self._is_last(call, command, peer, now_us):
            return [_ack(command, ACCEPTED, peer)]
        if verdict.result == ACCEPTED and not isinstance(request, EndpointRequest):
            self._record_executed(call, command, message, peer, now_us)
            self._last = (peer, command)
        return _answer(command, verdict, peer)

    def _record_executed(self, call: str, command: int, message: Any, peer: Peer, now_us: int) -> None:
        self._executed = {k: d for k, d in self._executed.items() if now_us - d.at_us <= REPEAT_US}
        frame, confirmation = bytes(message.get_msgbuf()), _confirmation(message)
        self._executed[peer, command] = _ExecutedCommand(call, now_us, frame, confirmation)

    def _is_repetition(self, call: str, command: int, message: Any, peer: Peer, now_us: int) -> bool:
        """Whether an executed command arrives again: the same frame, or one that the client has marked by
        counting `confirmation` up."""
        done = self._executed.get((peer, command))
        if done is None or done.call != call:
            return False
        age_us = now_us - done.at_us
        is_duplicate = message.get_msgbuf() == done.frame and age_us <= DUPLICATE_US
        return is_duplicate or (_confirmation(message) > done.confirmation and age_us <= REPEAT_US)

    def _is_last(self, call: str, command: int, peer: Peer, now_us: int) -> bool:
        """Whether the command that was accepted last has arrived again; some clients (MAVSDK) do not mark a
        repetition."""
        done = self._executed.get((peer, command))
        if self._last != (peer, command) or done is None:
            return False
        return done.call == call and now_us - done.at_us <= REPEAT_US

    def receive_long(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """Execute COMMAND_LONG."""
        return self._execute(_call_of_long(message), message, peer, now_us, decide)

    def receive_int(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """Execute COMMAND_INT."""
        return self._execute(_call_of_int(message), message, peer, now_us, decide)

    def receive_set_mode(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """Execute SET_MODE, which is older than the command and is acknowledged like it."""
        request: Request | Verdict = Verdict(UNSUPPORTED, "Set mode: only custom modes are known")
        if message.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            request = _mode_of_number(message.custom_mode, self.context)
        command = mavlink.MAV_CMD_DO_SET_MODE
        if isinstance(request, Verdict):
            return _answer(command, request, peer)
        return self._decide_and_answer(repr(request), command, request, message, peer, now_us, decide)

    def receive_set_current(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """Execute MISSION_SET_CURRENT; it is answered by MISSION_CURRENT, a refusal also by a text."""
        verdict = decide(SetCurrent(message.seq))
        outputs: list[Output] = [Announce(peer.link, (mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,))]
        return _text_outputs(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, verdict, peer) + outputs

    def _execute(self, call: Call, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        parser = PARSERS.get(call.command)
        if parser is None:
            return [_ack(call.command, UNSUPPORTED, peer)]
        request = parser(call, self.context)
        if isinstance(request, Verdict):
            return _answer(call.command, request, peer)
        outputs = self._decide_and_answer(repr(call), call.command, request, message, peer, now_us, decide)
        if isinstance(request, SetCurrent):
            outputs.append(Announce(None, (mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,)))
        return outputs


def _confirmation(message: Any) -> int:
    """How often a client has repeated a command; 0 of messages that do not state it."""
    return getattr(message, "confirmation", 0)


def _text_outputs(command: int, verdict: Verdict, peer: Peer) -> list[Output]:
    accepted = verdict.result == ACCEPTED
    outputs: list[Output] = [RefusalCleared(command)] if accepted else []
    if verdict.text is not None and (verdict.warns or not accepted):
        asker = None if accepted else peer.link
        outputs.append(SendText(mavlink.MAV_SEVERITY_WARNING, verdict.text, command, asker))
    elif verdict.text is not None:
        outputs.append(SendText(mavlink.MAV_SEVERITY_INFO, verdict.text))
    return outputs


def _ack(command: int, result: int, peer: Peer) -> Output:
    message = mavlink.MAVLink_command_ack_message(
        command,
        result,
        target_system=peer.system,
        target_component=peer.component,
    )
    return Send(peer.link, message, peer.addressed)


def _answer(command: int, verdict: Verdict, peer: Peer) -> list[Output]:
    """The reason first, so that it has arrived when the ACK is shown."""
    return [*_text_outputs(command, verdict, peer), _ack(command, verdict.result, peer)]
