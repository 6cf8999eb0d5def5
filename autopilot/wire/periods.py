"""Times at the multiples of a period, on a clock that counts microseconds."""

from __future__ import annotations

from autopilot.geometry.jitable import jitable


@jitable
def next_multiple(now_us: int, period_us: int) -> int:
    """The first multiple of a period after a time."""
    return now_us - now_us % period_us + period_us
