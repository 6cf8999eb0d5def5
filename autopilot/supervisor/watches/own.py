"""A custom control law or estimator that has failed: the built-in one, which has taken over, lands the
vehicle."""

from __future__ import annotations

from dataclasses import replace

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import CRITICAL, IN_AIR, Event, Flight, View, interrupt_mission, is_landing
from autopilot.supervisor.watches.watch_result import WatchResult


def watch_law(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Land after the custom law has failed."""
    return _watch(flight, "law", view.law_fault, "landing by law plumbline")


def watch_estimator(flight: Flight, view: View, settings: Settings) -> WatchResult:
    """Land after the custom estimator has failed."""
    return _watch(flight, "estimator", view.estimator_fault, "landing by the built-in filter")


def _watch(flight: Flight, source: str, fault: str, instead: str) -> WatchResult:
    """Land, report why, and do not arm again; `source` is the key of the arming problem."""
    if not fault or source in flight.external_arming_problems:
        return WatchResult(flight)
    flight = replace(flight, external_arming_problems={**flight.external_arming_problems, source: (fault,)})
    if flight.phase not in IN_AIR:
        return WatchResult(flight, None, ((CRITICAL, fault),))
    texts = ((CRITICAL, f"{fault}; {instead}"),)
    if is_landing(flight):
        return WatchResult(flight, None, texts)
    return WatchResult(interrupt_mission(flight), Event.LAND, texts)
