"""What each phase, and each step of a mission, sets out to fly: the legs with which it begins.

Everything is a function of the flight, the view and the settings.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite

from autopilot.geometry.linear import ZERO, Vec3, norm, scale, sub
from autopilot.geometry.s2 import tangent
from autopilot.guidance.legs import (
    CALM_SHARE,
    LOAD_ATTITUDE,
    LOAD_POSITION,
    QUAD_ATTITUDE,
    QUAD_POSITION,
    Calm,
    Creep,
    Hold,
    Leg,
    Pass,
    Run,
    Swing,
    brake_leg,
    carry_leg,
    reel_leg,
    slow_leg,
    top_of,
    transfer_leg,
)
from autopilot.guidance.setpoint_follower import Asked, AttitudeSetpoint, Follow, Posture, begin_following
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    Event,
    Flight,
    Guide,
    Phase,
    View,
    leg_time_s,
    pace_of,
    setpoint,
)
from autopilot.trajectory.shaping import Shaped, unshaped
from autopilot.trajectory.timeline import RELEASE_S, MissionState, return_place, state_after
from autopilot.trajectory.waypoint_path import Passage
from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    Release,
    ReturnHome,
    Signals,
    Speed,
    Step,
    Takeoff,
    Waypoint,
    Winch,
)

P, E = Phase, Event

CLEARANCE = 0.6  # height over the load, in cable lengths, at which the slack vehicle moves sideways
ASIDE = 0.5  # how far beside the load the vehicle is set down, in cable lengths
SLACK_SPEED, SLACK_ACCEL = 0.6, 0.8  # m/s, m/s^2: the vehicle's transfers while the cable is slack
TOUCH_HEIGHT = 0.12  # m over home at which lowering turns into creeping
HEIGHT_SIGMAS = 3.0  # by which a height may be wrong
TOUCH_SPEED = 0.2  # m/s, of creeping to the ground
LEAST_REEL_M = 1e-4  # a winch that is so near has nothing to do
NEAR_START = 0.3  # m beside the beginning of a path through waypoints from which it is still flown
AT_REST = 1e-9  # m/s and m/s^2, of a setpoint
FALLING = 1.0  # m/s, of a load that was caught and nobody lowers
RESCUE_SHARE = 0.5  # of gravity: deceleration of a load that was caught
LEAST_HEIGHT = 0.3  # m over home, at which a load that was being lifted or lowered is held or carried
STEEPEST = 0.5  # cosine of the cable's lean up to which it says how the load accelerates


def position_mode(flight: Flight) -> int:
    """The control mode in which positions are flown: of the load, or of the vehicle that has released it."""
    return QUAD_POSITION if flight.cable.released else LOAD_POSITION


def as_flown(flight: Flight, legs: tuple[Leg, ...]) -> tuple[Leg, ...]:
    """The legs, flown by the vehicle alone where the load is released."""
    if not flight.cable.released:
        return legs
    return tuple(
        replace(leg, control_mode=QUAD_POSITION) if leg.control_mode == LOAD_POSITION else leg for leg in legs
    )


def asked_motion(flight: Flight, view: View, settings: Settings) -> tuple[Vec3, Vec3, Vec3]:
    """Position, velocity and acceleration asked of the load; those it has if nothing is asked of it. Of the
    vehicle where the load is released."""
    if flight.legs and flight.legs[0].control_mode == position_mode(flight):
        jet = flight.legs[0].jet(leg_time_s(flight, view.now_us))
        return jet[0], jet[1], jet[2]
    if flight.cable.released:
        return view.x_quad, view.v_quad if flight.phase in CARRYING else ZERO, ZERO
    if flight.phase not in CARRYING:
        return view.x_load, ZERO, ZERO
    # a load that neither rises nor falls is accelerated by as much of its weight as the cable leans
    cable = sub(view.x_quad, view.x_load)
    if not cable[2] > STEEPEST * norm(cable):
        return view.x_load, view.v_load, ZERO
    pull = settings.gravity_m_s2 / cable[2]
    return view.x_load, view.v_load, (pull * cable[0], pull * cable[1], 0.0)


def swings(leg: Leg) -> bool:
    return isinstance(leg, Swing | Calm | Posture)


def calm(leg: Leg, view: View, settings: Settings, ends_step: bool) -> Calm:
    """What must come between a leg that left the position alone and one that asks for it."""
    cable = sub(view.x_quad, view.x_load)
    length = norm(cable)
    lean = scale(1.0 / length, cable)
    rate = scale(1.0 / length, tangent(lean, sub(view.v_quad, view.v_load)))
    anchor = view.x_load if isinstance(leg, Posture) else leg.jet(0.0)[0]
    duration = CALM_SHARE * settings.least_move_s
    return Calm(anchor, (lean[0], lean[1], 0.0), (rate[0], rate[1], 0.0), ends_step, duration)


def stop(flight: Flight, view: View, settings: Settings) -> tuple[tuple[Leg, ...], Vec3]:
    """Legs that bring the load to rest out of its present motion (none if it rests), and where that is."""
    x, v, a = asked_motion(flight, view, settings)
    if norm(v) <= AT_REST and norm(a) <= AT_REST:
        return (), x
    if flight.legs and flight.legs[0].control_mode == position_mode(flight):
        t, leg = leg_time_s(flight, view.now_us), flight.legs[0]
        if isinstance(leg, Follow):
            return leg.stopped(t, settings.motion.accel_m_s2)
        slow = slow_leg(leg, t, settings.motion.accel_m_s2, settings.least_move_s)
        return (slow,), slow.end
    accel, least_s = settings.motion.accel_m_s2, settings.least_move_s
    if v[2] < -FALLING:  # out of a fall: there is no time to lose
        accel, least_s = max(accel, RESCUE_SHARE * settings.gravity_m_s2), CALM_SHARE * least_s
    brake = brake_leg(x, v, a, accel, least_s)
    return (brake,), brake.end


# ---- entry of each phase


def _tauten(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    clear = view.x_load[2] + CLEARANCE * settings.cable_length_m
    up = (view.x_quad[0], view.x_quad[1], clear)
    over = (view.x_load[0], view.x_load[1], clear)
    return (
        transfer_leg(view.x_quad, up, SLACK_SPEED, SLACK_ACCEL, QUAD_POSITION),
        transfer_leg(up, over, SLACK_SPEED, SLACK_ACCEL, QUAD_POSITION),
        Creep(over, (0.0, 0.0, settings.motion.taut_speed_m_s), QUAD_POSITION),
    )


def _lift(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    if flight.cable.released:
        legs, here = stop(flight, view, settings)
        up = (here[0], here[1], flight.mission.takeoff_altitude_m)
        return (*legs, _carry(here, up, settings.motion.lift_speed_m_s, settings))
    top = (view.x_load[0], view.x_load[1], flight.mission.takeoff_altitude_m)
    return (_carry(view.x_load, top, settings.motion.lift_speed_m_s, settings),)


def _raised(flight: Flight, view: View, settings: Settings) -> tuple[tuple[Leg, ...], Vec3]:
    """As `stop`, but clear of the ground."""
    legs, here = stop(flight, view, settings)
    if here[2] >= LEAST_HEIGHT:
        return legs, here
    up = (here[0], here[1], LEAST_HEIGHT)
    return (*legs, _carry(here, up, settings.motion.lift_speed_m_s, settings)), up


def _hold(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    legs, here = _raised(flight, view, settings)
    return (*legs, Hold(here))


def _return(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    legs, here = _raised(flight, view, settings)
    goal = return_place(here, flight.area.home, flight.area.rally)
    return (*legs, _carry(here, (goal[0], goal[1], here[2]), flight.mission.speed_m_s, settings))


def asked_of(flight: Flight) -> Asked | None:
    """What the flight's guide asks for."""
    match flight.setpoints.guide:
        case Guide.ORBIT:
            return flight.setpoints.circle
        case Guide.MANUAL:
            return flight.setpoints.manual.asked
        case Guide.OFFBOARD:
            return flight.setpoints.offboard.asked


def _guided(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    asked = asked_of(flight)
    if isinstance(asked, AttitudeSetpoint):
        return (Posture(asked, asked_motion(flight, view, settings)[0]),)
    jet, rate = setpoint(flight, view.now_us), pace_of(flight, settings).rate
    if jet is None or flight.legs[0].control_mode != position_mode(flight):
        x, v, a = asked_motion(flight, view, settings)
        return (begin_following((x, v, a, ZERO, ZERO, ZERO, ZERO), rate),)
    leg = flight.legs[0]
    if isinstance(leg, Follow):
        return (leg.coasting(leg_time_s(flight, view.now_us), rate),)
    return (begin_following(jet, rate),)


def _lower(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    legs, here = stop(flight, view, settings)
    if flight.cable.released:
        clear = _clear_of_load(here, view, settings)
        low = (clear[0], clear[1], min(here[2], LEAST_HEIGHT))
        return (
            *legs,
            _carry(here, clear, flight.mission.speed_m_s, settings),
            _carry(clear, low, settings.motion.lift_speed_m_s, settings),
            Creep(low, (0.0, 0.0, -TOUCH_SPEED), QUAD_POSITION),
        )
    low = (here[0], here[1], min(here[2], TOUCH_HEIGHT + HEIGHT_SIGMAS * view.height_std))
    return (
        *legs,
        _carry(here, low, settings.motion.lift_speed_m_s, settings),
        Creep(low, (0.0, 0.0, -TOUCH_SPEED), LOAD_POSITION),
    )


def _clear_of_load(here: Vec3, view: View, settings: Settings) -> Vec3:
    """The place at which the vehicle comes down without landing on the load that it has released."""
    reach = ASIDE * settings.cable_length_m
    beside = (here[0] - view.x_load[0], here[1] - view.x_load[1], 0.0)
    distance = norm(beside)
    if not distance < reach:
        return here
    away = scale(1.0 / distance, beside) if distance > AT_REST else (-1.0, 0.0, 0.0)
    return (view.x_load[0] + reach * away[0], view.x_load[1] + reach * away[1], here[2])


def _set_down(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    clear = min(view.x_quad[2], view.x_load[2] + CLEARANCE * settings.cable_length_m)
    down = (view.x_quad[0], view.x_quad[1], clear)
    aside = (view.x_load[0] - ASIDE * settings.cable_length_m, view.x_load[1], clear)
    return (
        transfer_leg(view.x_quad, down, SLACK_SPEED, SLACK_ACCEL, QUAD_POSITION),
        transfer_leg(down, aside, SLACK_SPEED, SLACK_ACCEL, QUAD_POSITION),
        Creep(aside, (0.0, 0.0, -TOUCH_SPEED), QUAD_POSITION),
    )


def _carry(begin: Vec3, end: Vec3, speed: float, settings: Settings, least_s: float = 0.0) -> Leg:
    return carry_leg(begin, end, speed, settings.motion.accel_m_s2, max(least_s, settings.least_move_s))


def _least_s(flight: Flight) -> float:
    """What the transfer of the present step takes at least, for rotors, cable and tilt."""
    least = flight.mission.plan.prepared.least_s
    return least[flight.mission.step] if flight.mission.step < len(least) else 0.0


def _mission(flight: Flight, view: View, settings: Settings) -> tuple[Leg, ...]:
    step = flight.mission.plan.steps[flight.mission.step]
    legs, here = stop(flight, view, settings)
    anchor = flight.mission.step_anchor
    if anchor is not None and isinstance(step, Signals | AttitudeRun) and norm(sub(anchor, here)) > 1e-6:
        # a step that is taken up again after a pause begins anew, from where it began
        back = _carry(here, anchor, flight.mission.speed_m_s, settings)
        return (*legs, back, *step_legs(step, anchor, flight, settings))
    return (*legs, *step_legs(step, here, flight, settings))


def length_at(flight: Flight, here: Vec3, settings: Settings) -> float:
    """Length of the cable when the load has come to rest at `here`, whose height a winch at work decides."""
    top = top_of(flight.legs[0]) if flight.legs else None
    return settings.cable_length_m if top is None else top - here[2]


def destination(step: Step, here: Vec3, flight: Flight) -> Vec3:
    """Where a step leads that begins with load or vehicle at rest at `here`."""
    there = state_after(step, MissionState(here), flight.area.home).expected
    assert there is not None, "from a known place"
    return there


def step_legs(step: Step, here: Vec3, flight: Flight, settings: Settings) -> tuple[Leg, ...]:
    match step:
        case Takeoff():
            up = destination(step, here, flight)
            return (_carry(here, up, settings.motion.lift_speed_m_s, settings),)
        case Waypoint(hold_s=hold):
            there = destination(step, here, flight)
            path = made(flight, flight.mission.step)
            go: Leg
            if isinstance(path, Passage) and path.begin_s == 0.0 and norm(sub(here, path.start)) < NEAR_START:
                fade = min(settings.least_move_s, float(path.table[-1, 1]))
                go = Pass(path, sub(here, path.start), fade)
            else:
                go = _carry(here, there, flight.mission.speed_m_s, settings, _least_s(flight))
            return (go, Hold(there, max(hold - borrowed(flight), 0.0))) if hold > 0.0 else (go,)
        case Delay(duration_s=duration):
            return (Hold(here, max(duration - borrowed(flight), 0.0)),)
        case ReturnHome():
            there = destination(step, here, flight)
            return (_carry(here, there, flight.mission.speed_m_s, settings, _least_s(flight)),)
        case Signals():
            return (Run(here, _path_of(flight, flight.mission.step) or unshaped(step)),)
        case AttitudeRun(
            controlled=controlled, tilt_north_rad=north, tilt_east_rad=east, duration_s=duration
        ):
            mode = QUAD_ATTITUDE if controlled == "vehicle" else LOAD_ATTITUDE
            return (Swing(here, north, east, duration, mode),)
        case Speed():
            return (Hold(here, 0.0),)
        case Release():
            return (Hold(here, RELEASE_S),)
        case Winch(speed_m_s=speed):
            wanted = settings.cable_length_m if flight.cable.reel_to_m is None else flight.cable.reel_to_m
            length = length_at(flight, here, settings)
            if abs(wanted - length) < LEAST_REEL_M:
                return (Hold(here, 0.0),)
            return (
                reel_leg(here, length, wanted, speed or settings.winch.speed_m_s, settings.winch.accel_m_s2),
            )
        case Land():
            return ()
    raise AssertionError(step)


def made(flight: Flight, step: int) -> Shaped | Passage | None:
    """What was made ready for a step of the plan, if anything was."""
    made = flight.mission.plan.prepared.made
    return made[step] if 0 <= step < len(made) else None


def _path_of(flight: Flight, step: int) -> Shaped | None:
    """The signals that were made ready for a step of the plan, if it is one of these."""
    found = made(flight, step)
    return found if isinstance(found, Shaped) else None


def borrowed(flight: Flight) -> float:
    """Time (s) that the paths before and after the present step take from its hold: to come to rest, and to
    get ready."""
    before, after = _path_of(flight, flight.mission.step - 1), _path_of(flight, flight.mission.step + 1)
    return (before.tail_s if before else 0.0) + (after.lead_s if after else 0.0)


def following_legs(flight: Flight, settings: Settings) -> tuple[Leg, ...]:
    """The legs of the step after the present one, where it begins at rest where this one ends."""
    step = flight.mission.step + 1
    if (
        not flight.mission.active
        or flight.phase not in (P.LIFT, P.MISSION)
        or step >= len(flight.mission.plan.steps)
    ):
        return ()
    last = flight.legs[-1] if flight.legs else None
    if last is None or last.control_mode != LOAD_POSITION or not isfinite(last.duration_s):
        return ()
    end = last.jet(last.duration_s)
    coming = flight.mission.plan.steps[step]
    if norm(end[1]) > AT_REST or not isinstance(coming, Waypoint | Delay | ReturnHome | Signals):
        return ()
    return step_legs(coming, end[0], replace(flight, mission=replace(flight.mission, step=step)), settings)


ENTRY = {
    P.TAUTEN: _tauten,
    P.LIFT: _lift,
    P.HOLD: _hold,
    P.MISSION: _mission,
    P.RETURN: _return,
    P.LOWER: _lower,
    P.SET_DOWN: _set_down,
    P.GUIDED: _guided,
}
