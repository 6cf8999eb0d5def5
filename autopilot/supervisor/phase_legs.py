"""What each phase is to fly: the legs with which it begins.

Everything is a function of the flight, the view and the settings.
"""

from __future__ import annotations

from collections.abc import Callable
from math import dist, hypot

from autopilot.geometry.linear import ZERO, Vec3, norm, scale, sub
from autopilot.guidance.legs import (
    LOAD_POSITION,
    QUAD_POSITION,
    Creep,
    Hold,
    Leg,
    SwingDamping,
    lift_leg,
    slack_leg,
)
from autopilot.guidance.setpoint_follower import (
    AttitudeSetpoint,
    TrackAttitude,
    TrackPosition,
    start_following,
)
from autopilot.supervisor.motion import AT_REST, carry, commanded_motion, lift, position_mode, stopping_legs
from autopilot.supervisor.setpoint_source import active_setpoint
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    Flight,
    Phase,
    View,
    fence_problem,
    follow_limits,
    leg_time_s,
    setpoint,
)
from autopilot.supervisor.step_legs import step_legs
from autopilot.trajectory.descent import quick_way_m
from autopilot.trajectory.slack_cable import (
    CLEARANCE,
    SET_DOWN_OFFSET,
    TOUCH_SPEED,
    creep_down_share,
    creep_up_share,
)
from autopilot.trajectory.timeline import return_place
from missions.model import AttitudeRun, LoadPath

P = Phase

TOUCH_HEIGHT = 0.12  # m over the ground at which lowering turns into creeping
# while readings are missing: m, added to TOUCH_HEIGHT; factor of speed and acceleration
BLIND_HEIGHT_MARGIN, BLIND_SPEED_FACTOR = 0.5, 2.0
HEIGHT_SIGMAS = 3.0  # standard deviations by which a height may be wrong
SAME_PLACE_M = 0.01  # between the end of a return and the place to which it leads
HOME_RADIUS = 1.0  # m around the place to return to, within which a return does not climb
MAX_RALLY_CHECKS = 8  # of the nearest rally points: large fences take a tenth of a millisecond for each
MIN_LOAD_HEIGHT = 0.3  # m over home, to which a load that was being lifted or lowered is raised first


def _tauten(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    clear = view.x_load[2] + CLEARANCE * settings.cable_length_m
    up = (view.x_quad[0], view.x_quad[1], clear)
    over = (view.x_load[0], view.x_load[1], clear)
    near = (
        over[0],
        over[1],
        view.x_load[2] + creep_up_share(settings.cable_length_m) * settings.cable_length_m,
    )
    return (
        slack_leg(view.x_quad, up),
        slack_leg(up, over),
        *_long_way(over, near),
        Creep(near, (0.0, 0.0, settings.motion.taut_speed_m_s), QUAD_POSITION),
    )


def _long_way(begin: Vec3, end: Vec3) -> tuple[Leg, ...]:
    """A leg of the slack vehicle that only a long cable has."""
    return (slack_leg(begin, end),) if end != begin else ()


def _lift(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    if flight.cable.released:
        legs, here = stopping_legs(flight, view, settings)
        up = (here[0], here[1], flight.mission.takeoff_altitude_m)
        return (*legs, lift(here, up, settings.motion.lift_speed_m_s, settings))
    top = (view.x_load[0], view.x_load[1], flight.mission.takeoff_altitude_m)
    return (lift(view.x_load, top, settings.motion.lift_speed_m_s, settings),)


def _stop_above_ground(flight: Flight, view: View, settings: Settings) -> tuple[tuple[Leg, ...], Vec3]:
    """Like `stopping_legs`, but the load comes to rest clear of the ground."""
    legs, here = stopping_legs(flight, view, settings)
    if here[2] >= MIN_LOAD_HEIGHT:
        return legs, here
    up = (here[0], here[1], MIN_LOAD_HEIGHT)
    return (*legs, lift(here, up, settings.motion.lift_speed_m_s, settings)), up


def _hold(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    legs, here = _stop_above_ground(flight, view, settings)
    return (*legs, Hold(here))


def _return(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    legs, here = _stop_above_ground(flight, view, settings)
    goal = _return_goal(flight, here, settings)
    min_height = settings.motion.return_altitude_m
    if here[2] < min_height and hypot(goal[0] - here[0], goal[1] - here[1]) > HOME_RADIUS:
        up = (here[0], here[1], min_height)
        legs, here = (*legs, lift(here, up, settings.motion.lift_speed_m_s, settings)), up
    return (*legs, carry(here, (goal[0], goal[1], here[2]), flight.mission.speed_m_s, settings))


def _return_goal(flight: Flight, here: Vec3, settings: Settings) -> Vec3:
    """Home or a nearer rally point; one that the fence forbids does not count, as with ArduPilot."""
    nearest = sorted(flight.area.rally, key=lambda place: dist(place[:2], here[:2]))[:MAX_RALLY_CHECKS]
    allowed = [place for place in nearest if not fence_problem(flight, place, settings)]
    return return_place(here, flight.area.home, allowed)


def leads_home(flight: Flight) -> bool:
    """Whether a return ends over home or a rally point, as these are now."""
    last = flight.legs[-1]
    if isinstance(last, SwingDamping):  # then the way home is determined
        return True
    end = last.jet(last.duration_s)[0]
    return any(dist(place[:2], end[:2]) < SAME_PLACE_M for place in (flight.area.home, *flight.area.rally))


def _guided(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    attitude_setpoint = active_setpoint(flight)
    if isinstance(attitude_setpoint, AttitudeSetpoint):
        attitude_leg = TrackAttitude(attitude_setpoint, commanded_motion(flight, view, settings)[0])
        return (attitude_leg.updated(attitude_setpoint, view.attitude, view.now_us),)
    jet, rate = setpoint(flight, view.now_us), follow_limits(flight, settings).rate
    if jet is None or flight.legs[0].control_mode != position_mode(flight):
        x, v, a = commanded_motion(flight, view, settings)
        return (start_following((x, v, a, ZERO, ZERO, ZERO, ZERO), rate),)
    leg = flight.legs[0]
    if isinstance(leg, TrackPosition):
        return (leg.coasting(leg_time_s(flight, view.now_us), rate),)
    return (start_following(jet, rate),)


def _lower(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    legs, here = stopping_legs(flight, view, settings)
    if flight.cable.released:
        clear = _clear_of_load(here, view, settings)
        low_height = settings.standing_height_m + TOUCH_HEIGHT + HEIGHT_SIGMAS * view.height_std
        low = (clear[0], clear[1], min(here[2], low_height))
        return (
            *legs,
            carry(here, clear, flight.mission.speed_m_s, settings),
            *_descent(clear, low, settings),
            Creep(low, (0.0, 0.0, -TOUCH_SPEED), QUAD_POSITION),
        )
    is_blind = bool(view.estimate_problems)  # then by inertial navigation, which drifts
    height_margin = BLIND_HEIGHT_MARGIN if is_blind else HEIGHT_SIGMAS * view.height_std
    low = (here[0], here[1], min(here[2], TOUCH_HEIGHT + height_margin))
    if is_blind:
        motion = settings.motion
        speed, accel = BLIND_SPEED_FACTOR * motion.lift_speed_m_s, BLIND_SPEED_FACTOR * motion.accel_m_s2
        down: tuple[Leg, ...] = (lift_leg(here, low, speed, accel, settings.min_move_s),)
    else:
        down = _descent(here, low, settings)
    return (*legs, *down, Creep(low, (0.0, 0.0, -TOUCH_SPEED), LOAD_POSITION))


def _descent(begin: Vec3, low: Vec3, settings: Settings) -> tuple[Leg, ...]:
    """Straight down, from rest to rest: quickly to a few metres above the end, if that is far below."""
    motion = settings.motion
    quick_m = quick_way_m(
        begin[2] - low[2],
        motion.descent_speed_m_s,
        motion.lift_speed_m_s,
        motion.accel_m_s2,
        settings.min_move_s,
    )
    near = (low[0], low[1], begin[2] - quick_m)
    slow = lift(near, low, motion.lift_speed_m_s, settings)
    return (lift(begin, near, motion.descent_speed_m_s, settings), slow) if quick_m > 0.0 else (slow,)


def _clear_of_load(here: Vec3, view: View, settings: Settings) -> Vec3:
    """The place at which the vehicle descends so that it does not land on the load that it has released."""
    offset = SET_DOWN_OFFSET * settings.cable_length_m
    beside = (here[0] - view.x_load[0], here[1] - view.x_load[1], 0.0)
    distance = norm(beside)
    if not distance < offset:
        return here
    away = scale(1.0 / distance, beside) if distance > AT_REST else (-1.0, 0.0, 0.0)
    return (view.x_load[0] + offset * away[0], view.x_load[1] + offset * away[1], here[2])


def _set_down(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    clear = min(view.x_quad[2], view.x_load[2] + CLEARANCE * settings.cable_length_m)
    down = (view.x_quad[0], view.x_quad[1], clear)
    aside = (view.x_load[0] - SET_DOWN_OFFSET * settings.cable_length_m, view.x_load[1], clear)
    if dist(view.x_quad[:2], view.x_load[:2]) >= SET_DOWN_OFFSET * settings.cable_length_m:
        aside = down  # it is beside its load already: wind too strong for it keeps it there
    low_height = view.x_load[2] + creep_down_share(settings.cable_length_m) * settings.cable_length_m
    low = (aside[0], aside[1], min(clear, low_height))
    return (
        slack_leg(view.x_quad, down),
        slack_leg(down, aside),
        *_long_way(aside, low),
        Creep(low, (0.0, 0.0, -TOUCH_SPEED), QUAD_POSITION),
    )


def _mission(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    step = flight.mission.plan.steps[flight.mission.step]
    legs, here = stopping_legs(flight, view, settings)
    run = flight.mission.stopped_run if isinstance(step, LoadPath) else None
    # signals and trajectories continue where they stopped; an attitude run is flown again from where it began
    anchor = flight.mission.step_anchor if run is None else run.jet(0.0)[0]
    if anchor is not None and isinstance(step, LoadPath | AttitudeRun) and norm(sub(anchor, here)) > 1e-6:
        legs, here = (*legs, carry(here, anchor, flight.mission.speed_m_s, settings)), anchor
    return (*legs, *(step_legs(step, here, flight, settings) if run is None else (run,)))


ENTRY_LEGS: dict[Phase, Callable[[Flight, View, Settings], tuple[Leg, ...]]] = {
    P.TAUTEN: _tauten,
    P.LIFT: _lift,
    P.HOLD: _hold,
    P.MISSION: _mission,
    P.RETURN: _return,
    P.LOWER: _lower,
    P.SET_DOWN: _set_down,
    P.GUIDED: _guided,
}
