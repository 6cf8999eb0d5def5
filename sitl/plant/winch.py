"""The winch: the length of the cable, from the commanded rate of the drum.

The rate reaches the commanded one within a tick, or as fast as MAX_ACCEL allows; within a tick the
length is a polynomial of degree two in time. The pull of the cable has no effect on the drum.
"""

from __future__ import annotations

from math import isnan, sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import with_field
from sitl.plant.records import Truth

MAX_RATE = 2.0  # m/s
MAX_ACCEL = 5.0  # m/s^2
MIN_LENGTH = 0.05  # m, at which the drum stops
_STOPPED_RATE = 1e-9  # m/s, a smaller rate is only rounding


@kernel
def with_commanded_rate(truth: Truth, commanded_rate: float, tick_s: float) -> Truth:
    """The truth of a tick in which the drum approaches this rate (m/s, positive: out; NaN: it stops)."""
    if isnan(commanded_rate):
        commanded_rate = 0.0
    # inwards no faster than the drum can stop before the cable is shortest
    remaining = max(truth.cable_length - MIN_LENGTH, 0.0)
    max_rate_in = min(MAX_RATE, sqrt(MAX_ACCEL * remaining))
    commanded_rate = min(MAX_RATE, max(-max_rate_in, commanded_rate))
    rate = truth.reel_rate
    if commanded_rate == 0.0 and abs(rate) < _STOPPED_RATE:
        return with_field(with_field(truth, "reel_rate", 0.0), "reel_accel", 0.0)
    accel = min(MAX_ACCEL, max(-MAX_ACCEL, (commanded_rate - rate) / tick_s))
    return with_field(truth, "reel_accel", accel)


@kernel
def truth_after(truth: Truth, h: float) -> Truth:
    """The truth h seconds later, within the tick."""
    rate, accel = truth.reel_rate, truth.reel_accel
    if rate == 0.0 and accel == 0.0:
        return truth
    lengthened = with_field(truth, "cable_length", truth.cable_length + h * (rate + 0.5 * h * accel))
    return with_field(lengthened, "reel_rate", rate + h * accel)
