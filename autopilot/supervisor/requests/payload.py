"""Gripper and winch by request."""

from __future__ import annotations

import math
from dataclasses import replace

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import Hold, reel_leg
from autopilot.guidance.setpoint_follower import SILENT, AttitudeSetpoint
from autopilot.services.records import Verdict
from autopilot.services.requests import Grab, Release, Winch
from autopilot.supervisor.guide import asked_of
from autopilot.supervisor.machine import must_happen
from autopilot.supervisor.mission import RELEASED_TEXT
from autopilot.supervisor.motion import length_at, stop
from autopilot.supervisor.requests.limits import LEAST_ALTITUDE_M
from autopilot.supervisor.requests.mission_checks import reel_trouble
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, later
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ON_GROUND,
    Event,
    Flight,
    Phase,
    View,
    off_mission,
)
from autopilot.trajectory.timeline import LEAST_REEL_M
from autopilot.wire.dialect import plumbline as mavlink

LEAST_REEL_M_S = 0.01


def let_go(flight: Flight, request: Release, view: View, settings: Settings) -> Decision:
    """Open the gripper."""
    if flight.cable.released:
        return flight, Verdict(mavlink.MAV_RESULT_ACCEPTED, "Gripper: the load is released already")
    text = RELEASED_TEXT
    if flight.mission.active and flight.phase not in ON_GROUND:
        text += ", mission held" if flight.phase != Phase.SET_DOWN else ""
    return release(flight, view, settings), Verdict(mavlink.MAV_RESULT_ACCEPTED, text)


def grab(flight: Flight, request: Grab, view: View, settings: Settings) -> Decision:
    """Take a load that lies within reach."""
    if not flight.cable.released:
        return flight, ACCEPTED
    if flight.phase not in ON_GROUND:
        return flight, denied("Gripper: a load can be taken on the ground only; land beside it")
    away = norm(sub(view.x_load, view.x_quad))
    if not away <= settings.cable_length_m:
        text = f"Gripper: the load lies {away:.1f} m away, the cable reaches {settings.cable_length_m:g} m"
        return flight, denied(text)
    taken = replace(flight, cable=replace(flight.cable, released=False))
    return taken, Verdict(mavlink.MAV_RESULT_ACCEPTED, "Load taken")


def release(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight after a commanded release: the vehicle continues alone; instead of a mission it holds."""
    alone = replace(flight, cable=replace(flight.cable, released=True, slack_since_us=-1), still_since_us=-1)
    if flight.phase in ON_GROUND or flight.phase in (Phase.SET_DOWN, Phase.FAILSAFE):
        return alone
    alone = off_mission(alone)
    if flight.phase == Phase.TAUTEN:
        return must_happen(alone, Event.RELEASED, view, settings)
    alone = replace(alone, legs=())
    if flight.phase == Phase.GUIDED and isinstance(asked_of(flight), AttitudeSetpoint):
        silent = replace(alone, setpoints=replace(alone.setpoints, offboard=SILENT))
        return must_happen(silent, Event.HOLD, view, settings)
    held = flight.mission.active or flight.phase == Phase.MISSION
    return must_happen(alone, Event.HOLD if held else Event.RELEASED, view, settings)


def winch(flight: Flight, request: Winch, view: View, settings: Settings) -> Decision:
    """Let the cable out or take it in, by a length or as far as possible."""
    if flight.cable.released:
        return flight, denied("Winch denied: the load is released, nothing hangs on the cable")
    if not settings.winch.usable:
        return flight, denied("Winch denied: the law lqr flies one length of the cable")
    if flight.phase != Phase.HOLD or not isinstance(flight.legs[-1], Hold):
        return flight, later("Winch denied: hold the load in the air first")
    speed = settings.winch.speed_m_s if request.speed_m_s is None else request.speed_m_s
    if not LEAST_REEL_M_S <= speed <= settings.winch.speed_m_s:
        limits = f"{LEAST_REEL_M_S:g} ... {settings.winch.speed_m_s:g} m/s (WNC_SPEED)"
        return flight, denied(f"Winch denied: {speed:.2f} m/s; must be {limits}")
    legs, here = stop(flight, view, settings)
    length = length_at(flight, here, settings)
    wanted = length + request.length_m
    if math.isinf(request.length_m):
        wanted = settings.winch.longest_m if request.length_m > 0.0 else settings.winch.shortest_m
        # out to the end, or as far as the load may sink
        wanted = max(min(wanted, length + here[2] - LEAST_ALTITUDE_M), min(wanted, length))
    beyond = reel_trouble(wanted, here[2] + length - wanted, settings)
    if beyond:
        return flight, denied(f"Winch denied: {beyond}")
    if abs(wanted - length) < LEAST_REEL_M:
        return replace(flight, legs=(*legs, Hold(here)), leg_start_us=view.now_us), ACCEPTED
    reel = reel_leg(here, length, wanted, speed, settings.winch.accel_m_s2)
    there = reel.end
    text = f"Winch: {length:.2f} m to {wanted:.2f} m"
    after = replace(flight, legs=(*legs, reel, Hold(there)), leg_start_us=view.now_us)
    return after, Verdict(mavlink.MAV_RESULT_ACCEPTED, text)
