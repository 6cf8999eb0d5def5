"""Reports of a service that fails: the vehicle continues to fly, and the requesting client gets an answer."""

from __future__ import annotations

import sys
import traceback
from typing import Any

from autopilot.services.records import Output, Peer, SendText, ServiceFailed
from autopilot.services.refusals import refusals
from autopilot.wire.dialect import plumbline as mavlink

REPORT_INTERVAL_US = 10_000_000  # between two reports on one service


class FaultReporter:
    """Reports each service that fails, but at most once in `REPORT_INTERVAL_US`."""

    def __init__(self) -> None:
        self._reported_us: dict[str, int] = {}

    def report(self, what: str, now_us: int) -> list[Output]:
        """The report on the exception that is being handled; empty if it was reported recently."""
        last = self._reported_us.get(what)
        if last is not None and now_us - last < REPORT_INTERVAL_US:
            return []
        self._reported_us[what] = now_us
        kind = sys.exc_info()[0]
        name = kind.__name__ if kind is not None else "?"
        text = f"Internal error in {what}: {name}; the flight continues"
        return [SendText(mavlink.MAV_SEVERITY_ERROR, text), ServiceFailed(what, traceback.format_exc())]

    def report_and_refuse(self, message: Any, peer: Peer, now_us: int) -> list[Output]:
        """The report, and the refusal for which the client waits: nothing was done."""
        refused = refusals(message, peer, mavlink.MAV_RESULT_FAILED, mavlink.MAV_MISSION_ERROR)
        return [*self.report(message.get_type(), now_us), *refused]
