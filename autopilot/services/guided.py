"""Setpoints, sticks and targets: messages that are repeated again and again and are never acknowledged.

Each message becomes a request in ENU. A message that requests nothing that can be flown is refused by a
STATUSTEXT, once in WARNING_INTERVAL_US for each reason. Body axes are level and follow the heading; a yaw of
NaN is ignored. Of two ground stations that send their sticks, as they do whenever one is attached, one is
followed.
"""

from __future__ import annotations

import math
from typing import Any

from autopilot.geometry.frames import enu_from_ned, flu_from_frd
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.services.records import Decide, Output, Peer, SendText, Verdict
from autopilot.services.requests import (
    FollowAttitude,
    FollowRates,
    FollowSetpoint,
    FollowStick,
    FollowTarget,
)
from autopilot.services.text_limiter import TextLimiter
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink

MAX_BODY_RATE_RAD_S = 10.0  # of a body rate
STICK_KEPT_US = 500_000  # without a message of its stick, another ground station's is followed
_POSITION_BITS, _VELOCITY_BITS, _ACCELERATION_BITS, _FORCE = 0x7, 0x38, 0x1C0, 0x200
_NO_YAW, _NO_YAW_RATE = 0x400, 0x800
_RATE_BITS = 0x7  # of an attitude setpoint: about forward, right, down
_NO_ATTITUDE = mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
_NO_THRUST = mavlink.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE
_NO_STICK = 32767  # INT16_MAX: the axis does not exist
_NOT_OVERRIDDEN = (0, 65535)  # of a channel: given back, ignored
# bits of the capabilities of FOLLOW_TARGET: what its sender estimates
_TARGET_POSITION, _TARGET_VELOCITY, _TARGET_ACCEL = 0x1, 0x2, 0x4
_PULSE_CENTRE_US, _PULSE_RANGE_US, _PULSE_MARGIN_US = 1500, 500, 200

_BODY_FRAMES = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD)
_LOCAL_FRAMES = (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_OFFSET_NED, *_BODY_FRAMES)
_ABOVE_HOME = (
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
)
_ABOVE_SEA = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)

SetpointRequest = FollowSetpoint | FollowAttitude | FollowRates | FollowStick | FollowTarget


def _masked(values: tuple[float, float, float], mask: int, shift: int) -> Vec3:
    """The values, NaN where a mask bit is set, which means to ignore the value."""
    n, e, d = (math.nan if mask >> (shift + i) & 1 else v for i, v in enumerate(values))
    return (n, e, d)


def _has_invalid_value(values: tuple[float, float, float], mask: int, shift: int) -> bool:
    """Whether a value that is to be used is not a finite number."""
    return any(not mask >> (shift + i) & 1 and not math.isfinite(v) for i, v in enumerate(values))


def _heading(m: Any) -> float:
    """Heading that a position setpoint requests, from east to north; NaN: none."""
    return math.nan if m.type_mask & _NO_YAW else 0.5 * math.pi - m.yaw


def _yaw_rate(m: Any) -> float:
    """Rate (rad/s) at which the heading is to turn; NaN: none."""
    return math.nan if m.type_mask & _NO_YAW_RATE else -m.yaw_rate


def _moves_nothing(mask: int) -> bool:
    """Whether no position, velocity or acceleration is to be used."""
    return all(mask & bits == bits for bits in (_POSITION_BITS, _VELOCITY_BITS, _ACCELERATION_BITS))


def _velocity(m: Any) -> Vec3:
    """The requested velocity, NED or body FRD; zero if only the heading is to change."""
    return ZERO if _moves_nothing(m.type_mask) else _masked((m.vx, m.vy, m.vz), m.type_mask, 3)


def _problem(m: Any, position: tuple[float, float, float]) -> str:
    """Why a position setpoint cannot be used, or an empty string."""
    mask = m.type_mask
    # the bit makes the accelerations forces, if any is used; MAVProxy sets it and uses none
    if mask & _FORCE and mask & _ACCELERATION_BITS != _ACCELERATION_BITS:
        return "Setpoint refused: forces are not followed"
    if _moves_nothing(mask) and math.isnan(_heading(m)) and math.isnan(_yaw_rate(m)):
        return "Setpoint refused: no position, velocity, acceleration or yaw is asked for"
    used = ((position, 0), ((m.vx, m.vy, m.vz), 3), ((m.afx, m.afy, m.afz), 6))
    if any(_has_invalid_value(values, mask, shift) for values, shift in used):
        return "Setpoint refused: a used value is not a number"
    if math.isinf(_heading(m)) or math.isinf(_yaw_rate(m)):
        return "Setpoint refused: yaw is infinite"
    return ""


def read_local(m: Any) -> FollowSetpoint | Verdict:
    """SET_POSITION_TARGET_LOCAL_NED."""
    frame, mask = m.coordinate_frame, m.type_mask
    if frame not in _LOCAL_FRAMES:
        return _refused(f"Setpoint refused: frame {frame}; must be one of 1, 7, 8, 9, 12")
    position = (m.x, m.y, m.z)
    problem = _problem(m, position)
    if problem:
        return _refused(problem)
    body = frame in _BODY_FRAMES
    convert = flu_from_frd if body else enu_from_ned
    return FollowSetpoint(
        convert(_masked(position, mask, 0)),
        convert(_velocity(m)),
        convert(_masked((m.afx, m.afy, m.afz), mask, 6)),
        relative=frame != mavlink.MAV_FRAME_LOCAL_NED,
        body=body,
        heading_rad=_heading(m),
        yaw_rate_rad_s=_yaw_rate(m),
    )


def read_global(m: Any, home: Home) -> FollowSetpoint | Verdict:
    """SET_POSITION_TARGET_GLOBAL_INT."""
    frame, mask = m.coordinate_frame, m.type_mask
    if frame not in _ABOVE_HOME and frame not in _ABOVE_SEA:
        return _refused(f"Setpoint refused: frame {frame}; must be one of 0, 3, 5, 6")
    horizontal_used = mask & 0x3 != 0x3
    if horizontal_used and (abs(m.lat_int) > 900_000_000 or abs(m.lon_int) > 1_800_000_000):
        return _refused("Setpoint refused: no such place")
    problem = _problem(m, (0.0, 0.0, m.alt))
    if problem:
        return _refused(problem)
    east, north = 0.0, 0.0
    if horizontal_used:
        east, north, _ = enu_from_geodetic(m.lat_int, m.lon_int, 0, home)
    height = m.alt - home.altitude_m if frame in _ABOVE_SEA else m.alt
    return FollowSetpoint(
        enu_from_ned(_masked((north, east, -height), mask, 0)),
        enu_from_ned(_velocity(m)),
        enu_from_ned(_masked((m.afx, m.afy, m.afz), mask, 6)),
        relative=False,
        heading_rad=_heading(m),
        yaw_rate_rad_s=_yaw_rate(m),
    )


def read_attitude(m: Any) -> FollowAttitude | FollowRates | Verdict:
    """SET_ATTITUDE_TARGET: thrust axis and heading of the quaternion, or body rates if there is no
    quaternion; thrust as a share."""
    mask = m.type_mask
    if not mask & _NO_THRUST and not 0.0 <= m.thrust <= 1.0:
        return _refused("Attitude setpoint refused: thrust must be 0 ... 1")
    thrust = None if mask & _NO_THRUST else m.thrust
    rates = (m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate)
    if any(not mask >> i & 1 and not abs(rate) <= MAX_BODY_RATE_RAD_S for i, rate in enumerate(rates)):
        limit = f"-{MAX_BODY_RATE_RAD_S:g} ... {MAX_BODY_RATE_RAD_S:g} rad/s"
        return _refused(f"Attitude setpoint refused: rates must be {limit}")
    if mask & _NO_ATTITUDE:
        if mask & _RATE_BITS == _RATE_BITS:
            return _refused("Attitude setpoint refused: neither attitude nor body rates are asked for")
        p, q, r = (0.0 if mask >> i & 1 else rate for i, rate in enumerate(rates))
        return FollowRates(flu_from_frd((p, q, r)), thrust)
    w, x, y, z = m.q
    size = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.5 < size < 2.0:
        return _refused("Attitude setpoint refused: the quaternion is not of length 1")
    w, x, y, z = w / size, x / size, y / size, z / size
    # minus the third column of the rotation: NED
    up_ned = (-2.0 * (x * z + w * y), -2.0 * (y * z - w * x), -(w * w - x * x - y * y + z * z))
    thrust_axis = enu_from_ned(up_ned)
    # heading of the level part of the first column, forward
    yaw = math.atan2(2.0 * (x * y + w * z), w * w + x * x - y * y - z * z)
    yaw_rate = math.nan if mask & mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE else -m.body_yaw_rate
    return FollowAttitude(thrust_axis, thrust, 0.5 * math.pi - yaw, yaw_rate)


def read_stick(m: Any) -> FollowStick | Verdict:
    """MANUAL_CONTROL: x forward, y right, z 0 ... 1000 with 500 for neither up nor down, r clockwise."""
    axes = [0.0 if v == _NO_STICK else v / 1000.0 for v in (m.x, m.y, m.r)]
    vertical = 0.0 if m.z == _NO_STICK else (m.z - 500.0) / 500.0
    if max(map(abs, (*axes, vertical))) > 1.0:
        return _refused("MANUAL_CONTROL refused: x, y, r must be -1000 ... 1000 and z 0 ... 1000")
    return FollowStick((axes[0], -axes[1], vertical), -axes[2])


def read_channels(m: Any) -> FollowStick | Verdict | None:
    """RC_CHANNELS_OVERRIDE as ArduPilot assigns it: 1 roll, 2 pitch (low: forward), 3 throttle, 4 yaw; None:
    none of them is overridden.

    1000 ... 2000 us, centred at 1500; a channel that is not overridden is centred.
    """
    pulses = (m.chan1_raw, m.chan2_raw, m.chan3_raw, m.chan4_raw)
    if all(pulse in _NOT_OVERRIDDEN for pulse in pulses):
        return None
    offsets_us = [0 if pulse in _NOT_OVERRIDDEN else pulse - _PULSE_CENTRE_US for pulse in pulses]
    if max(map(abs, offsets_us)) > _PULSE_RANGE_US + _PULSE_MARGIN_US:
        return _refused("RC_CHANNELS_OVERRIDE refused: channels 1 ... 4 must be 800 ... 2200 us, or 0")
    right, back, up, clockwise = (max(-1.0, min(1.0, offset / _PULSE_RANGE_US)) for offset in offsets_us)
    return FollowStick((-back, -right, up), -clockwise)


def read_target(m: Any, home: Home) -> FollowTarget | Verdict:
    """FOLLOW_TARGET. Without a velocity, an acceleration or an altitude, these are not reported; the altitude
    is then that of home."""
    is_place = abs(m.lat) <= 900_000_000 and abs(m.lon) <= 1_800_000_000
    if not m.est_capabilities & _TARGET_POSITION or not is_place:
        return _refused("Target refused: FOLLOW_TARGET without a position")
    east, north, _ = enu_from_geodetic(m.lat, m.lon, 0, home)
    height = m.alt - home.altitude_m if math.isfinite(m.alt) else 0.0

    def reported(capability: int, ned: Any) -> Vec3 | None:
        if not m.est_capabilities & capability or not all(map(math.isfinite, ned)):
            return None
        return enu_from_ned((ned[0], ned[1], ned[2]))

    velocity = reported(_TARGET_VELOCITY, m.vel)
    return FollowTarget((east, north, height), velocity, reported(_TARGET_ACCEL, m.acc))


def _refused(text: str) -> Verdict:
    return Verdict(mavlink.MAV_RESULT_DENIED, text)


class GuidedService:
    """Turns setpoints and sticks into requests, or reports why it cannot."""

    def __init__(self, home: Home, system: int) -> None:
        self._home = home
        self._system = system
        self._limiter = TextLimiter()
        self._stick_peer: Peer | None = None  # whose stick is followed
        self._stick_us = 0  # when its last message came

    def receive_local(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """SET_POSITION_TARGET_LOCAL_NED."""
        return self._handle_request(read_local(message), now_us, decide)

    def receive_global(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """SET_POSITION_TARGET_GLOBAL_INT."""
        return self._handle_request(read_global(message, self._home), now_us, decide)

    def receive_attitude(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """SET_ATTITUDE_TARGET."""
        return self._handle_request(read_attitude(message), now_us, decide)

    def receive_stick(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MANUAL_CONTROL, which addresses a system and has no target component."""
        if message.target not in (0, self._system):
            return []
        return self._handle_stick(read_stick(message), peer, now_us, decide)

    def receive_channels(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """RC_CHANNELS_OVERRIDE."""
        request = read_channels(message)
        return [] if request is None else self._handle_stick(request, peer, now_us, decide)

    def receive_target(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """FOLLOW_TARGET, which addresses no system."""
        return self._handle_request(read_target(message, self._home), now_us, decide)

    def _handle_stick(
        self, request: FollowStick | Verdict, peer: Peer, now_us: int, decide: Decide
    ) -> list[Output]:
        """Follow the stick of one ground station; those of others only after it has fallen silent. This is
        reported when one of them is moved."""
        if isinstance(request, FollowStick):
            followed = self._stick_peer or peer
            if followed.name != peer.name and now_us - self._stick_us < STICK_KEPT_US:
                if not any((*request.velocity_share, request.yaw_rate)):
                    return []
                request = _refused(f"Stick of {peer.name} ignored: that of {followed.name} is followed")
            else:
                self._stick_peer, self._stick_us = peer, now_us
        return self._handle_request(request, now_us, decide)

    def _handle_request(
        self, request: SetpointRequest | Verdict, now_us: int, decide: Decide
    ) -> list[Output]:
        verdict = request if isinstance(request, Verdict) else decide(request)
        if verdict.text is None or not self._limiter.allows(verdict.text, now_us):
            return []
        is_warning = verdict.warns or verdict.result != mavlink.MAV_RESULT_ACCEPTED
        severity = mavlink.MAV_SEVERITY_WARNING if is_warning else mavlink.MAV_SEVERITY_INFO
        return [SendText(severity, verdict.text)]
