"""Failsafe: the conditions under which the flight cannot continue. The vehicle lands by what remains of the
estimate, as long as this gives the vertical and roughly the position; otherwise the rotors stop. They also
stop if vehicle or load is far off its path and has been out of control for a while; `lag` cares for those
that are controlled."""

from __future__ import annotations

from dataclasses import replace
from math import cos, degrees, isfinite, radians
from typing import NamedTuple

from autopilot.geometry.linear import Vec3, column, dot, norm, sub
from autopilot.guidance.legs import QUAD_POSITION, LevelHold
from autopilot.supervisor.motion import tracks_position
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CRITICAL,
    IN_AIR,
    Event,
    Flight,
    View,
    can_fly,
    has_lasted,
    interrupt_mission,
    is_landing,
    lost_rotors_text,
    setpoint,
)
from autopilot.supervisor.watches.watch_result import WatchResult
from autopilot.wire.dialect.plumbline import MAV_SEVERITY_EMERGENCY

MAX_LEAN_COSINE = cos(radians(75.0))  # of a vehicle, or of its cable, that is controlled
# m, or the cable's length: nearer, a vehicle that is controlled may push away from where it should be, for
# example when a gust ends or a swing is damped
MIN_AWAY_M = 10.0
# time for which it must be out of control, as in PX4's failure detector: a shorter one may be a gust
OUT_OF_CONTROL_US = 300_000
# m below its path, and m/s: a vehicle that its rotors cannot fly, and that sinks no more, lies on the ground
FALLEN_M, SINK_SPEED = 0.5, 0.3


class PathError(NamedTuple):
    """How far vehicle or load is off the position that it should have."""

    body: str  # "vehicle" or "load"
    offset: Vec3  # m, from where it should be
    rate: Vec3  # m/s, of the offset

    @property
    def distance_m(self) -> float:
        """Length of the offset."""
        return norm(self.offset)

    @property
    def approach_m_s(self) -> float:
        """Speed at which the offset becomes shorter."""
        return -dot(self.offset, self.rate) / max(self.distance_m, 1e-9)


def watch_failsafe(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Give the flight up when it cannot continue."""
    in_air = flight.phase in IN_AIR
    out_of_control = in_air and is_out_of_control(flight, view, settings)
    if out_of_control != (flight.out_of_control_since_us >= 0):
        flight = replace(flight, out_of_control_since_us=view.now_us if out_of_control else -1)
    why = failure_reason(flight, view, settings) if in_air else ""
    return give_up_flight(flight, why) if why else WatchResult(flight)


def watch_missing_readings(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Land when readings that the flight requires are missing, whatever is being flown."""
    in_air = flight.phase in IN_AIR and not is_landing(flight)
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
    error = path_error(flight, view)
    if error is None or not has_lasted(flight.out_of_control_since_us, OUT_OF_CONTROL_US, view.now_us):
        return ""
    if not can_fly(flight, settings):
        return (
            f"{lost_rotors_text(flight.rotors_lost)} lost, {error.body} {error.distance_m:.1f} m off its path"
        )
    return f"{off_path_text(error, settings)}, out of control"


def is_out_of_control(flight: Flight, view: View, settings: Settings) -> bool:
    """Whether vehicle or load is off its path and not controlled any more, as far as this moment shows."""
    error = path_error(flight, view)
    if error is None:
        return False
    is_far_off = not error.distance_m <= settings.failsafe.load_error_limit_m
    if not can_fly(flight, settings):
        return is_far_off or (error.offset[2] < -FALLEN_M and abs(view.v_quad[2]) < SINK_SPEED)
    return is_far_off and not is_controlled(flight, view, error, settings)


def path_error(flight: Flight, view: View) -> PathError | None:
    """How far the load is off its position, or the vehicle that has released it or pulls its cable taut; None
    if no position is controlled."""
    jet = setpoint(flight, view.now_us)
    if jet is None or not tracks_position(flight):
        return None
    if flight.legs[0].control_mode == QUAD_POSITION:
        return PathError("vehicle", sub(view.x_quad, jet[0]), sub(view.v_quad, jet[1]))
    return PathError("load", sub(view.x_load, jet[0]), sub(view.v_load, jet[1]))


def off_path_text(error: PathError, settings: Settings) -> str:
    """How far it is off, and the limit."""
    limit_m = settings.failsafe.load_error_limit_m
    return f"{error.body} {error.distance_m:.1f} m off its path (FS_LOAD_ERR {limit_m:g})"


def is_controlled(flight: Flight, view: View, error: PathError, settings: Settings) -> bool:
    """Whether a vehicle that is far off is controlled nevertheless, and only too weak for the wind or its
    path: vehicle, and the cable of a load that hangs, are roughly upright, and from far away it does not push
    itself farther."""
    upward, cable = column(view.attitude, 2), sub(view.x_quad, view.x_load)
    if not cos(view.tilt_rad) >= MAX_LEAN_COSINE:
        return False
    if error.body == "load" and not cable[2] >= MAX_LEAN_COSINE * norm(cable):
        return False
    if error.distance_m <= max(MIN_AWAY_M, settings.cable_length_m) or error.approach_m_s >= 0.0:
        return True
    return upward[0] * error.offset[0] + upward[1] * error.offset[1] <= 0.0
