"""The commanded motion of the load, or of a vehicle that has released it, and how it is brought to rest."""

from __future__ import annotations

from dataclasses import replace
from math import isinf

from autopilot.geometry.linear import ZERO, Vec3, norm, scale, sub
from autopilot.geometry.s2 import tangent
from autopilot.guidance.legs import (
    DAMPING_SHARE,
    LOAD_POSITION,
    QUAD_POSITION,
    Leg,
    LevelHold,
    PathResume,
    PathStop,
    SignalRun,
    Swing,
    SwingDamping,
    brake_leg,
    carry_leg,
    lift_leg,
    path_stop_leg,
    winch_hold_height,
)
from autopilot.guidance.setpoint_follower import TrackAttitude, TrackPosition
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import CARRYING, Flight, Phase, View, leg_time_s

AT_REST = 1e-9  # m/s and m/s^2, of a setpoint
FALL_SPEED = 1.0  # m/s: a load that sinks faster has fallen and was caught; it is not being lowered
RESCUE_SHARE = 0.5  # of gravity: deceleration of a load that was caught
STOPPING_S = 0.3  # a climb or descent is stopped at the height it reaches in this time, by at most 2/s of it
DESCENT_SHARE = 0.5  # of its height: a sinking load is stopped no lower
# cosine of the cable's greatest lean from which the acceleration of the load is computed
MIN_CABLE_COSINE = 0.5


def position_mode(flight: Flight) -> int:
    """The control mode in which positions are flown: of the load, or of the vehicle that has released it."""
    return QUAD_POSITION if flight.cable.released else LOAD_POSITION


def tracks_position(flight: Flight) -> bool:
    """Whether the flight is judged by a position: of the load, or of the vehicle that has released it or that
    pulls its cable taut."""
    if not flight.legs:
        return False
    tautens = flight.phase == Phase.TAUTEN
    return tautens or (flight.phase in CARRYING and flight.legs[0].control_mode == position_mode(flight))


def with_control_modes(flight: Flight, legs: tuple[Leg, ...]) -> tuple[Leg, ...]:
    """The legs in the control modes in which they are flown: of the vehicle if the load is released."""
    if not flight.cable.released:
        return legs
    return tuple(
        replace(leg, control_mode=QUAD_POSITION) if leg.control_mode == LOAD_POSITION else leg for leg in legs
    )


def commanded_motion(flight: Flight, view: View, settings: Settings) -> tuple[Vec3, Vec3, Vec3]:
    """Commanded position, velocity and acceleration of the load, or its present ones if none are commanded;
    those of the vehicle if the load is released."""
    if flight.legs and flight.legs[0].control_mode == position_mode(flight):
        jet = flight.legs[0].jet(leg_time_s(flight, view.now_us))
        return jet[0], jet[1], jet[2]
    if flight.cable.released:
        return view.x_quad, view.v_quad if flight.phase in CARRYING else ZERO, ZERO
    if flight.phase not in CARRYING:
        return view.x_load, ZERO, ZERO
    # a load that neither rises nor falls is accelerated by gravity times the tangent of the cable's lean
    cable = sub(view.x_quad, view.x_load)
    if not cable[2] > MIN_CABLE_COSINE * norm(cable):
        return view.x_load, view.v_load, ZERO
    factor = settings.gravity_m_s2 / cable[2]
    return view.x_load, view.v_load, (factor * cable[0], factor * cable[1], 0.0)


def tracks_attitude(leg: Leg) -> bool:
    """Whether the leg controls an attitude, which leaves the position uncontrolled."""
    return isinstance(leg, Swing | SwingDamping | TrackAttitude)


def damping_leg(leg: Leg, view: View, settings: Settings, ends_step: bool) -> SwingDamping:
    """The leg that must come between a leg that does not control the position and one that does."""
    cable = sub(view.x_quad, view.x_load)
    length = norm(cable)
    direction = scale(1.0 / length, cable)
    rate = scale(1.0 / length, tangent(direction, sub(view.v_quad, view.v_load)))
    if isinstance(leg, LevelHold):
        anchor = _stopping_place(view)
    else:
        anchor = view.x_load if isinstance(leg, TrackAttitude) else leg.jet(0.0)[0]
    duration = DAMPING_SHARE * settings.min_move_s
    return SwingDamping(
        anchor, (direction[0], direction[1], 0.0), (rate[0], rate[1], 0.0), ends_step, duration
    )


def _stopping_place(view: View) -> Vec3:
    """The position at which a climbing or sinking load is held, so that it comes to rest without a jerk."""
    x, climb = view.x_load, view.v_load[2]
    return (x[0], x[1], max(x[2] + STOPPING_S * climb, min(x[2], DESCENT_SHARE * x[2])))


def stopping_legs(flight: Flight, view: View, settings: Settings) -> tuple[tuple[Leg, ...], Vec3]:
    """Legs that bring the load from its present motion to rest (none if it rests), and where it will rest; of
    a stop that is being flown, the rest of it."""
    x, v, a = commanded_motion(flight, view, settings)
    if norm(v) <= AT_REST and norm(a) <= AT_REST:
        return (), x
    if flight.legs and flight.legs[0].control_mode == position_mode(flight):
        t, leg = leg_time_s(flight, view.now_us), flight.legs[0]
        if isinstance(leg, TrackPosition):
            if isinf(leg.duration_s):
                return leg.stopped(t, settings.motion.accel_m_s2)
            stop = [leg.remaining(t)]
            for later in flight.legs[1:]:
                if not isinstance(later, TrackPosition):
                    break
                stop.append(later)
            return tuple(stop), stop[-1].point[0]
        slow = path_stop_leg(leg, t, settings.motion.accel_m_s2, settings.min_move_s)
        return (slow,), slow.end
    accel, min_duration_s = settings.motion.accel_m_s2, settings.min_move_s
    brake = brake_leg(x, v, a, accel, min_duration_s)
    if v[2] < -FALL_SPEED or brake.end[2] < min(x[2], 0.0):  # out of a fall: brake as fast as possible
        accel, min_duration_s = (
            max(accel, RESCUE_SHARE * settings.gravity_m_s2),
            DAMPING_SHARE * min_duration_s,
        )
        brake = brake_leg(x, v, a, accel, min_duration_s)
    return (brake,), brake.end


def stopped_run_of(
    flight: Flight, view: View, settings: Settings, next_legs: tuple[Leg, ...]
) -> PathResume | None:
    """How the signals or trajectory that are flown continue after the stop of `stopping_legs`, with which the
    next legs may begin; None if there are none, or they have ended."""
    leg = flight.legs[0] if flight.legs else None
    if not isinstance(leg, SignalRun | PathResume | PathStop):
        return None
    begins_with_stop = bool(next_legs) and isinstance(next_legs[0], PathStop)
    stopping = next_legs if begins_with_stop else stopping_legs(flight, view, settings)[0]
    stop = stopping[0] if stopping and isinstance(stopping[0], PathStop) else None
    path, at_s = (leg, leg_time_s(flight, view.now_us)) if stop is None else (stop.leg, stop.end_s)
    if isinstance(path, PathResume):
        at_s = path.run_time(at_s)
        path = path.run
    if not isinstance(path, SignalRun) or at_s >= path.duration_s:
        return None
    start_s = settings.min_move_s if stop is None else stop.stop_s
    return PathResume(path, at_s, min(start_s, 2.0 * (path.duration_s - at_s)))


def carry(begin: Vec3, end: Vec3, speed: float, settings: Settings, min_duration_s: float = 0.0) -> Leg:
    """A transfer of the load to another place, at rest at both ends, that takes at least `min_duration_s`."""
    return carry_leg(begin, end, speed, settings.motion.accel_m_s2, settings.min_move_s, min_duration_s)


def lift(begin: Vec3, end: Vec3, speed: float, settings: Settings) -> Leg:
    """A transfer straight up or down, from or to near the ground, at rest at both ends."""
    return lift_leg(begin, end, speed, settings.motion.accel_m_s2, settings.min_move_s)


def cable_length_at(flight: Flight, here: Vec3, settings: Settings) -> float:
    """Length of the cable (m) when the load has come to rest at `here`; it follows from its height while the
    winch works."""
    top = winch_hold_height(flight.legs[0]) if flight.legs else None
    return settings.cable_length_m if top is None else top - here[2]
