"""The source of setpoints while GUIDED: its present setpoint, and whether it has fallen silent."""

from __future__ import annotations

from autopilot.guidance.setpoint_follower import Asked, PositionSetpoint
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, Guide


def asked_of(flight: Flight) -> Asked | None:
    """The setpoint that is followed while GUIDED; None before the first."""
    match flight.setpoints.guide:
        case Guide.ORBIT:
            return flight.setpoints.circle
        case Guide.MANUAL:
            return flight.setpoints.manual.asked
        case Guide.OFFBOARD:
            return flight.setpoints.offboard.asked


def lost(flight: Flight, now_us: int, settings: Settings) -> bool:
    """Whether the source of setpoints has been silent for too long; a circle needs none."""
    limits, guide = settings.setpoints, flight.setpoints.guide
    if guide == Guide.OFFBOARD:
        stream = flight.setpoints.offboard
        if limits.guided_mode:
            stays = isinstance(stream.asked, PositionSetpoint) and stream.asked.is_place
            return not stays and not stream.alive(now_us, limits.guided_loss_us)
        return not stream.alive(now_us, limits.offboard_loss_us)
    return guide == Guide.MANUAL and not flight.setpoints.manual.alive(now_us, limits.manual_loss_us)
