"""The supervisor from tick to tick: the watches in their order, and what follows when a leg ends.

Everything is a function of the flight, the view and the settings.
"""

from __future__ import annotations

from dataclasses import replace

from autopilot.guidance.legs import PathStop, Reel, winch_hold_height
from autopilot.supervisor.heading import advance_heading, take_reached_aims
from autopilot.supervisor.machine import transition
from autopilot.supervisor.mission import RELEASED_TEXT, after_last_leg
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import CRITICAL, IN_AIR, INFO, Flight, Report, Text, View, leg_time_s
from autopilot.supervisor.watches.battery import watch_battery
from autopilot.supervisor.watches.failsafe import watch_failsafe, watch_missing_readings
from autopilot.supervisor.watches.fence import watch_fence
from autopilot.supervisor.watches.idle import watch_idle
from autopilot.supervisor.watches.lag import watch_lag
from autopilot.supervisor.watches.own import watch_estimator, watch_law
from autopilot.supervisor.watches.recovery import watch_recovery
from autopilot.supervisor.watches.rotors import watch_rotors
from autopilot.supervisor.watches.setpoints import watch_setpoints, watch_takeoff_setpoint
from autopilot.supervisor.watches.slack import watch_slack
from autopilot.supervisor.watches.tautening import watch_tautening
from autopilot.supervisor.watches.touchdown import watch_touchdown
from autopilot.supervisor.watches.watch_result import Watch

WATCHES: tuple[Watch, ...] = (
    watch_recovery,
    watch_failsafe,
    watch_rotors,
    watch_missing_readings,
    watch_battery,
    watch_law,
    watch_estimator,
    watch_idle,
    watch_slack,
    watch_fence,
    watch_lag,
    watch_tautening,
    watch_touchdown,
    watch_takeoff_setpoint,
    watch_setpoints,
)

_MAX_LEG_ENDS = 20  # in one tick


def advance(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The flight at `view.now_us`, and what is reported of it; of a failure also that the battery is empty,
    from which it may follow."""
    flight, report = _advance(flight, view, settings)
    if not flight.is_battery_empty or not report.texts:
        return flight, report
    texts = (
        (severity, f"{text} (battery nearly empty)" if severity <= CRITICAL else text)
        for severity, text in report.texts
    )
    return flight, report._replace(texts=tuple(texts))


def _advance(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The first watch that finds something decides, else the legs continue."""
    flight, aimed = take_reached_aims(advance_heading(flight, view, settings))
    for watch in WATCHES:
        result = watch(flight, view, settings)
        flight = result.flight
        if result.event is not None:
            flight = transition(flight, result.event, view, settings)
            if result.is_failsafe:
                flight = replace(flight, is_failsafe=True)
        if result.found:
            return flight, Report(result.texts, aimed + result.reached)
    flight, report = _continue_legs(flight, view, settings)
    return flight, report._replace(reached=aimed + report.reached)


def _continue_legs(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The flight in the leg that is to be flown now, after all legs that have ended."""
    had_load = not flight.cable.released
    reached: tuple[int, ...] = ()
    texts: tuple[Text, ...] = ()
    # a step may take no time at all: continue until one does, or at the next tick
    for _ in range(_MAX_LEG_ENDS):
        if flight.phase not in IN_AIR or (
            flight.legs and leg_time_s(flight, view.now_us) < flight.legs[0].duration_s
        ):
            break
        flight, stopped = _with_reeled_length(flight)
        texts += stopped
        if len(flight.legs) > 1:
            ended = flight.leg_start_us + round(flight.legs[0].duration_s * 1e6)
            flight = replace(flight, legs=flight.legs[1:], leg_start_us=ended)
            continue
        flight, more = after_last_leg(flight, view, settings)
        reached += more.reached
        texts += more.texts
    if flight.cable.released and had_load:
        texts += ((INFO, RELEASED_TEXT),)
    return flight, Report(texts, reached)


def _with_reeled_length(flight: Flight) -> tuple[Flight, tuple[Text, ...]]:
    """The flight at the end of its present leg, with the cable length at which this leg ends, and what is
    told of a winch that stops before it has reached its length."""
    leg = flight.legs[0] if flight.legs else None
    top = None if leg is None else winch_hold_height(leg)
    if leg is None or top is None:
        return flight, ()
    length = top - leg.jet(leg.duration_s)[0][2]
    texts: tuple[Text, ...] = ()
    reels_on = any(isinstance(later, Reel) for later in flight.legs[1:2])
    if isinstance(leg, PathStop) and not reels_on:
        texts = ((INFO, f"Winch stopped at {length:.2f} m"),)
    cable = replace(flight.cable, length_m=length, reel_rate=0.0, reel_accel=0.0)
    return replace(flight, cable=cable), texts
