"""Why a flight was lost, in the vehicle's own texts: what led to the failure, and how it went on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from autopilot.wire.dialect.plumbline import MAV_SEVERITY_CRITICAL, MAV_SEVERITY_WARNING

# followed after the vehicle has reported a failure: how it went on, and for the pictures
AFTERMATH_US = 2_000_000
_BEFORE_US = 5_000_000  # a warning that is older has not led to the failure
_OF_BATTERY = "Battery "  # of an empty battery, the text of the failure says so itself


class TimedText(NamedTuple):
    """A STATUSTEXT at a time of the vehicle's clock."""

    time_us: int
    severity: int
    text: str


def failure_reason(texts: Sequence[TimedText]) -> str:
    """The reason of a flight whose vehicle told these texts in the air; empty if none of them is critical.

    The first of them may be a consequence: an estimate that is not settled after the vehicle has hit the
    ground. The warnings before tell what led to it, and what is critical afterwards how it ended.
    """
    failed_us = next((one.time_us for one in texts if _is_critical(one)), None)
    if failed_us is None:
        return ""
    before_us = failed_us - _BEFORE_US
    told = [one.text for one in texts if _is_critical(one) or _leads_to(one, before_us, failed_us)]
    return "; ".join(dict.fromkeys(told))


def _is_critical(one: TimedText) -> bool:
    return one.severity <= MAV_SEVERITY_CRITICAL


def _leads_to(one: TimedText, before_us: int, failed_us: int) -> bool:
    is_recent_warning = one.severity <= MAV_SEVERITY_WARNING and before_us <= one.time_us <= failed_us
    return is_recent_warning and not one.text.startswith(_OF_BATTERY)
