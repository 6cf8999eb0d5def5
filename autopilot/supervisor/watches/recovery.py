"""The flight that was found under way: once the sensors have told where all is, the load is held, or the
vehicle landed beside one that lies."""

from __future__ import annotations

from dataclasses import replace

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import Steady
from autopilot.supervisor.phase_legs import TOUCH_HEIGHT
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import WARNING, Event, Flight, View, leg_time_s
from autopilot.supervisor.watches.failsafe import given_up
from autopilot.supervisor.watches.watched import Watched

TRACKED_S = 0.2  # until velocities are known by a tracker
RECEIVED_S = 2.0  # until attitude and heading are known by a receiver
MOST_S = 4.0  # in which the sensors must have told all that
SLACK_SHARE = 0.965  # of the cable's length: a load that is nearer does not hang on it
HOLDING_TEXT = "Restarted in flight: holding"
LANDING_TEXT = "Restarted in flight: landing"


def watch_recovery(flight: Flight, view: View, settings: Settings) -> Watched:
    """Hold the load, or land, when the sensors have told enough; give up when they do not."""
    if not flight.legs or not isinstance(flight.legs[0], Steady):
        return Watched(flight)
    t = leg_time_s(flight, view.now_us)
    if view.complaints and t >= MOST_S:
        return given_up(flight, f"restarted in flight, {view.complaints[0]}")
    if view.complaints or t < (RECEIVED_S if view.height_std > 0.0 else TRACKED_S):
        return Watched(flight)
    distance = norm(sub(view.x_quad, view.x_load))
    hangs = view.taut or flight.cable.released
    if not hangs and distance > SLACK_SHARE * settings.cable_length_m and t < MOST_S:
        return Watched(flight)  # whether it hangs is found out when its speed is known
    if not hangs and view.x_load[2] < TOUCH_HEIGHT:
        return Watched(flight, Event.LOAD_DOWN, ((WARNING, LANDING_TEXT),))
    length = distance if view.taut else settings.cable_length_m
    flight = replace(flight, cable=replace(flight.cable, taut_length_m=length))
    return Watched(flight, Event.HOLD, ((WARNING, HOLDING_TEXT),))
