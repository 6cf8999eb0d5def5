"""Pulling the cable taut: the rising vehicle is kept over its load until the cable pulls. A vehicle that
drifts away meanwhile, in strong wind for example, or that drags its load along, lands."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, radians

from autopilot.geometry.linear import Vec3, dot, norm, sub
from autopilot.guidance.legs import Creep, slack_leg
from autopilot.supervisor.phase_legs import HEIGHT_SIGMAS
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CRITICAL,
    INFO,
    Event,
    Flight,
    Phase,
    View,
    has_lasted,
    interrupt_mission,
    leg_time_s,
    with_condition,
)
from autopilot.supervisor.watches.cable_pull import PULL_US, TAUT_PULL_SHARE, cable_pull_share
from autopilot.supervisor.watches.failsafe import PathError, off_path_text, path_error
from autopilot.supervisor.watches.watch_result import WatchResult
from autopilot.trajectory.slack_cable import creep_up_share
from autopilot.wire.dialect.plumbline import MAV_SEVERITY_ERROR

# m, and share of the cable's length: a rising vehicle that is farther beside the load is moved over it. What
# a camera sees of a load far below is about as uncertain.
MAX_LOAD_OFFSET, MAX_OFFSET_SHARE = 0.08, 0.01
LIFTING_TEXT = "Cable taut, lifting the load"
LIFTING_UNOBSERVED_TEXT = "Cable taut, lifting the load; no load sensor"
LATE_FACTOR = 2.0  # factor of the time in which the setpoint rises from the load to its last height
# further time, in which a plain receiver may find the heights of vehicle and load; it needs up to ten
PATIENCE_S = 30.0
# The vehicle's setpoint rises above the cable's length by this share of it, and at least by this share of the
# lead at which the law pulls with the load's weight: then the cable must have come taut.
STRETCH_SHARE, LEAD_SHARE = 0.3, 1.3
MIN_SPEED = 0.3  # m/s: a vehicle that moves away from its place more slowly is not carried off
MIN_DRAG_SPEED = 0.05  # m/s: the same of one that has dragged its load far away and goes on
WINDY_TILT_RAD = radians(20.0)  # a vehicle that tilts more pushes against strong wind
HIDDEN_S = 2.0  # where the pull decides, the setpoint rises on for this time, as gusts may hide the pull


def watch_tautening(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Lift when the cable pulls; land if it never does although the vehicle rises, or if the vehicle
    drifts away."""
    if flight.phase != Phase.TAUTEN or flight.out_of_control_since_us >= 0:  # `failsafe` cares for the latter
        return WatchResult(flight)
    error, limit_m = path_error(flight, view), settings.failsafe.load_error_limit_m
    if error is None:
        return WatchResult(flight)
    way = sub(view.x_load, flight.cable.ground_place)  # along which the vehicle has dragged its load
    # on a short cable, a load that was not dragged as far may hold the vehicle yet
    may_be_held = max(norm(way), settings.cable_length_m) <= limit_m
    if error.distance_m > limit_m and error.approach_m_s <= -MIN_SPEED and not may_be_held:
        return _drifts_away(flight, off_path_text(error, settings))
    if len(flight.legs) != 1:
        return WatchResult(flight)
    flight = _note_pull(flight, view, settings)
    if has_lasted(flight.condition_since_us, PULL_US, view.now_us):
        length = norm(sub(view.x_quad, view.x_load))
        flight = replace(flight, cable=replace(flight.cable, taut_length_m=length))
        return WatchResult(
            flight, Event.TAUT, ((INFO, LIFTING_UNOBSERVED_TEXT if view.load_unobserved else LIFTING_TEXT),)
        )
    creep = flight.legs[0]
    assert isinstance(creep, Creep)
    at = creep.jet(leg_time_s(flight, view.now_us))[0]
    over = (view.x_load[0], view.x_load[1], at[2])
    # each move over the load begins the climb anew: one that hangs unnoticed would be followed for ever
    is_too_late = view.now_us > give_up_us(flight, settings)
    # for example because the load was not seen well from the ground
    if not norm(sub(over, at)) <= max_load_offset(settings):
        if norm(way) > limit_m and dot(way, view.v_quad) >= MIN_DRAG_SPEED * norm(way):
            return _drifts_away(flight, f"load dragged by {norm(way):.1f} m (FS_LOAD_ERR {limit_m:g})")
        late = view.now_us - flight.phase_start_us > _late_s(settings) * 1e6
        if late and _pulls_although_short(view, settings):
            return _never_taut(flight, view, error, settings)
        if not is_too_late:
            return WatchResult(_moved_over_load(flight, view, creep, at, over))
    last_height = last_setpoint_height(creep, settings) + HEIGHT_SIGMAS * view.height_std
    if not view.load_tracked:
        last_height += HIDDEN_S * creep.velocity[2]
    if flight.condition_since_us < 0 and (at[2] > last_height or is_too_late):
        return _never_taut(flight, view, error, settings)
    return WatchResult(flight)


def _never_taut(flight: Flight, view: View, error: PathError, settings: Settings) -> WatchResult:
    """Land, as the cable did not come taut, or pulls although it is too short to count as taut."""
    if _pulls_although_short(view, settings):
        length = norm(sub(view.x_quad, view.x_load))
        causes = _causes(error, view, "VEH_CABLE_LEN")
        text = f"Cable pulls at {length:.2f} m, landing; {causes}"
    else:
        causes = _causes(error, view, "VEH_CABLE_LEN, VEH_LOAD_MASS and VEH_QUAD_MASS")
        text = f"Cable never taut, landing; {causes}"
    return WatchResult(interrupt_mission(flight), Event.LAND, ((CRITICAL, text),))


def _drifts_away(flight: Flight, how_far: str) -> WatchResult:
    """Land. The wind is not measured: it cannot be told from a vehicle that flies unlike the assumed one."""
    text = (
        f"Failsafe: drifts away while tautening the cable, {how_far}, landing; wind too strong, rotors "
        "too slow, or the vehicle differs from its file"
    )
    return WatchResult(interrupt_mission(flight), Event.LAND, ((MAV_SEVERITY_ERROR, text),))


def _causes(error: PathError, view: View, parameters: str) -> str:
    """What may be wrong when the cable does not come taut: these parameters, or strong wind. A level vehicle
    that is far off its path is held down by its load."""
    if view.tilt_rad <= WINDY_TILT_RAD:
        return f"check {parameters}"
    found = f"{error.distance_m:.1f} m off its path, tilted by {degrees(view.tilt_rad):.0f} deg"
    return f"too much wind ({found})? Else check {parameters}"


def _note_pull(flight: Flight, view: View, settings: Settings) -> Flight:
    """Note since when the cable that is being tautened pulls.

    The estimate counts the cable as taut a little before it is: if lifting began then, the cable would come
    taut in the middle of the lift.
    """
    pulls = cable_pull_share(view, settings) > TAUT_PULL_SHARE and view.taut
    return with_condition(flight, pulls, view.now_us)


def _pulls_although_short(view: View, settings: Settings) -> bool:
    """Whether the cable pulls but is shorter than a taut cable would be, by more than the error of a height
    that a receiver measures. Its load may be beside the vehicle because it swings."""
    distance = norm(sub(view.x_quad, view.x_load))
    if not distance + HEIGHT_SIGMAS * view.height_std < settings.cable_length_m:
        return False
    return not view.taut and cable_pull_share(view, settings) > TAUT_PULL_SHARE


def _late_s(settings: Settings) -> float:
    """Time of tautening after which the cable should long have come taut."""
    return LATE_FACTOR * max_setpoint_distance(settings) / settings.motion.taut_speed_m_s


def give_up_us(flight: Flight, settings: Settings) -> int:
    """The time after which a cable that is being tautened counts as never taut, wherever the vehicle is."""
    return flight.phase_start_us + round((_late_s(settings) + PATIENCE_S) * 1e6)


def _moved_over_load(flight: Flight, view: View, creep: Creep, at: Vec3, over: Vec3) -> Flight:
    """The flight whose vehicle, which rises by `creep`, is moved from `at` to `over`, above the load."""
    legs = (
        slack_leg(at, over),
        replace(creep, begin=over),
    )
    return replace(flight, legs=legs, leg_start_us=view.now_us)


def max_setpoint_distance(settings: Settings) -> float:
    """Height of the vehicle's setpoint over the load (m) at which the cable must have come taut."""
    length = settings.cable_length_m
    return length + max(STRETCH_SHARE * length, LEAD_SHARE * settings.motion.weight_lead_m)


def last_setpoint_height(creep: Creep, settings: Settings) -> float:
    """The same as a height over home (m), of a vehicle that creeps up to there."""
    length = settings.cable_length_m
    return creep.begin[2] + max_setpoint_distance(settings) - creep_up_share(length) * length


def max_load_offset(settings: Settings) -> float:
    """How far beside the load (m) the setpoint of a rising vehicle may be."""
    return max(MAX_LOAD_OFFSET, MAX_OFFSET_SHARE * settings.cable_length_m)
