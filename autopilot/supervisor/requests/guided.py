"""Setpoints by request, and the modes in which they are followed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from autopilot.geometry.linear import add, scale
from autopilot.guidance.legs import top_of
from autopilot.guidance.setpoint_follower import AttitudeSetpoint, PositionSetpoint, Stream
from autopilot.services.requests import FollowAttitude, FollowSetpoint, FollowStick
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

STREAM_US = 500_000  # a stream is there where its last setpoint is no older: two a second


def offboard(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """OFFBOARD: follow the stream of setpoints; on the ground, take off when one asks for it."""
    if flight.phase == Phase.GUIDED and flight.setpoints.guide == Guide.OFFBOARD:
        return flight, ACCEPTED
    # one is enough: MAVSDK asks for the mode right behind its first
    if not flight.setpoints.offboard.alive(view.now_us, STREAM_US):
        return flight, later("OFFBOARD denied: send setpoints first, more than two a second")
    if flight.phase in ON_GROUND:
        return replace(off_mission(flight), selected=Selected.OFFBOARD), ACCEPTED
    return begin_guided(flight, Guide.OFFBOARD, "OFFBOARD", view, settings)


def position_control(flight: Flight, request: Any, view: View, settings: Settings) -> Decision:
    """POSCTL: follow the stick."""
    if not flight.setpoints.manual.alive(view.now_us, settings.setpoints.manual_loss_us):
        return flight, later("POSCTL denied: no MANUAL_CONTROL is heard")
    if flight.phase in ON_GROUND:
        return flight, later("POSCTL denied: take off first")
    return begin_guided(flight, Guide.MANUAL, "POSCTL", view, settings)


def begin_guided(flight: Flight, guide: Guide, what: str, view: View, settings: Settings) -> Decision:
    """Follow the setpoints of another source; `what` names the request where that is refused."""
    if flight.legs and top_of(flight.legs[0]) is not None:
        return flight, later(f"{what} denied while the winch works")
    guided = replace(off_mission(flight), setpoints=replace(flight.setpoints, guide=guide))
    after = happen(guided, Event.GUIDE, view, settings)
    return (after, ACCEPTED) if after else (flight, wrong_phase(flight, what))


def follow_setpoint(flight: Flight, request: FollowSetpoint, view: View, settings: Settings) -> Decision:
    """Take a position setpoint."""
    position = request.position
    if request.relative:
        position = add(position, asked_motion(flight, view, settings)[0])
    elif settings.setpoints.guides_vehicle and not flight.cable.released:
        position = (position[0], position[1], position[2] - settings.cable_length_m)
    if any(abs(value) > FARTHEST_M for value in position):
        return flight, denied(f"Setpoint refused: more than {FARTHEST_M:g} m away")
    asked = PositionSetpoint(position, request.velocity, request.accel, view.now_us)
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
        return flight, denied("Attitude setpoint refused: the load is released, fly by position")
    thrust = None
    if request.thrust is not None:
        thrust = request.thrust / settings.setpoints.hover_share * settings.weight_n
    asked = AttitudeSetpoint(request.upward, thrust)
    return _heed(flight, asked, view, settings), ACCEPTED


def follow_stick(flight: Flight, request: FollowStick, view: View, settings: Settings) -> Decision:
    """Take the stick, as a velocity setpoint."""
    velocity = scale(settings.setpoints.stick_speed_m_s, request.share)
    asked = PositionSetpoint(velocity=velocity, since_us=view.now_us)
    return replace(flight, setpoints=replace(flight.setpoints, manual=Stream(asked, view.now_us))), ACCEPTED
