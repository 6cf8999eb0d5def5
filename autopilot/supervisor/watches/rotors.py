"""Rotors that are lost: the vehicle lands on the others, as far as these can fly it."""

from __future__ import annotations

from dataclasses import replace

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    IN_AIR,
    Event,
    Flight,
    Phase,
    View,
    can_fly,
    interrupt_mission,
    is_landing,
    lost_rotors_text,
)
from autopilot.supervisor.watches.watch_result import WatchResult
from autopilot.wire.dialect.plumbline import MAV_SEVERITY_EMERGENCY, MAV_SEVERITY_ERROR


def watch_rotors(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Note the rotors that are lost, and land; while disarmed nothing is known about the rotors."""
    if flight.phase == Phase.DISARMED:
        return WatchResult(flight)
    lost = flight.rotors_lost | view.rotors_lost
    if lost == flight.rotors_lost:
        return WatchResult(flight)
    flight = replace(flight, rotors_lost=lost)
    lands = flight.phase in IN_AIR and not is_landing(flight)
    text = f"Failsafe: {lost_rotors_text(flight.rotors_lost)} lost"
    if not can_fly(flight, settings):
        severity = MAV_SEVERITY_EMERGENCY
        text += ", the others cannot fly it"
        flight = replace(flight, is_failsafe=True)
    else:
        severity = MAV_SEVERITY_ERROR
        if not settings.rotors.can_hold_heading_without(lost):
            text += ", heading given up"
        if lands:
            text += ", landing"
    if not lands:
        return WatchResult(flight, None, ((severity, text),))
    return WatchResult(interrupt_mission(flight), Event.LAND, ((severity, text),))
