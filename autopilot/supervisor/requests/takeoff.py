"""Take-off by request."""

from __future__ import annotations

from dataclasses import replace

from autopilot.services.requests import Takeoff
from autopilot.supervisor.machine import must_happen
from autopilot.supervisor.requests.limits import LEAST_ALTITUDE_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    Flight,
    Phase,
    Selected,
    View,
    beyond_fence,
    takeoff_event,
)


def take_off(flight: Flight, view: View, settings: Settings) -> Flight:
    """The armed flight, taking off."""
    at_speed = replace(flight, mission=replace(flight.mission, speed_m_s=settings.motion.speed_m_s))
    return must_happen(at_speed, takeoff_event(flight), view, settings)


def takeoff(flight: Flight, request: Takeoff, view: View, settings: Settings) -> Decision:
    """Take off to a height of the load; if the vehicle is disarmed, as soon as it is armed."""
    altitude = settings.motion.takeoff_altitude_m if request.altitude_m is None else request.altitude_m
    if not altitude >= LEAST_ALTITUDE_M:
        return flight, denied(f"Take-off denied: load height {altitude:.2f} m, min {LEAST_ALTITUDE_M} m")
    here = view.x_quad if flight.cable.released else view.x_load
    beyond = beyond_fence(flight, (here[0], here[1], altitude), settings)
    if beyond:
        return flight, denied(f"Take-off denied: {beyond}")
    flight_up = replace(
        flight,
        mission=replace(flight.mission, takeoff_altitude_m=altitude, active=False, waiting=False),
        selected=Selected.TAKEOFF,
    )
    if flight.phase == Phase.DISARMED:
        return flight_up, ACCEPTED
    if flight.phase == Phase.ARMED:
        return take_off(flight_up, view, settings), ACCEPTED
    begun = flight.phase in (Phase.TAUTEN, Phase.LIFT)
    return flight, denied(f"Take-off denied: {'it has begun already' if begun else 'in the air'}")
