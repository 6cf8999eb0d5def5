"""Verdicts on requests, and what every handler returns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from autopilot.services.records import Verdict
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, View
from autopilot.wire.dialect import plumbline as mavlink

ACCEPTED = Verdict(mavlink.MAV_RESULT_ACCEPTED)
Decision = tuple[Flight, Verdict]  # the flight after the request
Handler = Callable[[Flight, Any, View, Settings], Decision]


def denied(text: str) -> Verdict:
    """The request is refused."""
    return Verdict(mavlink.MAV_RESULT_DENIED, text)


def later(text: str) -> Verdict:
    """The request is refused for now."""
    return Verdict(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, text)


def wrong_phase(flight: Flight, what: str) -> Verdict:
    """The request cannot be followed in the present phase."""
    phase = flight.phase.name.lower().replace("_", " ")
    return later(f"{what} denied while {phase}")
