"""Setpoints: one above the ground begins the take-off; while GUIDED the load is led towards the latest."""

from __future__ import annotations

from dataclasses import replace

from autopilot.guidance.setpoint_follower import (
    AttitudeSetpoint,
    PositionSetpoint,
    TrackAttitude,
    TrackPosition,
)
from autopilot.supervisor.motion import with_control_modes
from autopilot.supervisor.phase_legs import MIN_LOAD_HEIGHT
from autopilot.supervisor.setpoint_source import (
    TARGET_LOSS_US,
    active_setpoint,
    is_source_lost,
    is_target_lost,
    waiting_for_target,
)
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    INFO,
    WARNING,
    ActionWhenArmed,
    Event,
    Flight,
    Phase,
    SetpointSource,
    View,
    follow_limits,
    leg_time_s,
    takeoff_event,
)
from autopilot.supervisor.watches.watch_result import WatchResult


def watch_takeoff_setpoint(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Armed for OFFBOARD, take off when a setpoint is above the ground."""
    if flight.phase != Phase.ARMED or flight.action_when_armed != ActionWhenArmed.OFFBOARD:
        return WatchResult(flight)
    setpoint = flight.setpoints.offboard.setpoint
    if not isinstance(setpoint, PositionSetpoint) or is_source_lost(flight, view.now_us, settings):
        return WatchResult(flight)
    height = setpoint.position[2]
    if not height >= MIN_LOAD_HEIGHT:
        if not setpoint.velocity[2] > 0.0:
            return WatchResult(flight)
        height = MIN_LOAD_HEIGHT
    at_speed = flight.mission.at_speed(settings.motion.speed_m_s)
    mission = replace(at_speed, takeoff_altitude_m=height, active=False)
    return WatchResult(replace(flight, mission=mission), takeoff_event(flight))


def watch_setpoints(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Lead the load towards the setpoint of this moment; hold it if the source falls silent. A target that is
    lost is waited for."""
    if flight.phase != Phase.GUIDED:
        return WatchResult(flight)
    source, circle = flight.setpoints.source, flight.setpoints.circle
    if is_source_lost(flight, view.now_us, settings):
        text = f"Nothing usable from {source.value} any more: holding"
        return WatchResult(flight, Event.HOLD, ((WARNING, text),))
    if source == SetpointSource.TARGET and is_target_lost(flight, view.now_us):
        text = f"No FOLLOW_TARGET for {TARGET_LOSS_US / 1e6:g} s: the load waits for it"
        return WatchResult(waiting_for_target(flight, view.now_us), texts=((WARNING, text),))
    if source == SetpointSource.ORBIT and circle is not None and view.now_us >= circle.ends_us:
        return WatchResult(flight, Event.HOLD, ((INFO, "Circle flown: holding"),))
    setpoint, leg = active_setpoint(flight), flight.legs[0]
    if isinstance(leg, TrackAttitude):
        if isinstance(setpoint, AttitudeSetpoint):
            return WatchResult(replace(flight, legs=(leg.updated(setpoint, view.attitude, view.now_us),)))
        return WatchResult(flight, Event.OTHER_SETPOINT)
    if isinstance(leg, TrackPosition):
        if isinstance(setpoint, AttitudeSetpoint):
            return WatchResult(flight, Event.OTHER_SETPOINT)
        if setpoint is not None:
            t = leg_time_s(flight, view.now_us)
            followed = leg.redirected(t, setpoint, follow_limits(flight, settings), view.now_us)
            return WatchResult(
                replace(flight, legs=with_control_modes(flight, (followed,)), leg_start_us=view.now_us)
            )
    return WatchResult(flight)
