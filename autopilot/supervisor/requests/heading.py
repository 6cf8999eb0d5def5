"""The heading by request: to an angle, or to a place."""

from __future__ import annotations

from math import isfinite

from autopilot.supervisor.heading import with_heading_aim, with_look_at_aim
from autopilot.supervisor.requests.limits import MAX_DISTANCE_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import IN_AIR, Flight, View
from missions.model import LookAt, TurnHeading


def turn_heading(flight: Flight, request: TurnHeading, view: View, settings: Settings) -> Decision:
    """Turn to a heading, and keep it."""
    if flight.phase not in IN_AIR:
        return flight, wrong_phase(flight, "Yaw")
    return with_heading_aim(flight, request, view), ACCEPTED


def look_at(flight: Flight, request: LookAt, view: View, settings: Settings) -> Decision:
    """Keep the heading turned to a place, or let it stop where it points now."""
    if flight.phase not in IN_AIR:
        return flight, wrong_phase(flight, "ROI")
    place = (request.east_m, request.north_m)
    if any(at is not None and not (isfinite(at) and abs(at) <= MAX_DISTANCE_M) for at in place):
        return flight, denied(f"ROI denied: more than {MAX_DISTANCE_M:g} m from home")
    return with_look_at_aim(flight, request, view, settings), ACCEPTED
