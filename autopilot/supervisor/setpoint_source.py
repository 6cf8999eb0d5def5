"""The source of setpoints while GUIDED: its present setpoint, and whether it has fallen silent."""

from __future__ import annotations

from autopilot.guidance.setpoint_follower import PositionSetpoint, Setpoint
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, SetpointSource


def active_setpoint(flight: Flight) -> Setpoint | None:
    """The setpoint that is followed while GUIDED; None before the first."""
    match flight.setpoints.source:
        case SetpointSource.ORBIT:
            return flight.setpoints.circle
        case SetpointSource.MANUAL:
            return flight.setpoints.manual.setpoint
        case SetpointSource.OFFBOARD:
            return flight.setpoints.offboard.setpoint


def is_source_lost(flight: Flight, now_us: int, settings: Settings) -> bool:
    """Whether the source of setpoints has been silent for too long; a circle needs none."""
    limits, source = settings.setpoints, flight.setpoints.source
    if source == SetpointSource.OFFBOARD:
        stream = flight.setpoints.offboard
        if limits.ardupilot_guided:
            stays = isinstance(stream.setpoint, PositionSetpoint) and stream.setpoint.is_fixed_position
            return not stays and not stream.is_fresh(now_us, limits.guided_loss_us)
        return not stream.is_fresh(now_us, limits.offboard_loss_us)
    return source == SetpointSource.MANUAL and not flight.setpoints.manual.is_fresh(
        now_us, limits.manual_loss_us
    )
