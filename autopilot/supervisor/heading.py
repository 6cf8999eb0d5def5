"""Where the nose is to point: its aim, and the heading on the way there from tick to tick."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan, pi, radians

from autopilot.geometry.linear import apply
from autopilot.guidance.heading import Aim, Gaze, Heading, Spin, Towards, heading_of, nearest, turn
from autopilot.guidance.setpoint_follower import AttitudeSetpoint, PositionSetpoint, Posture, Stream
from autopilot.supervisor.motion import asked_motion
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import IN_AIR, Flight, Guide, Phase, View
from missions.model import LookAt, TurnNose

ASKEW = radians(30.0)  # between stored heading and estimated nose on the ground; beyond it the latter is used


def pointed(flight: Flight, aim: Aim, view: View) -> Flight:
    """The flight with another aim of its heading."""
    return replace(flight, heading=flight.heading.asked(aim, view.now_us))


def heading_kept(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight whose nose stops turning, as soon as it can, and then keeps its heading."""
    return replace(flight, heading=flight.heading.stopped(view.now_us, settings.heading))


def turned(flight: Flight, asked: TurnNose, view: View) -> Flight:
    """The flight whose nose turns to a heading, and keeps it."""
    heading = flight.heading
    begin = heading.aim.angle if isinstance(heading.aim, Towards) else heading.angle
    way = asked.angle_rad if asked.relative else turn(asked.angle_rad - begin)
    if not asked.relative and asked.sense * way < 0.0:
        way += 2.0 * pi * asked.sense
    rate = inf if asked.rate_rad_s is None else asked.rate_rad_s
    return pointed(flight, Towards(begin + way, rate=rate), view)


def looking(flight: Flight, asked: LookAt, view: View, settings: Settings) -> Flight:
    """The flight whose nose stays turned to a place; without a place, it stops where it points now."""
    if asked.east_m is None or asked.north_m is None:
        gazes = isinstance(flight.heading.aim, Gaze)
        return heading_kept(flight, view, settings) if gazes else flight
    return pointed(flight, Gaze((asked.east_m, asked.north_m, 0.0)), view)


def heading_of_step(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight with the aims of the nose that its present mission step sets as it begins."""
    plan, step = flight.mission.plan, flight.mission.step
    for aim in plan.aims[step] if step < len(plan.aims) else ():
        if isinstance(aim, TurnNose):
            flight = turned(flight, aim, view)
        else:
            flight = looking(flight, aim, view, settings)
    return flight


def heading_before_flight(flight: Flight, view: View) -> Flight:
    """The flight of a vehicle that is being armed: its heading stays as it was left, unless it was turned."""
    nose, heading = heading_of(view.attitude), flight.heading.at_rest()
    if not abs(turn(nose - heading.angle)) <= ASKEW and not isnan(nose):
        heading = Heading(nose, aim=Towards(nose))
    return replace(flight, heading=heading)


def heading_onward(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight with the heading of this tick."""
    if flight.phase not in IN_AIR:
        return flight
    flight = _heeded(flight, view, settings)
    leg = flight.legs[0] if flight.legs else None
    if isinstance(leg, Posture) and leg.attitude is not None:
        assert leg.lean.rates is not None
        angle = nearest(heading_of(leg.attitude), flight.heading)
        rate = apply(leg.attitude, leg.lean.rates)[2]
        led = Heading(angle, rate, 0.0, view.now_us)
        stop = Towards(led.stop_angle(settings.heading))
        return replace(flight, heading=replace(led, aim=stop))
    if flight.heading.rests:
        return flight
    place, velocity, _ = asked_motion(flight, view, settings)
    onward = flight.heading.onward(view.now_us, place, velocity, settings.heading)
    return replace(flight, heading=onward)


def _heeded(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight with the aim of the setpoint that it follows. Each setpoint is taken once; a spin lasts as
    long as setpoints request it."""
    stream = _followed(flight)
    spins = isinstance(flight.heading.aim, Spin)
    if stream is None:
        return heading_kept(flight, view, settings) if spins else flight
    if stream.at_us == flight.setpoints.heeded_us:
        return flight
    flight = replace(flight, setpoints=replace(flight.setpoints, heeded_us=stream.at_us))
    asked = stream.asked
    assert isinstance(asked, PositionSetpoint | AttitudeSetpoint)
    if not isnan(asked.heading):
        along = 0.0 if isnan(asked.turning) else asked.turning
        return pointed(flight, Towards(nearest(asked.heading, flight.heading), along, stream.at_us), view)
    if not isnan(asked.turning):
        return pointed(flight, Spin(asked.turning), view)
    return heading_kept(flight, view, settings) if spins else flight


def _followed(flight: Flight) -> Stream | None:
    """The stream of setpoints that is followed, if there is one."""
    if flight.phase != Phase.GUIDED or flight.setpoints.guide == Guide.ORBIT:
        return None
    manual = flight.setpoints.guide == Guide.MANUAL
    stream = flight.setpoints.manual if manual else flight.setpoints.offboard
    return None if stream.asked is None else stream
