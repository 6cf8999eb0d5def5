"""Whether the machine was fast enough for a flight in real time, judged by the simulator's counters."""

from __future__ import annotations

import re
from pathlib import Path

from autopilot.wire.tlog import read_tlog

MAX_MISSED_SHARE = 1e-3  # share of the commands that may come too late without being reported
_MICRO = 1e-6
# the vehicle's text when a custom law, estimator or planner was switched off because it takes too long
_SLOW_CLASS = re.compile(r"\b\w+ [\w-]+ failed: \w+ takes .*: too slow")


def slowness_reason(tlog: Path, outcome_reason: str = "", own_parts: str = "") -> str:
    """A line on the commands that came too late, if more than one of a thousand did; else empty.

    It is empty too if `outcome_reason` names custom code that is too slow, which then is the cause, and not
    the machine. `own_parts` names custom code that flew and may share in it.
    """
    if _SLOW_CLASS.search(outcome_reason):
        return ""
    from autopilot.wire.dialect import plumbline as mavlink

    missed, flown_s, rate_hz = 0, 0.0, 0.0  # the rate per second of the vehicle's clock, the highest reported
    for _, received in read_tlog(tlog):
        if received.id == mavlink.MAVLINK_MSG_ID_SIM_STATUS:
            status = received.message
            missed, flown_s = status.missed, status.time_usec * _MICRO
            if status.speed_factor > 0.0:
                rate_hz = max(rate_hz, status.rate_hz / status.speed_factor)
    sent = round(flown_s * rate_hz)
    if not sent or missed <= MAX_MISSED_SHARE * sent:
        return ""
    late = f"{missed} of some {sent} commands came too late; try without --real-time"
    if own_parts:
        return f"the machine was too slow for {own_parts}: {late}"
    return f"the machine was too slow: {late}"
