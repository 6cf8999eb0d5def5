"""Take-off by request."""

from __future__ import annotations

from dataclasses import replace

from autopilot.services.requests import Takeoff
from autopilot.supervisor.machine import transition
from autopilot.supervisor.requests.limits import MAX_DISTANCE_M, MIN_ALTITUDE_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ActionWhenArmed,
    Flight,
    Phase,
    View,
    fence_problem,
    takeoff_event,
)


def start_takeoff(flight: Flight, view: View, settings: Settings) -> Flight:
    """The armed flight, taking off."""
    at_speed = replace(flight, mission=flight.mission.at_speed(settings.motion.speed_m_s))
    return transition(at_speed, takeoff_event(flight), view, settings)


def takeoff_problem(flight: Flight, altitude_m: float, view: View, settings: Settings) -> str:
    """Why the fence forbids to take off to this height here; an empty string if it does not."""
    here = view.x_quad if flight.cable.released else view.x_load
    return fence_problem(flight, (here[0], here[1], altitude_m), settings)


def takeoff(flight: Flight, request: Takeoff, view: View, settings: Settings) -> Decision:
    """Take off to a height of the load; if the vehicle is disarmed, as soon as it is armed."""
    altitude = settings.motion.takeoff_altitude_m if request.altitude_m is None else request.altitude_m
    if not altitude >= MIN_ALTITUDE_M:
        return flight, denied(f"Take-off denied: load height {altitude:.2f} m, min {MIN_ALTITUDE_M} m")
    if altitude > MAX_DISTANCE_M:
        return flight, denied(f"Take-off denied: load height {altitude:g} m, max {MAX_DISTANCE_M:g} m")
    problem = takeoff_problem(flight, altitude, view, settings)
    if problem:
        return flight, denied(f"Take-off denied: {problem}")
    requested = replace(
        flight,
        mission=replace(flight.mission, takeoff_altitude_m=altitude, active=False, waiting=False),
        action_when_armed=ActionWhenArmed.TAKEOFF,
    )
    if flight.phase == Phase.DISARMED:
        return requested, ACCEPTED
    if flight.phase == Phase.ARMED:
        return start_takeoff(requested, view, settings), ACCEPTED
    started = flight.phase in (Phase.TAUTEN, Phase.LIFT)
    return flight, denied(f"Take-off denied: {'it has begun already' if started else 'in the air'}")
