"""Where the nose is to point, by request: to a heading, or to a place."""

from __future__ import annotations

from math import isfinite

from autopilot.supervisor.heading import looking, turned
from autopilot.supervisor.requests.limits import FARTHEST_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import IN_AIR, Flight, View
from missions.model import LookAt, TurnNose


def turn_nose(flight: Flight, request: TurnNose, view: View, settings: Settings) -> Decision:
    """Turn to a heading, and keep it."""
    if flight.phase not in IN_AIR:
        return flight, wrong_phase(flight, "Yaw")
    return turned(flight, request, view), ACCEPTED


def look_at(flight: Flight, request: LookAt, view: View, settings: Settings) -> Decision:
    """Keep the nose turned to a place, or let it stop where it points now."""
    if flight.phase not in IN_AIR:
        return flight, wrong_phase(flight, "ROI")
    place = (request.east_m, request.north_m)
    if any(at is not None and not (isfinite(at) and abs(at) <= FARTHEST_M) for at in place):
        return flight, denied(f"ROI denied: more than {FARTHEST_M:g} m from home")
    return looking(flight, request, view, settings), ACCEPTED
