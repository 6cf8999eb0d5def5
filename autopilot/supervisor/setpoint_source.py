"""The source of setpoints while GUIDED: its present setpoint, and whether it has fallen silent."""

from __future__ import annotations

from dataclasses import replace

from autopilot.geometry.linear import ZERO
from autopilot.guidance.setpoint_follower import PositionSetpoint, Setpoint, SetpointStream
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, SetpointSource

TARGET_LOSS_US = 3_000_000  # silence after which a target counts as lost; MAVSDK reports one once a second
WAIT = PositionSetpoint(velocity=ZERO)  # while there is no target


def source_stream(flight: Flight) -> SetpointStream | None:
    """The stream whose setpoints are followed while GUIDED; None: a circle, which needs none."""
    match flight.setpoints.source:
        case SetpointSource.ORBIT:
            return None
        case SetpointSource.MANUAL:
            return flight.setpoints.manual
        case SetpointSource.OFFBOARD:
            return flight.setpoints.offboard
        case SetpointSource.TARGET:
            return flight.setpoints.beside_target


def active_setpoint(flight: Flight) -> Setpoint | None:
    """The setpoint that is followed while GUIDED; None before the first. A vehicle that has released its load
    follows a target a cable length above the place where the load would be."""
    stream = source_stream(flight)
    if stream is None:
        return flight.setpoints.circle
    setpoint, cable = stream.setpoint, flight.cable
    if (
        cable.released
        and flight.setpoints.source == SetpointSource.TARGET
        and isinstance(setpoint, PositionSetpoint)
    ):
        x, y, z = setpoint.position
        length_m = cable.taut_length_m if cable.length_m is None else cable.length_m
        return replace(setpoint, position=(x, y, z + length_m))
    return setpoint


def is_target_awaited(flight: Flight) -> bool:
    """Whether the place beside the target is not known, and the load waits for it."""
    return flight.setpoints.beside_target.setpoint is WAIT


def is_target_lost(flight: Flight, now_us: int) -> bool:
    """Whether a target that was known has not been reported for too long."""
    is_fresh = flight.setpoints.beside_target.is_fresh(now_us, TARGET_LOSS_US)
    return not is_fresh and not is_target_awaited(flight)


def waiting_for_target(flight: Flight, now_us: int) -> Flight:
    """The flight that waits until its target is reported."""
    return replace(flight, setpoints=replace(flight.setpoints, beside_target=SetpointStream(WAIT, now_us)))


def is_source_lost(flight: Flight, now_us: int, settings: Settings) -> bool:
    """Whether the source of setpoints has been silent for too long; a circle needs none, and a target is
    waited for."""
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
