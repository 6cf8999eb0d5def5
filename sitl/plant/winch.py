"""The winch: the length of the cable, from the commanded rate of the drum.

The rate reaches the commanded one within a tick, or as fast as GREATEST_ACCEL allows; within a tick the
length is a polynomial of degree two in time. The pull of the cable has no effect on the drum.
"""

from __future__ import annotations

from math import isnan, sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import with_field
from sitl.plant.records import Truth

GREATEST_RATE = 2.0  # m/s
GREATEST_ACCEL = 5.0  # m/s^2
SHORTEST = 0.05  # m, at which the drum stops
_STANDS = 1e-9  # m/s, a smaller rate is only rounding


@kernel
def reeling(truth: Truth, wanted_rate: float, tick_s: float) -> Truth:
    """The truth of a tick in which the drum approaches `wanted_rate` (m/s, positive: out; NaN: it stops)."""
    if isnan(wanted_rate):
        wanted_rate = 0.0
    # inwards no faster than the drum can stop before the cable is shortest
    left = max(truth.cable_length - SHORTEST, 0.0)
    fastest_in = min(GREATEST_RATE, sqrt(GREATEST_ACCEL * left))
    wanted_rate = min(GREATEST_RATE, max(-fastest_in, wanted_rate))
    rate = truth.reel_rate
    if wanted_rate == 0.0 and abs(rate) < _STANDS:
        return with_field(with_field(truth, "reel_rate", 0.0), "reel_accel", 0.0)
    accel = min(GREATEST_ACCEL, max(-GREATEST_ACCEL, (wanted_rate - rate) / tick_s))
    return with_field(truth, "reel_accel", accel)


@kernel
def later(truth: Truth, h: float) -> Truth:
    """The truth h seconds later, within the tick."""
    rate, accel = truth.reel_rate, truth.reel_accel
    if rate == 0.0 and accel == 0.0:
        return truth
    longer = with_field(truth, "cable_length", truth.cable_length + h * (rate + 0.5 * h * accel))
    return with_field(longer, "reel_rate", rate + h * accel)
