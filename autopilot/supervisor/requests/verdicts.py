"""Verdicts on requests, and what every handler returns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from autopilot.services.records import Verdict
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, Phase, View
from autopilot.wire.dialect import plumbline as mavlink

ACCEPTED = Verdict(mavlink.MAV_RESULT_ACCEPTED)
Decision = tuple[Flight, Verdict]  # the flight after the request
_PHASE_TEXTS = {
    Phase.DISARMED: "disarmed",
    Phase.ARMED: "on the ground",
    Phase.TAUTEN: "the cable is tautened",
    Phase.LIFT: "the load is lifted",
    Phase.HOLD: "holding",
    Phase.MISSION: "flying a mission",
    Phase.RETURN: "returning",
    Phase.LOWER: "the load is lowered",
    Phase.SET_DOWN: "the load is set down",
    Phase.FAILSAFE: "in failsafe",
    Phase.GUIDED: "guided",
}
Handler = Callable[[Flight, Any, View, Settings], Decision]


def denied(text: str) -> Verdict:
    """The request is refused."""
    return Verdict(mavlink.MAV_RESULT_DENIED, text)


def temporarily_denied(text: str) -> Verdict:
    """The request is refused for now."""
    return Verdict(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, text)


def wrong_phase(flight: Flight, request_name: str, reason: str = "") -> Verdict:
    """The request is refused because it cannot be carried out in the present phase."""
    text = f"{request_name} denied while {_PHASE_TEXTS[flight.phase]}"
    if flight.phase == Phase.TAUTEN and not reason:
        reason = "land, or wait until the load is lifted"
    return temporarily_denied(f"{text}: {reason}" if reason else text)
