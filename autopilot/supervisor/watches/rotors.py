"""Rotors that are lost: the vehicle lands on the others if these can keep it level."""

from __future__ import annotations

from dataclasses import replace

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import IN_AIR, Event, Flight, Phase, View, interrupt_mission, is_landing
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
    numbers = [str(i + 1) for i in range(lost.bit_length()) if lost >> i & 1]
    rotor_names = f"rotor{'s' * (len(numbers) > 1)} {', '.join(numbers)}"
    if not settings.rotors.can_fly_without(lost):
        text = f"Failsafe: {rotor_names} lost, the others cannot fly it"
        return WatchResult(replace(flight, is_failsafe=True), None, ((MAV_SEVERITY_EMERGENCY, text),))
    loss_text = rotor_names + " lost"
    if not settings.rotors.can_hold_heading_without(lost):
        loss_text += ", heading given up"
    if flight.phase not in IN_AIR or is_landing(flight):
        return WatchResult(flight, None, ((MAV_SEVERITY_ERROR, f"Failsafe: {loss_text}"),))
    return WatchResult(
        interrupt_mission(flight), Event.LAND, ((MAV_SEVERITY_ERROR, f"Failsafe: {loss_text}, landing"),)
    )
