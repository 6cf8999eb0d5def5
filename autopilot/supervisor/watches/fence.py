"""The fence: load and vehicle, and the place at which the load could stop, must be within it."""

from __future__ import annotations

from dataclasses import replace

from autopilot.geometry.linear import axpy, sub
from autopilot.guidance.legs import CatchLoad, LevelHold
from autopilot.supervisor.motion import commanded_motion, stopping_legs, tracks_attitude
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    WARNING,
    Event,
    Flight,
    Phase,
    View,
    first_fence_violation,
    has_fence,
    interrupt_mission,
    is_fence_active,
    is_landing,
    load_position_below,
)
from autopilot.supervisor.table import TRANSITIONS
from autopilot.supervisor.watches.failsafe import give_up_flight
from autopilot.supervisor.watches.watch_result import WatchResult

NO_ACTION, TERMINATE = 0, 4  # GF_ACTION
FENCE_EVENTS = {2: (Event.HOLD, "holding"), 3: (Event.RETURN, "returning"), 5: (Event.LAND, "landing")}
STOP_MARGIN = 0.05  # share by which the stopping distance is extended: while the load speeds up, it grows


def watch_fence(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """React as GF_ACTION requires when the fence is breached, or the load can no longer stop before it.

    A hold does not end a return or a landing.
    """
    limits, area = settings.fence, flight.area
    if (
        flight.phase not in CARRYING
        or not is_fence_active(flight, settings)
        or not has_fence(flight, settings)
    ):
        return WatchResult(flight)
    if isinstance(flight.legs[0], CatchLoad | LevelHold):
        return WatchResult(flight)
    why = _breach(flight, view, settings)
    if bool(why) == bool(area.breach):
        return WatchResult(flight)
    if not why:
        return WatchResult(replace(flight, area=replace(area, breach="")))
    breached = replace(area, breach=why, last_breach=why, breaches=area.breaches + 1, breach_us=view.now_us)
    flight = replace(flight, area=breached)
    if limits.action == TERMINATE:
        return give_up_flight(flight, f"fence: {why}")
    event, action = FENCE_EVENTS.get(limits.action, (None, ""))
    comes_back = event == Event.HOLD and (flight.phase == Phase.RETURN or is_landing(flight))
    if event is None or comes_back or (flight.phase, event) not in TRANSITIONS:
        return WatchResult(flight, None, ((WARNING, f"Fence: {why}"),))
    return WatchResult(interrupt_mission(flight), event, ((WARNING, f"Fence: {why}, {action}"),))


def _breach(flight: Flight, view: View, settings: Settings) -> str:
    """Why the fence is breached, or is about to be; an empty string if it is not."""
    released = flight.cable.released
    load_below = load_position_below(view.x_quad, settings)
    places = [load_below] if released else [view.x_load, load_below]
    breach = first_fence_violation(flight.area.fence, places, settings)
    if breach or tracks_attitude(flight.legs[0]):
        return breach
    here, end = commanded_motion(flight, view, settings)[0], stopping_legs(flight, view, settings)[1]
    places = [here, axpy(STOP_MARGIN, sub(end, here), end)]
    if released:
        places = [load_position_below(place, settings) for place in places]
    ahead = first_fence_violation(flight.area.fence, places, settings)
    return ahead and f"would stop {ahead}"
