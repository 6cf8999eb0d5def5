"""Failsafe: the conditions under which the flight cannot continue. The vehicle lands by what remains of the
estimate, as long as this gives the vertical and roughly the position; otherwise the rotors stop."""

from __future__ import annotations

from math import degrees, isfinite

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import LevelHold
from autopilot.supervisor.motion import position_mode
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    CRITICAL,
    IN_AIR,
    LANDING,
    Event,
    Flight,
    View,
    interrupt_mission,
    setpoint,
)
from autopilot.supervisor.watches.watch_result import WatchResult
from autopilot.wire.dialect.plumbline import MAV_SEVERITY_EMERGENCY


def watch_failsafe(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Give the flight up when it cannot continue."""
    why = failure_reason(flight, view, settings) if flight.phase in IN_AIR else ""
    return give_up_flight(flight, why) if why else WatchResult(flight)


def watch_missing_readings(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Land when readings that the flight requires are missing, whatever is being flown."""
    in_air = flight.phase in IN_AIR and flight.phase not in LANDING
    if not view.estimate_problems or not in_air or isinstance(flight.legs[0], LevelHold):
        return WatchResult(flight)
    text = f"Failsafe: {view.estimate_problems[0]}, landing"
    return WatchResult(interrupt_mission(flight), Event.LAND, ((CRITICAL, text),))


def give_up_flight(flight: Flight, why: str) -> WatchResult:
    """The end of a flight, with its reason."""
    return WatchResult(
        interrupt_mission(flight), Event.FAIL, ((MAV_SEVERITY_EMERGENCY, f"Flight given up: {why}"),)
    )


def failure_reason(flight: Flight, view: View, settings: Settings) -> str:
    """Why the flight cannot continue, or an empty string."""
    limits = settings.failsafe
    if view.estimate_loss and not (flight.legs and isinstance(flight.legs[0], LevelHold)):
        return view.estimate_loss
    if not all(map(isfinite, (view.tilt_rad, *view.x_quad, *view.v_quad, *view.x_load, *view.v_load))):
        return "the estimate is not a number"
    if view.tilt_rad > limits.tilt_limit_rad:
        limit = degrees(limits.tilt_limit_rad)
        return f"tilt {degrees(view.tilt_rad):.1f} deg exceeds FS_TILT_DEG {limit:.0f}"
    if flight.phase in CARRYING and flight.legs and flight.legs[0].control_mode == position_mode(flight):
        jet = setpoint(flight, view.now_us)
        what, place = ("vehicle", view.x_quad) if flight.cable.released else ("load", view.x_load)
        error = norm(sub(place, jet[0])) if jet is not None else 0.0
        if not error <= limits.load_error_limit_m:
            return f"{what} error {error:.1f} m exceeds FS_LOAD_ERR {limits.load_error_limit_m:.1f} m"
    return ""
