"""Disarming by time: of an armed vehicle that does not take off, and of a vehicle after a failsafe."""

from __future__ import annotations

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import INFO, WARNING, ActionWhenArmed, Event, Flight, Phase, View
from autopilot.supervisor.watches.watch_result import WatchResult

IDLE_DISARM_US = 10_000_000
FAILSAFE_DISARM_US = 3_000_000


def watch_idle(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Disarm an armed vehicle that does not take off, and any vehicle some time after a failsafe. A mission
    that waits for its paths may take as long as these take."""
    lasted_us = view.now_us - flight.phase_start_us
    if flight.phase == Phase.ARMED and not flight.mission.waiting and lasted_us > IDLE_DISARM_US:
        is_offboard = flight.action_when_armed == ActionWhenArmed.OFFBOARD
        missing = "setpoint (position or velocity) above the ground" if is_offboard else "take-off"
        return WatchResult(flight, Event.DISARM, ((INFO, f"Disarmed: no {missing} for 10 s"),))
    if flight.phase == Phase.FAILSAFE and lasted_us > FAILSAFE_DISARM_US:
        return WatchResult(flight, Event.DISARM, ((WARNING, "Disarmed after termination"),))
    return WatchResult(flight)
