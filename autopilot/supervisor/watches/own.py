"""A custom control law or estimator that has failed: the built-in one, which has taken over, lands the
vehicle."""

from __future__ import annotations

from dataclasses import replace

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import CRITICAL, IN_AIR, LANDING, Event, Flight, View, off_mission
from autopilot.supervisor.watches.watched import Watched


def watch_law(flight: Flight, view: View, settings: Settings) -> Watched:
    """Land after the custom law has failed."""
    return _watch(flight, "law", view.law_fault, "landing by law plumbline")


def watch_estimator(flight: Flight, view: View, settings: Settings) -> Watched:
    """Land after the custom estimator has failed."""
    return _watch(flight, "estimator", view.estimator_fault, "landing by the built-in filter")


def _watch(flight: Flight, source: str, fault: str, instead: str) -> Watched:
    """Land, report why, and do not arm again; `source` is the key of the hindrance."""
    if not fault or source in flight.hindrances:
        return Watched(flight)
    flight = replace(flight, hindrances={**flight.hindrances, source: (fault,)})
    if flight.phase not in IN_AIR:
        return Watched(flight, None, ((CRITICAL, fault),))
    texts = ((CRITICAL, f"{fault}; {instead}"),)
    if flight.phase in LANDING:
        return Watched(flight, None, texts)
    return Watched(off_mission(flight), Event.LAND, texts)
