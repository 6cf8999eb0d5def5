"""Disarming by time: of a vehicle that stands armed without a command, and of a vehicle after a failsafe."""

from __future__ import annotations

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import INFO, WARNING, Event, Flight, Phase, View
from autopilot.supervisor.watches.watch_result import WatchResult

IDLE_DISARM_US = 10_000_000
FAILSAFE_DISARM_US = 3_000_000


def watch_idle(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Disarm an armed vehicle that receives no command, and any vehicle some time after a failsafe. A mission
    that waits for its paths counts as a command, however long these take."""
    lasted_us = view.now_us - flight.phase_start_us
    if flight.phase == Phase.ARMED and not flight.mission.waiting and lasted_us > IDLE_DISARM_US:
        return WatchResult(flight, Event.DISARM, ((INFO, "Disarmed: no command received"),))
    if flight.phase == Phase.FAILSAFE and lasted_us > FAILSAFE_DISARM_US:
        return WatchResult(flight, Event.DISARM, ((WARNING, "Disarmed after termination"),))
    return WatchResult(flight)
