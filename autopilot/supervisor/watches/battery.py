"""The measured battery: what follows when it is low, once for each level (COM_LOW_BAT_ACT, as in PX4)."""

from __future__ import annotations

from dataclasses import replace

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import IN_AIR, Event, Flight, Phase, View, interrupt_mission, is_landing
from autopilot.supervisor.table import TRANSITIONS
from autopilot.supervisor.watches.watch_result import WatchResult
from autopilot.vehicle.low_battery import LAND, REACTIONS, RETURN
from autopilot.wire.dialect import plumbline as mavlink

_CRITICAL = mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL
_EMERGENCY = mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY
_EVENTS = {LAND: Event.LAND, RETURN: Event.RETURN}


def acts_on_charge(settings: Settings) -> bool:
    """Whether anything follows from the charge."""
    return settings.battery.action in REACTIONS


def due_event(flight: Flight, settings: Settings) -> tuple[Event, str] | None:
    """The event that is to follow from the charge, and its verb; None: it has followed, or none does, since
    the flight ends so already."""
    low = flight.low_battery
    if low is None or low.charge_state <= flight.answered_charge_state or flight.phase not in IN_AIR:
        return None
    reaction = REACTIONS.get(settings.battery.action)
    if reaction is None or low.charge_state not in (_CRITICAL, _EMERGENCY) or is_landing(flight):
        return None
    verb = reaction.critical if low.charge_state == _CRITICAL else reaction.emergency
    if (flight.phase, _EVENTS[verb]) not in TRANSITIONS or (verb == RETURN and flight.phase == Phase.RETURN):
        return None
    return _EVENTS[verb], verb


def watch_battery(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Return or land when little is left of the charge. A command that comes later is obeyed."""
    reaction, low = due_event(flight, settings), flight.low_battery
    if reaction is None or low is None:
        return WatchResult(flight)
    flight = replace(flight, answered_charge_state=low.charge_state)
    event, verb = reaction
    level = "empty" if low.charge_state == _EMERGENCY else "nearly empty"
    text = f"Failsafe: battery {level}, {low.percent} % left, {verb}ing"
    return WatchResult(interrupt_mission(flight), event, ((mavlink.MAV_SEVERITY_ERROR, text),))
