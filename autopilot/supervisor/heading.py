"""The aim of the heading, and the heading on the way there from tick to tick."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan, pi, radians

from autopilot.geometry.linear import apply
from autopilot.guidance.heading import Aim, FacePoint, Heading, Spin, TurnTo, heading_of, unwrap_near, wrap_pi
from autopilot.guidance.setpoint_follower import (
    AttitudeSetpoint,
    PositionSetpoint,
    SetpointStream,
    TrackAttitude,
)
from autopilot.supervisor.motion import commanded_motion
from autopilot.supervisor.setpoint_source import source_stream
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import IN_AIR, AimedItems, Flight, Phase, View
from missions.model import LookAt, TurnHeading

# between the stored and the estimated heading on the ground; beyond it the latter is used
MAX_HEADING_MISMATCH_RAD = radians(30.0)


def with_aim(flight: Flight, aim: Aim, view: View) -> Flight:
    """The flight with another aim of its heading."""
    return replace(flight, heading=flight.heading.with_aim(aim, view.now_us))


def with_turning_stopped(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight whose heading stops turning, as soon as it can, and stays there."""
    return replace(flight, heading=flight.heading.stopped(view.now_us, settings.heading))


def with_heading_aim(flight: Flight, request: TurnHeading, view: View) -> Flight:
    """The flight that turns to a heading, and keeps it."""
    heading = flight.heading
    start = heading.aim.angle if isinstance(heading.aim, TurnTo) else heading.angle
    change = request.angle_rad if request.relative else wrap_pi(request.angle_rad - start)
    if not request.relative and request.sense * change < 0.0:
        change += 2.0 * pi * request.sense
    rate = inf if request.rate_rad_s is None else request.rate_rad_s
    return with_aim(flight, TurnTo(start + change, max_rate=rate), view)


def with_look_at_aim(flight: Flight, request: LookAt, view: View, settings: Settings) -> Flight:
    """The flight whose heading points to a place; without a place, it stops where it points now."""
    if request.east_m is None or request.north_m is None:
        looks_at_place = isinstance(flight.heading.aim, FacePoint)
        return with_turning_stopped(flight, view, settings) if looks_at_place else flight
    return with_aim(flight, FacePoint((request.east_m, request.north_m, 0.0)), view)


def with_step_heading_aims(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight with the heading aims that its present mission step sets as it begins."""
    plan, step = flight.mission.plan, flight.mission.step
    aims = plan.aims[step] if step < len(plan.aims) else ()
    if not aims:
        return flight
    done: list[int] = []
    turning, turn = None, flight.heading.aim
    for item, aim in aims:
        if isinstance(aim, TurnHeading):
            flight = with_heading_aim(flight, aim, view)
            turning, turn = item, flight.heading.aim
        else:
            flight = with_look_at_aim(flight, aim, view, settings)
            done.append(item)
    held_item = plan.sequence[step]  # a hold for the last aim is reached as a step
    aimed = AimedItems(
        tuple(item for item in done if item != held_item), None if turning == held_item else turning, turn
    )
    return replace(flight, mission=replace(flight.mission, aimed=aimed))


def take_reached_aims(flight: Flight) -> tuple[Flight, tuple[int, ...]]:
    """The flight, and the items among those that set an aim of its heading that are reached by now: a region
    of interest at once, a turn when it has ended. A turn that something else replaces is never reached."""
    mission, aimed, heading = flight.mission, flight.mission.aimed, flight.heading
    if aimed is None:
        return flight, ()
    turns = mission.active and aimed.turning is not None and heading.aim == aimed.aim
    if turns and not heading.is_settled:
        left, reached = aimed._replace(done=()), aimed.done
    else:
        left, reached = None, (*aimed.done, *((aimed.turning,) if turns else ()))
    return replace(flight, mission=replace(mission, aimed=left)), reached


def with_heading_before_flight(flight: Flight, view: View) -> Flight:
    """The flight of a vehicle that is being armed: its heading stays as it was left, unless it was turned."""
    measured, heading = heading_of(view.attitude), flight.heading.at_rest()
    if not abs(wrap_pi(measured - heading.angle)) <= MAX_HEADING_MISMATCH_RAD and not isnan(measured):
        heading = Heading(measured, aim=TurnTo(measured))
    return replace(flight, heading=heading)


def advance_heading(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight with the heading of this tick."""
    if flight.phase not in IN_AIR:
        return flight
    flight = _with_setpoint_aim(flight, view, settings)
    leg = flight.legs[0] if flight.legs else None
    if isinstance(leg, TrackAttitude) and leg.attitude is not None:
        assert leg.setpoint.rates is not None
        angle = unwrap_near(heading_of(leg.attitude), flight.heading)
        rate = apply(leg.attitude, leg.setpoint.rates)[2]
        followed = Heading(angle, rate, 0.0, view.now_us)
        stop = TurnTo(followed.stop_angle(settings.heading))
        return replace(flight, heading=replace(followed, aim=stop))
    if flight.heading.is_settled:
        return flight
    place, velocity, _ = commanded_motion(flight, view, settings)
    advanced = flight.heading.advanced(view.now_us, place, velocity, settings.heading)
    return replace(flight, heading=advanced)


def _with_setpoint_aim(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight with the aim of the setpoint that it follows. Each setpoint is taken once; a spin lasts as
    long as setpoints request it."""
    stream = _followed_stream(flight)
    spinning = isinstance(flight.heading.aim, Spin)
    if stream is None:
        return with_turning_stopped(flight, view, settings) if spinning else flight
    if stream.at_us == flight.setpoints.heading_setpoint_us:
        return flight
    flight = replace(flight, setpoints=replace(flight.setpoints, heading_setpoint_us=stream.at_us))
    setpoint = stream.setpoint
    assert isinstance(setpoint, PositionSetpoint | AttitudeSetpoint)
    if not isnan(setpoint.heading):
        rate = 0.0 if isnan(setpoint.yaw_rate) else setpoint.yaw_rate
        return with_aim(
            flight, TurnTo(unwrap_near(setpoint.heading, flight.heading), rate, stream.at_us), view
        )
    if not isnan(setpoint.yaw_rate):
        return with_aim(flight, Spin(setpoint.yaw_rate), view)
    return with_turning_stopped(flight, view, settings) if spinning else flight


def _followed_stream(flight: Flight) -> SetpointStream | None:
    """The stream of setpoints that is followed, if there is one."""
    stream = source_stream(flight) if flight.phase == Phase.GUIDED else None
    return None if stream is None or stream.setpoint is None else stream
