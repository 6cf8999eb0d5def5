"""Gripper and winch by request."""

from __future__ import annotations

import math
from dataclasses import replace

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import Hold, reel_leg
from autopilot.guidance.setpoint_follower import NO_STREAM, AttitudeSetpoint
from autopilot.services.records import Verdict
from autopilot.services.requests import Grab, Release, Winch
from autopilot.supervisor.machine import transition
from autopilot.supervisor.mission import RELEASED_TEXT
from autopilot.supervisor.motion import cable_length_at, stopping_legs
from autopilot.supervisor.requests.limits import MIN_ALTITUDE_M
from autopilot.supervisor.requests.mission_checks import reel_problem
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, temporarily_denied
from autopilot.supervisor.setpoint_source import active_setpoint
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ON_GROUND,
    Event,
    Flight,
    Phase,
    View,
    interrupt_mission,
    without_load,
)
from autopilot.trajectory.timeline import MIN_REEL_M
from autopilot.wire.dialect import plumbline as mavlink

MIN_REEL_SPEED_M_S = 0.01
# Of the cable's length, at which a load can be taken: over one that lies farther away the vehicle cannot move
# before the cable is taut and drags it.
GRAB_SHARE = 0.75


def release_load(flight: Flight, request: Release, view: View, settings: Settings) -> Decision:
    """Open the gripper."""
    if flight.cable.released:
        return flight, Verdict(mavlink.MAV_RESULT_ACCEPTED, "Gripper: the load is released already")
    text = RELEASED_TEXT
    if flight.mission.active and flight.phase not in ON_GROUND:
        text += ", mission held" if flight.phase != Phase.SET_DOWN else ""
    return with_load_released(flight, view, settings), Verdict(mavlink.MAV_RESULT_ACCEPTED, text)


def grab(flight: Flight, request: Grab, view: View, settings: Settings) -> Decision:
    """Take a load that lies within reach."""
    if not flight.cable.released:
        return flight, ACCEPTED
    if flight.phase not in ON_GROUND:
        return flight, denied("Gripper: a load can be taken on the ground only; land beside it")
    distance, reach = norm(sub(view.x_load, view.x_quad)), GRAB_SHARE * settings.cable_length_m
    if not distance <= reach:
        return flight, denied(f"Gripper: the load lies {distance:.2f} m away; must be within {reach:.2f} m")
    attached = replace(flight, cable=replace(flight.cable, released=False))
    return attached, Verdict(mavlink.MAV_RESULT_ACCEPTED, "Load taken")


def with_load_released(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight after a commanded release: the vehicle continues alone; instead of a mission it holds."""
    alone = replace(without_load(flight), condition_since_us=-1)
    if flight.phase in ON_GROUND or flight.phase in (Phase.SET_DOWN, Phase.FAILSAFE):
        return alone
    alone = interrupt_mission(alone)
    if flight.phase == Phase.TAUTEN:
        return transition(alone, Event.RELEASED, view, settings)
    alone = replace(alone, legs=())
    if flight.phase == Phase.GUIDED and isinstance(active_setpoint(flight), AttitudeSetpoint):
        without_setpoints = replace(alone, setpoints=replace(alone.setpoints, offboard=NO_STREAM))
        return transition(without_setpoints, Event.HOLD, view, settings)
    held = flight.mission.active or flight.phase == Phase.MISSION
    return transition(alone, Event.HOLD if held else Event.RELEASED, view, settings)


def winch(flight: Flight, request: Winch, view: View, settings: Settings) -> Decision:
    """Let the cable out or take it in, by a length or as far as possible."""
    if flight.cable.released:
        return flight, denied("Winch denied: the load is released, nothing hangs on the cable")
    if settings.winch.problem:
        return flight, denied(f"Winch denied: {settings.winch.problem}")
    if flight.phase == Phase.MISSION or flight.mission.waiting:
        return flight, temporarily_denied("Winch denied: pause the mission first")
    if flight.phase != Phase.HOLD or not isinstance(flight.legs[-1], Hold):
        return flight, temporarily_denied("Winch denied: hold the load in the air first")
    speed = settings.winch.speed_m_s if request.speed_m_s is None else request.speed_m_s
    if not MIN_REEL_SPEED_M_S <= speed <= settings.winch.speed_m_s:
        limits = f"{MIN_REEL_SPEED_M_S:g} ... {settings.winch.speed_m_s:g} m/s (WNC_SPEED)"
        return flight, denied(f"Winch denied: rate {speed:.2f} m/s; must be {limits}")
    legs, here = stopping_legs(flight, view, settings)
    length = cable_length_at(flight, here, settings)
    target_m = length + request.length_m
    if math.isinf(request.length_m):
        target_m = settings.winch.max_length_m if request.length_m > 0.0 else settings.winch.min_length_m
        # out to the end, or as far as the load may sink
        target_m = max(min(target_m, length + here[2] - MIN_ALTITUDE_M), min(target_m, length))
    problem = reel_problem(target_m, here[2] + length - target_m, settings)
    if problem:
        return flight, denied(f"Winch denied: {problem}")
    if abs(target_m - length) < MIN_REEL_M:
        return replace(flight, legs=(*legs, Hold(here)), leg_start_us=view.now_us), ACCEPTED
    reel = reel_leg(here, length, target_m, speed, settings.winch.accel_m_s2)
    there = reel.end
    text = f"Winch: {length:.2f} m to {target_m:.2f} m"
    if legs:
        text += ", when the load is at rest"
    after = replace(flight, legs=(*legs, reel, Hold(there)), leg_start_us=view.now_us)
    return after, Verdict(mavlink.MAV_RESULT_ACCEPTED, text)
