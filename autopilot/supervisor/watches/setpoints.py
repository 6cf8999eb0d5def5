"""Setpoints: one above the ground begins the take-off; while GUIDED the load is led towards the latest."""

from __future__ import annotations

from dataclasses import replace

from autopilot.guidance.setpoint_follower import AttitudeSetpoint, Follow, PositionSetpoint, Posture
from autopilot.supervisor.guide import asked_of, lost
from autopilot.supervisor.motion import as_flown
from autopilot.supervisor.phase_legs import LEAST_HEIGHT
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    INFO,
    WARNING,
    Event,
    Flight,
    Guide,
    Phase,
    Selected,
    View,
    leg_time_s,
    pace_of,
    takeoff_event,
)
from autopilot.supervisor.watches.watched import Watched


def watch_takeoff_setpoint(flight: Flight, view: View, settings: Settings) -> Watched:
    """Armed for OFFBOARD, take off when a setpoint is above the ground."""
    if flight.phase != Phase.ARMED or flight.selected != Selected.OFFBOARD:
        return Watched(flight)
    asked = flight.setpoints.offboard.asked
    if not isinstance(asked, PositionSetpoint) or lost(flight, view.now_us, settings):
        return Watched(flight)
    height = asked.position[2]
    if not height >= LEAST_HEIGHT:
        if not asked.velocity[2] > 0.0:
            return Watched(flight)
        height = LEAST_HEIGHT
    speed = settings.motion.speed_m_s
    mission = replace(flight.mission, speed_m_s=speed, takeoff_altitude_m=height, active=False)
    return Watched(replace(flight, mission=mission), takeoff_event(flight))


def watch_setpoints(flight: Flight, view: View, settings: Settings) -> Watched:
    """Lead the load towards the setpoint of this moment; hold it if the source falls silent."""
    if flight.phase != Phase.GUIDED:
        return Watched(flight)
    guide, circle = flight.setpoints.guide, flight.setpoints.circle
    if lost(flight, view.now_us, settings):
        text = f"Nothing usable from {guide.value} any more: holding"
        return Watched(flight, Event.HOLD, ((WARNING, text),))
    if guide == Guide.ORBIT and circle is not None and view.now_us >= circle.ends_us:
        return Watched(flight, Event.HOLD, ((INFO, "Circle flown: holding"),))
    asked, leg = asked_of(flight), flight.legs[0]
    if isinstance(leg, Posture):
        if isinstance(asked, AttitudeSetpoint):
            return Watched(replace(flight, legs=(leg.onward(asked, view.attitude, view.now_us),)))
        return Watched(flight, Event.OTHER_SETPOINT)
    if isinstance(leg, Follow):
        if isinstance(asked, AttitudeSetpoint):
            return Watched(flight, Event.OTHER_SETPOINT)
        if asked is not None:
            t = leg_time_s(flight, view.now_us)
            led = leg.onward(t, asked, pace_of(flight, settings), view.now_us)
            return Watched(replace(flight, legs=as_flown(flight, (led,)), leg_start_us=view.now_us))
    return Watched(flight)
