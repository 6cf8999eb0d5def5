"""Setpoints by request, and the modes in which they are followed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import cos, isnan, pi, sin
from typing import Any

from autopilot.geometry.linear import E3, Vec3, add, scale
from autopilot.guidance.legs import top_of
from autopilot.guidance.setpoint_follower import STEEPEST_DEG, AttitudeSetpoint, PositionSetpoint, Stream
from autopilot.services.requests import FollowAttitude, FollowRates, FollowSetpoint, FollowStick
from autopilot.supervisor.machine import happen
from autopilot.supervisor.motion import asked_motion
from autopilot.supervisor.requests.limits import FARTHEST_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, later, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ON_GROUND,
    Event,
    Flight,
    Guide,
    Phase,
    Selected,
    View,
    off_mission,
)

_BY_POSITION = denied("Attitude setpoint refused: the load is released, fly by position")
STREAM_US = 500_000  # a stream counts as present while its last setpoint is no older: two a second


def offboard(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """OFFBOARD: follow the stream of setpoints; on the ground, take off when a setpoint is above it."""
    if flight.phase == Phase.GUIDED and flight.setpoints.guide == Guide.OFFBOARD:
        return flight, ACCEPTED
    # one setpoint is enough: MAVSDK requests the mode right after its first
    if not flight.setpoints.offboard.alive(view.now_us, STREAM_US):
        return flight, later("OFFBOARD denied: send setpoints first, more than two a second")
    if flight.phase in ON_GROUND:
        return replace(off_mission(flight), selected=Selected.OFFBOARD), ACCEPTED
    return begin_guided(flight, Guide.OFFBOARD, "OFFBOARD", view, settings)


def position_control(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """POSCTL: follow the stick."""
    if not flight.setpoints.manual.alive(view.now_us, settings.setpoints.manual_loss_us):
        return flight, later("POSCTL denied: no MANUAL_CONTROL received")
    if flight.phase in ON_GROUND:
        return flight, later("POSCTL denied: take off first")
    return begin_guided(flight, Guide.MANUAL, "POSCTL", view, settings)


def begin_guided(flight: Flight, guide: Guide, what: str, view: View, settings: Settings) -> Decision:
    """Follow the setpoints of another source; `what` names the request in a refusal."""
    if flight.legs and top_of(flight.legs[0]) is not None:
        return flight, later(f"{what} denied while the winch works")
    guided = replace(off_mission(flight), setpoints=replace(flight.setpoints, guide=guide))
    after = happen(guided, Event.GUIDE, view, settings)
    return (after, ACCEPTED) if after else (flight, wrong_phase(flight, what))


def _yaw_origin(flight: Flight, request: FollowSetpoint, settings: Settings) -> float:
    """Angle (rad) to add to the heading of a setpoint: ArduPilot measures it from the nose if the axes are
    those of the nose, PX4 from north in any frame."""
    from_nose = request.body and settings.setpoints.guided_mode
    return flight.heading.angle - 0.5 * pi if from_nose else 0.0


def _as_it_is(v: Vec3) -> Vec3:
    return v


def _body_turned(heading: float) -> Callable[[Vec3], Vec3]:
    """The function that turns a vector from the axes of the nose into ENU. If one of its level components is
    NaN and the other a number, NaN counts as zero."""
    c, s = cos(heading), sin(heading)

    def turned(v: Vec3) -> Vec3:
        x, y, z = v
        if isnan(x) and isnan(y):
            return v
        x, y = 0.0 if isnan(x) else x, 0.0 if isnan(y) else y
        return (c * x - s * y, s * x + c * y, z)

    return turned


def follow_setpoint(flight: Flight, request: FollowSetpoint, view: View, settings: Settings) -> Decision:
    """Take a position setpoint."""
    turned = _body_turned(flight.heading.angle) if request.body else _as_it_is
    position = turned(request.position)
    if request.relative:
        position = add(position, asked_motion(flight, view, settings)[0])
    elif settings.setpoints.guides_vehicle and not flight.cable.released:
        position = (position[0], position[1], position[2] - settings.cable_length_m)
    if any(abs(value) > FARTHEST_M for value in position):
        return flight, denied(f"Setpoint refused: more than {FARTHEST_M:g} m from home")
    asked = PositionSetpoint(
        position,
        turned(request.velocity),
        turned(request.accel),
        view.now_us,
        request.heading_rad + _yaw_origin(flight, request, settings),
        request.turning_rad_s,
    )
    return _heed(flight, asked, view, settings), ACCEPTED


def _heed(
    flight: Flight, asked: PositionSetpoint | AttitudeSetpoint, view: View, settings: Settings
) -> Flight:
    """The flight after a setpoint: in ArduPilot's GUIDED a vehicle that holds or circles follows it."""
    flight = replace(flight, setpoints=replace(flight.setpoints, offboard=Stream(asked, view.now_us)))
    circles = flight.phase == Phase.GUIDED and flight.setpoints.guide == Guide.ORBIT
    if not settings.setpoints.guided_mode or not flight.heeds or not (flight.phase == Phase.HOLD or circles):
        return flight
    return begin_guided(flight, Guide.OFFBOARD, "Setpoint", view, settings)[0]


def follow_attitude(flight: Flight, request: FollowAttitude, view: View, settings: Settings) -> Decision:
    """Take an attitude setpoint."""
    if flight.cable.released:
        return flight, _BY_POSITION
    thrust = _thrust_n(request.thrust, settings)
    asked = AttitudeSetpoint(request.upward, thrust, request.heading_rad, request.turning_rad_s)
    if asked.is_too_steep:
        return flight, denied(f"Attitude setpoint refused: leans by more than {STEEPEST_DEG:g} deg")
    return _heed(flight, asked, view, settings), ACCEPTED


def follow_rates(flight: Flight, request: FollowRates, view: View, settings: Settings) -> Decision:
    """Take a setpoint of body rates."""
    if flight.cable.released:
        return flight, _BY_POSITION
    asked = AttitudeSetpoint(E3, _thrust_n(request.thrust, settings), rates=request.rates)
    return _heed(flight, asked, view, settings), ACCEPTED


def _thrust_n(share: float | None, settings: Settings) -> float | None:
    """Thrust in newtons of the share that a setpoint gives; None stays None."""
    return None if share is None else share / settings.setpoints.hover_share * settings.weight_n


def follow_stick(flight: Flight, request: FollowStick, view: View, settings: Settings) -> Decision:
    """Take the stick, as a velocity setpoint."""
    along = _body_turned(flight.heading.angle)(request.share)
    velocity = scale(settings.setpoints.stick_speed_m_s, along)
    turning = request.turning * settings.heading.fastest
    asked = PositionSetpoint(velocity=velocity, since_us=view.now_us, turning=turning)
    return replace(flight, setpoints=replace(flight.setpoints, manual=Stream(asked, view.now_us))), ACCEPTED
