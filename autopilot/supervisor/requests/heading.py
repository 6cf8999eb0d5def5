"""Where the nose is to point, by request: to a heading, or to a place that is looked at."""

from __future__ import annotations

from math import inf, isfinite, pi

from autopilot.guidance.heading import Gaze, Towards, turn
from autopilot.services.requests import LookAt, TurnNose
from autopilot.supervisor.heading import heading_kept, pointed
from autopilot.supervisor.requests.limits import FARTHEST_M
from autopilot.supervisor.requests.verdicts import ACCEPTED, Decision, denied, wrong_phase
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import IN_AIR, Flight, View


def turn_nose(flight: Flight, request: TurnNose, view: View, settings: Settings) -> Decision:
    """Turn to a heading, and keep it."""
    if flight.phase not in IN_AIR:
        return flight, wrong_phase(flight, "Yaw")
    heading = flight.heading
    begin = heading.aim.angle if isinstance(heading.aim, Towards) else heading.angle
    way = request.angle_rad if request.relative else turn(request.angle_rad - begin)
    if not request.relative and request.sense * way < 0.0:
        way += 2.0 * pi * request.sense
    rate = inf if request.rate_rad_s is None else request.rate_rad_s
    return pointed(flight, Towards(begin + way, rate=rate), view), ACCEPTED


def look_at(flight: Flight, request: LookAt, view: View, settings: Settings) -> Decision:
    """Keep the nose turned to a place, or leave it as it points now."""
    if flight.phase not in IN_AIR:
        return flight, wrong_phase(flight, "ROI")
    if request.east_m is None or request.north_m is None:
        gazes = isinstance(flight.heading.aim, Gaze)
        return heading_kept(flight, view, settings) if gazes else flight, ACCEPTED
    place = (request.east_m, request.north_m, 0.0)
    if not all(isfinite(value) and abs(value) <= FARTHEST_M for value in place):
        return flight, denied(f"ROI denied: more than {FARTHEST_M:g} m away")
    return pointed(flight, Gaze(place), view), ACCEPTED
