"""The fence: load and vehicle, and the place at which the load could stop, must be within it."""

from __future__ import annotations

from dataclasses import replace

from autopilot.geometry.linear import axpy, sub
from autopilot.guidance.legs import CatchLoad, LevelHold, SwingDamping
from autopilot.supervisor.motion import commanded_motion, stopping_legs, tracks_attitude
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    ON_GROUND,
    WARNING,
    Event,
    Flight,
    Phase,
    View,
    fence_problem,
    first_fence_violation,
    has_fence,
    has_lasted,
    held_since,
    interrupt_mission,
    is_fence_active,
    is_landing,
    load_position_below,
)
from autopilot.supervisor.table import TRANSITIONS
from autopilot.supervisor.watches.failsafe import give_up_flight
from autopilot.supervisor.watches.watch_result import WatchResult

NO_ACTION, WARN, TERMINATE = 0, 1, 4  # GF_ACTION
FENCE_EVENTS = {2: (Event.HOLD, "holding"), 3: (Event.RETURN, "returning"), 5: (Event.LAND, "landing")}
STOP_MARGIN = 0.05  # share by which the stopping distance is extended: while the load speeds up, it grows
# time without a violation after which a breach is over: with `rtk` and `gps` the estimate of a vehicle that
# holds on the line stays inside for up to 3 s as a rule, and hardly ever for 5 s
CLEAR_US = 5_000_000


def watch_fence(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """React as GF_ACTION requires when the fence is breached, or the load can no longer stop before it.

    The breach lasts until nothing has violated the fence for CLEAR_US, or the vehicle has landed inside, or
    the fence is gone. Meanwhile positions that cross the line are noise, and only a commanded motion that
    leads out again calls for another reaction. A hold does not end a return or a landing.
    """
    area = flight.area
    is_fenced = is_fence_active(flight, settings) and has_fence(flight, settings)
    if not is_fenced or flight.phase not in CARRYING:
        here = view.x_quad if flight.cable.released else view.x_load
        is_over = not is_fenced or (flight.phase in ON_GROUND and not fence_problem(flight, here, settings))
        if is_over and area.breach:
            flight = replace(flight, area=replace(area, breach=""))
        return WatchResult(flight)
    if isinstance(flight.legs[0], CatchLoad | LevelHold):
        return WatchResult(flight)
    present, ahead = _violations(flight, view, settings)
    why = present or ahead
    turns_out_again = bool(ahead) and not area.leads_out and not isinstance(flight.legs[0], SwingDamping)
    if bool(why) and (not area.breach or (turns_out_again and settings.fence.action != WARN)):
        area = replace(area, breach=why, last_breach=why, breaches=area.breaches + 1, breach_us=view.now_us)
        flight = replace(flight, area=replace(area, leads_out=bool(ahead), inside_since_us=-1))
        return _reaction(flight, why, settings)
    inside_since_us = held_since(not why, area.inside_since_us, view.now_us)
    breach = "" if has_lasted(inside_since_us, CLEAR_US, view.now_us) else area.breach
    noted = replace(area, breach=breach, leads_out=bool(ahead), inside_since_us=inside_since_us)
    return WatchResult(flight if noted == area else replace(flight, area=noted))


def _reaction(flight: Flight, why: str, settings: Settings) -> WatchResult:
    """What GF_ACTION requires of a flight that breaches the fence."""
    if settings.fence.action == TERMINATE:
        return give_up_flight(flight, f"fence: {why}")
    event, action = FENCE_EVENTS.get(settings.fence.action, (None, ""))
    comes_back = event == Event.HOLD and (flight.phase == Phase.RETURN or is_landing(flight))
    if event is None or comes_back or (flight.phase, event) not in TRANSITIONS:
        return WatchResult(flight, None, ((WARNING, f"Fence: {why}"),))
    return WatchResult(interrupt_mission(flight), event, ((WARNING, f"Fence: {why}, {action}"),))


def _violations(flight: Flight, view: View, settings: Settings) -> tuple[str, str]:
    """Why load or vehicle may not be where they are, and why the commanded motion leads where they may not
    be; empty strings if they may. Where no position is commanded, only their own positions count."""
    released = flight.cable.released
    load_below = load_position_below(view.x_quad, settings)
    places = [load_below] if released else [view.x_load, load_below]
    violation = first_fence_violation(flight.area.fence, places, settings)
    if tracks_attitude(flight.legs[0]):
        return violation, violation
    here, end = commanded_motion(flight, view, settings)[0], stopping_legs(flight, view, settings)[1]
    places = [here, axpy(STOP_MARGIN, sub(end, here), end)]
    if released:
        places = [load_position_below(place, settings) for place in places]
    ahead = first_fence_violation(flight.area.fence, places, settings)
    return violation, ahead and f"would stop {ahead}"
