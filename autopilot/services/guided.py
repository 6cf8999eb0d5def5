"""Setpoints and sticks: messages that are repeated many times a second and are never acknowledged.

What they ask becomes a request in ENU. A message that asks for nothing that can be flown is refused by a
STATUSTEXT, once in COMPLAIN_US for each reason. The nose is held east by the control law: yaw and yaw rate
are not followed, and body axes are those of the nose.
"""

from __future__ import annotations

import math
from typing import Any

from autopilot.geometry.frames import enu_from_ned
from autopilot.geometry.linear import Vec3
from autopilot.services.records import Decide, Output, Peer, Say, Verdict
from autopilot.services.requests import FollowAttitude, FollowSetpoint, FollowStick
from autopilot.wire.convert import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink

COMPLAIN_US = 5_000_000
STEEPEST_DEG = 60.0  # lean of an attitude setpoint
_POSITION_BITS, _VELOCITY_BITS, _ACCELERATION_BITS, _FORCE = 0x7, 0x38, 0x1C0, 0x200
_NO_ATTITUDE = mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
_NO_THRUST = mavlink.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE
_NO_STICK = 32767  # INT16_MAX: the axis is not there

_BODY_FRAMES = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD)
_LOCAL_FRAMES = (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_OFFSET_NED, *_BODY_FRAMES)
_ABOVE_HOME = (
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
)
_ABOVE_SEA = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)

Asking = FollowSetpoint | FollowAttitude | FollowStick


def _masked(values: tuple[float, float, float], mask: int, shift: int) -> Vec3:
    """The values, NaN where the mask says to ignore them."""
    n, e, d = (math.nan if mask >> (shift + i) & 1 else v for i, v in enumerate(values))
    return (n, e, d)


def _asks_badly(values: tuple[float, float, float], mask: int, shift: int) -> bool:
    """A number that is to be used and is none."""
    return any(not mask >> (shift + i) & 1 and not math.isfinite(v) for i, v in enumerate(values))


def _from_body(v: Vec3) -> Vec3:
    """Forward, right, down of a nose that points east, as ENU."""
    return (v[0], -v[1], -v[2])


def _problem(m: Any, place: tuple[float, float, float]) -> str:
    """Why a position setpoint cannot be used, or an empty string."""
    mask = m.type_mask
    # the bit says what an acceleration that is used means; MAVProxy sets it and uses none
    if mask & _FORCE and mask & _ACCELERATION_BITS != _ACCELERATION_BITS:
        return "Setpoint refused: forces are not followed"
    if mask & _POSITION_BITS == _POSITION_BITS and mask & _VELOCITY_BITS == _VELOCITY_BITS:
        return "Setpoint refused: neither position nor velocity is asked for"
    used = ((place, 0), ((m.vx, m.vy, m.vz), 3), ((m.afx, m.afy, m.afz), 6))
    if any(_asks_badly(values, mask, shift) for values, shift in used):
        return "Setpoint refused: a value that is to be used is no number"
    return ""


def read_local(m: Any) -> FollowSetpoint | Verdict:
    """SET_POSITION_TARGET_LOCAL_NED."""
    frame, mask = m.coordinate_frame, m.type_mask
    if frame not in _LOCAL_FRAMES:
        return _refused(f"Setpoint refused: frame {frame}; must be one of 1, 7, 8, 9, 12")
    place = (m.x, m.y, m.z)
    problem = _problem(m, place)
    if problem:
        return _refused(problem)
    turned = _from_body if frame in _BODY_FRAMES else enu_from_ned
    return FollowSetpoint(
        turned(_masked(place, mask, 0)),
        turned(_masked((m.vx, m.vy, m.vz), mask, 3)),
        turned(_masked((m.afx, m.afy, m.afz), mask, 6)),
        relative=frame != mavlink.MAV_FRAME_LOCAL_NED,
    )


def read_global(m: Any, home: Home) -> FollowSetpoint | Verdict:
    """SET_POSITION_TARGET_GLOBAL_INT."""
    frame, mask = m.coordinate_frame, m.type_mask
    if frame not in _ABOVE_HOME and frame not in _ABOVE_SEA:
        return _refused(f"Setpoint refused: frame {frame}; must be one of 0, 3, 5, 6")
    level_used = mask & 0x3 != 0x3
    if level_used and (abs(m.lat_int) > 900_000_000 or abs(m.lon_int) > 1_800_000_000):
        return _refused("Setpoint refused: no such place")
    problem = _problem(m, (0.0, 0.0, m.alt))
    if problem:
        return _refused(problem)
    east, north = 0.0, 0.0
    if level_used:
        east, north, _ = enu_from_geodetic(m.lat_int, m.lon_int, 0, home)
    height = m.alt - home.altitude_m if frame in _ABOVE_SEA else m.alt
    return FollowSetpoint(
        enu_from_ned(_masked((north, east, -height), mask, 0)),
        enu_from_ned(_masked((m.vx, m.vy, m.vz), mask, 3)),
        enu_from_ned(_masked((m.afx, m.afy, m.afz), mask, 6)),
        relative=False,
    )


def read_attitude(m: Any) -> FollowAttitude | Verdict:
    """SET_ATTITUDE_TARGET: the thrust axis of the quaternion, and the thrust as a share."""
    if m.type_mask & _NO_ATTITUDE:
        return _refused("Attitude setpoint refused: body rates alone are not followed")
    w, x, y, z = m.q
    size = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.5 < size < 2.0:
        return _refused("Attitude setpoint refused: the quaternion is none")
    w, x, y, z = w / size, x / size, y / size, z / size
    # minus the third column of the rotation: NED
    up_ned = (-2.0 * (x * z + w * y), -2.0 * (y * z - w * x), -(w * w - x * x - y * y + z * z))
    upward = enu_from_ned(up_ned)
    if not upward[2] >= math.cos(math.radians(STEEPEST_DEG)):
        return _refused(f"Attitude setpoint refused: leans by more than {STEEPEST_DEG:g} deg")
    thrust: float | None = m.thrust
    if m.type_mask & _NO_THRUST:
        thrust = None
    elif not 0.0 <= m.thrust <= 1.0:
        return _refused("Attitude setpoint refused: thrust must be 0 ... 1")
    return FollowAttitude(upward, thrust)


def read_stick(m: Any) -> FollowStick | Verdict:
    """MANUAL_CONTROL: x forward, y right, z 0 ... 1000 with 500 for neither up nor down."""
    level = [0.0 if v == _NO_STICK else v / 1000.0 for v in (m.x, m.y)]
    lift = 0.0 if m.z == _NO_STICK else (m.z - 500.0) / 500.0
    if max(map(abs, (*level, lift))) > 1.0:
        return _refused("MANUAL_CONTROL refused: x, y must be -1000 ... 1000 and z 0 ... 1000")
    return FollowStick(_from_body((level[0], level[1], -lift)))


def _refused(text: str) -> Verdict:
    return Verdict(mavlink.MAV_RESULT_DENIED, text)


class GuidedService:
    """Turns setpoints and sticks into requests; says why where it cannot."""

    def __init__(self, home: Home, system: int) -> None:
        self._home = home
        self._system = system
        self._said_us: dict[str, int] = {}

    def receive_local(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """SET_POSITION_TARGET_LOCAL_NED."""
        return self._ask(read_local(message), now_us, decide)

    def receive_global(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """SET_POSITION_TARGET_GLOBAL_INT."""
        return self._ask(read_global(message, self._home), now_us, decide)

    def receive_attitude(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """SET_ATTITUDE_TARGET."""
        return self._ask(read_attitude(message), now_us, decide)

    def receive_stick(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MANUAL_CONTROL, whose target is a system and has no component."""
        if message.target not in (0, self._system):
            return []
        return self._ask(read_stick(message), now_us, decide)

    def _ask(self, asked: Asking | Verdict, now_us: int, decide: Decide) -> list[Output]:
        verdict = asked if isinstance(asked, Verdict) else decide(asked)
        if verdict.result == mavlink.MAV_RESULT_ACCEPTED or verdict.text is None:
            return []
        if now_us - self._said_us.get(verdict.text, -COMPLAIN_US) < COMPLAIN_US:
            return []
        self._said_us = {text: at for text, at in self._said_us.items() if now_us - at < COMPLAIN_US}
        self._said_us[verdict.text] = now_us
        return [Say(mavlink.MAV_SEVERITY_WARNING, verdict.text)]
