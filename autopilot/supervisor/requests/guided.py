"""Setpoints by request, and the modes in which they are followed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import cos, hypot, isnan, pi, sin
from typing import Any

from autopilot.geometry.linear import E3, Vec3, add, scale
from autopilot.guidance.legs import winch_hold_height
from autopilot.guidance.setpoint_follower import (
    MAX_LEAN_DEG,
    AttitudeSetpoint,
    PositionSetpoint,
    SetpointStream,
)
from autopilot.services.records import Verdict
from autopilot.services.requests import FollowAttitude, FollowRates, FollowSetpoint, FollowStick, SetMode
from autopilot.supervisor.machine import requested_transition
from autopilot.supervisor.motion import commanded_motion
from autopilot.supervisor.requests.limits import MAX_DISTANCE_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, temporarily_denied, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ON_GROUND,
    ActionWhenArmed,
    Event,
    Flight,
    Phase,
    SetpointSource,
    View,
    interrupt_mission,
)

_ATTITUDE_REFUSED = denied("Attitude setpoint refused: the load is released, fly by position")
LIMIT_TOLERANCE = 1.05  # beyond a limit, for rounding and for a velocity that is stepped once
STREAM_US = 500_000  # a stream counts as present while its last setpoint is no older: two a second


def offboard(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """OFFBOARD: follow the stream of setpoints; on the ground, take off when a setpoint is above it."""
    if flight.phase == Phase.GUIDED and flight.setpoints.source == SetpointSource.OFFBOARD:
        return flight, ACCEPTED
    # one setpoint is enough: MAVSDK requests the mode right after its first
    if not flight.setpoints.offboard.is_fresh(view.now_us, STREAM_US):
        return flight, temporarily_denied("OFFBOARD denied: send setpoints first, more than two a second")
    if flight.phase in ON_GROUND:
        return replace(interrupt_mission(flight), action_when_armed=ActionWhenArmed.OFFBOARD), ACCEPTED
    return start_guided(flight, SetpointSource.OFFBOARD, "OFFBOARD", view, settings)


def position_control(flight: Flight, request: SetMode, view: View, settings: Settings) -> Decision:
    """POSCTL, which is POSHOLD to ArduPilot's clients: follow the stick."""
    name = request.name or "POSCTL"
    if not flight.setpoints.manual.is_fresh(view.now_us, settings.setpoints.manual_loss_us):
        return flight, temporarily_denied(
            f"{name} denied: no stick; send MANUAL_CONTROL or RC_CHANNELS_OVERRIDE"
        )
    if flight.phase in ON_GROUND:
        return flight, temporarily_denied(f"{name} denied: take off first")
    return start_guided(flight, SetpointSource.MANUAL, name, view, settings)


def start_guided(
    flight: Flight, source: SetpointSource, request_name: str, view: View, settings: Settings
) -> Decision:
    """Follow the setpoints of another source; `request_name` names the request in a refusal."""
    # in a hold the winch may wait for the load to come to rest
    legs = flight.legs if flight.phase == Phase.HOLD else flight.legs[:1]
    if any(winch_hold_height(leg) is not None for leg in legs):
        return flight, temporarily_denied(f"{request_name} denied while the winch works")
    guided = replace(interrupt_mission(flight), setpoints=replace(flight.setpoints, source=source))
    after = requested_transition(guided, Event.GUIDE, view, settings)
    return (after, ACCEPTED) if after else (flight, wrong_phase(flight, request_name))


def _yaw_origin(flight: Flight, request: FollowSetpoint, settings: Settings) -> float:
    """Angle (rad) to add to the heading of a setpoint: ArduPilot measures it from the vehicle's heading if
    the axes are those of the body, PX4 from north in any frame."""
    relative_to_heading = request.body and settings.setpoints.ardupilot_guided
    return flight.heading.angle - 0.5 * pi if relative_to_heading else 0.0


def _unchanged(v: Vec3) -> Vec3:
    return v


def _body_to_enu(heading: float) -> Callable[[Vec3], Vec3]:
    """The function that turns a vector from level body axes into ENU. If one of its level components is
    NaN and the other a number, NaN counts as zero."""
    c, s = cos(heading), sin(heading)

    def to_enu(v: Vec3) -> Vec3:
        x, y, z = v
        if isnan(x) and isnan(y):
            return v
        x, y = 0.0 if isnan(x) else x, 0.0 if isnan(y) else y
        return (c * x - s * y, s * x + c * y, z)

    return to_enu


def follow_setpoint(flight: Flight, request: FollowSetpoint, view: View, settings: Settings) -> Decision:
    """Take a position setpoint."""
    to_enu = _body_to_enu(flight.heading.angle) if request.body else _unchanged
    position = to_enu(request.position)
    if request.relative:
        position = add(position, commanded_motion(flight, view, settings)[0])
    elif settings.setpoints.target_is_vehicle and not flight.cable.released:
        position = (position[0], position[1], position[2] - settings.cable_length_m)
    if any(abs(value) > MAX_DISTANCE_M for value in position):
        return flight, denied(f"Setpoint refused: more than {MAX_DISTANCE_M:g} m from home")
    setpoint = PositionSetpoint(
        position,
        to_enu(request.velocity),
        to_enu(request.accel),
        view.now_us,
        request.heading_rad + _yaw_origin(flight, request, settings),
        request.yaw_rate_rad_s,
    )
    setpoint = setpoint.after(flight.setpoints.offboard.setpoint, settings.motion.accel_m_s2)
    flight = _accept_setpoint(flight, setpoint, view, settings)
    if flight.phase != Phase.GUIDED or flight.setpoints.source != SetpointSource.OFFBOARD:
        return flight, ACCEPTED
    text = _limit_text(setpoint, all(map(isnan, request.accel)), settings)
    return flight, Verdict(ACCEPTED.result, text, warns=text is not None)


def _limit_text(setpoint: PositionSetpoint, derives_accel: bool, settings: Settings) -> str | None:
    """Which limit a setpoint exceeds that is followed; `derives_accel`: its acceleration is that of the
    velocities before it."""
    max_speed_m_s, max_accel_m_s2 = settings.setpoints.max_speed_m_s, settings.motion.accel_m_s2
    if _size(setpoint.velocity) > LIMIT_TOLERANCE * max_speed_m_s:
        return f"Setpoint limited: over {max_speed_m_s:g} m/s (MPC_XY_VEL_MAX)"
    accel = setpoint.smoothed_accel if derives_accel else setpoint.accel
    if _size(accel) > LIMIT_TOLERANCE * max_accel_m_s2:
        return f"Setpoint limited: over {max_accel_m_s2:g} m/s^2 (MIS_ACCEL)"
    return None


def _size(v: Vec3) -> float:
    """The length of a vector of which a component that is NaN does not count."""
    return hypot(*(value for value in v if not isnan(value)))


def _accept_setpoint(
    flight: Flight, setpoint: PositionSetpoint | AttitudeSetpoint, view: View, settings: Settings
) -> Flight:
    """The flight after a setpoint: in ArduPilot's GUIDED a vehicle that holds or circles follows it."""
    flight = replace(
        flight, setpoints=replace(flight.setpoints, offboard=SetpointStream(setpoint, view.now_us))
    )
    if (
        not settings.setpoints.ardupilot_guided
        or not flight.accepts_setpoints
        or not (flight.phase == Phase.HOLD or flight.is_circling)
    ):
        return flight
    return start_guided(flight, SetpointSource.OFFBOARD, "Setpoint", view, settings)[0]


def follow_attitude(flight: Flight, request: FollowAttitude, view: View, settings: Settings) -> Decision:
    """Take an attitude setpoint."""
    if flight.cable.released:
        return flight, _ATTITUDE_REFUSED
    thrust = _thrust_n(request.thrust, settings)
    setpoint = AttitudeSetpoint(request.thrust_axis, thrust, request.heading_rad, request.yaw_rate_rad_s)
    if setpoint.is_too_steep:
        return flight, denied(f"Attitude setpoint refused: leans by more than {MAX_LEAN_DEG:g} deg")
    return _accept_setpoint(flight, setpoint, view, settings), ACCEPTED


def follow_rates(flight: Flight, request: FollowRates, view: View, settings: Settings) -> Decision:
    """Take a setpoint of body rates."""
    if flight.cable.released:
        return flight, _ATTITUDE_REFUSED
    setpoint = AttitudeSetpoint(E3, _thrust_n(request.thrust, settings), rates=request.rates)
    return _accept_setpoint(flight, setpoint, view, settings), ACCEPTED


def _thrust_n(share: float | None, settings: Settings) -> float | None:
    """Thrust in newtons of the share that a setpoint gives; None stays None."""
    return None if share is None else share / settings.setpoints.hover_share * settings.weight_n


def follow_stick(flight: Flight, request: FollowStick, view: View, settings: Settings) -> Decision:
    """Take the stick, as a velocity setpoint."""
    direction = _body_to_enu(flight.heading.angle)(request.velocity_share)
    velocity = scale(settings.setpoints.stick_speed_m_s, direction)
    turning = request.yaw_rate * settings.heading.max_rate
    setpoint = PositionSetpoint(velocity=velocity, since_us=view.now_us, yaw_rate=turning)
    return replace(
        flight, setpoints=replace(flight.setpoints, manual=SetpointStream(setpoint, view.now_us))
    ), ACCEPTED
