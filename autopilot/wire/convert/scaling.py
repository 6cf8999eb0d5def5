"""Numbers on the wire: the unit of accelerations, and integers, rounded and saturated at the ends of the
field's range; nothing is ever raised."""

from __future__ import annotations

import math

from autopilot.geometry.jitable import jitable

STANDARD_GRAVITY = 9.80665  # m/s^2: accelerations are sent in thousandths of it, weights in kg


@jitable
def saturated(value: float, low: int, high: int) -> int:
    """The integer nearest to `value` within `low` ... `high`; 0, or the limit nearest to it, for NaN."""
    if value >= high:
        return high
    if value <= low:
        return low
    if math.isnan(value):
        return min(max(0, low), high)
    return round(value)


@jitable
def int16(value: float) -> int:
    """`value` in an int16_t."""
    return saturated(value, -0x8000, 0x7FFF)


@jitable
def uint16(value: float) -> int:
    """`value` in a uint16_t."""
    return saturated(value, 0, 0xFFFF)


@jitable
def int32(value: float) -> int:
    """`value` in an int32_t."""
    return saturated(value, -0x8000_0000, 0x7FFF_FFFF)


@jitable
def course_cdeg(north: float, east: float) -> int:
    """Course over ground in 0 ... 35999 hundredths of a degree; 65535 (unknown) below 0.1 m/s."""
    speed = math.hypot(north, east)
    if not 0.1 <= speed < math.inf:
        return 0xFFFF
    return round(math.degrees(math.atan2(east, north)) * 100.0) % 36000
