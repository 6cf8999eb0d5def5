"""The fence: load and vehicle, and the place at which the load could stop, must be within it."""

from __future__ import annotations

from dataclasses import replace

from autopilot.geometry.linear import axpy, sub
from autopilot.guidance.legs import Catch, Steady
from autopilot.supervisor.motion import asked_motion, stop, swings
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    WARNING,
    Event,
    Flight,
    View,
    below,
    fenced,
    forbidden,
    off_mission,
)
from autopilot.supervisor.table import TRANSITIONS
from autopilot.supervisor.watches.failsafe import given_up
from autopilot.supervisor.watches.watched import Watched

NO_ACTION, TERMINATE = 0, 4  # GF_ACTION
FENCE_EVENTS = {2: Event.HOLD, 3: Event.RETURN, 5: Event.LAND}
STOP_MARGIN = 0.05  # share by which the stopping distance is extended: while the load speeds up, it grows


def limited(flight: Flight, settings: Settings) -> bool:
    """Whether there is a fence, in force or not: zones that were uploaded, or limits by parameters."""
    limits = settings.fence
    return bool(flight.area.fence.zones) or limits.radius_m > 0.0 or limits.height_m > 0.0


def watch_fence(flight: Flight, view: View, settings: Settings) -> Watched:
    """React as GF_ACTION requires when the fence is breached, or the load can no longer stop before it."""
    limits, area = settings.fence, flight.area
    if flight.phase not in CARRYING or not fenced(flight, settings) or not limited(flight, settings):
        return Watched(flight)
    if isinstance(flight.legs[0], Catch | Steady):
        return Watched(flight)
    why = _breach(flight, view, settings)
    if bool(why) == bool(area.breach):
        return Watched(flight)
    if not why:
        return Watched(replace(flight, area=replace(area, breach="")))
    noted = replace(area, breach=why, breaches=area.breaches + 1, breach_us=view.now_us)
    flight = replace(flight, area=noted)
    if limits.action == TERMINATE:
        return given_up(flight, f"fence: {why}")
    event, texts = FENCE_EVENTS.get(limits.action), ((WARNING, f"Fence: {why}"),)
    if event is None or (flight.phase, event) not in TRANSITIONS:
        return Watched(flight, None, texts)
    return Watched(off_mission(flight), event, texts)


def _breach(flight: Flight, view: View, settings: Settings) -> str:
    """Why the fence is breached, or is about to be; an empty string if it is not."""
    over = below(view.x_quad, settings)
    places = [over] if flight.cable.released else [view.x_load, over]
    if not swings(flight.legs[0]):
        here, end = asked_motion(flight, view, settings)[0], stop(flight, view, settings)[1]
        ahead = [here, axpy(STOP_MARGIN, sub(end, here), end)]
        places += [below(place, settings) for place in ahead] if flight.cable.released else ahead
    return next(filter(None, (forbidden(flight.area.fence, place, settings) for place in places)), "")
