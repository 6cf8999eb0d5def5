"""Whether the machine was fast enough for a flight in real time, judged by the simulator's counters."""

from __future__ import annotations

from pathlib import Path

from autopilot.wire.tlog import read_tlog

MAX_MISSED_SHARE = 1e-3  # share of the commands that may come too late without being reported
_MICRO = 1e-6


def slowness_reason(tlog: Path) -> str:
    """A line on the commands that came too late, if more than one of a thousand did; else empty."""
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
    return (
        f"the machine was too slow: {missed} of some {sent} commands came too late; try without --real-time"
    )
