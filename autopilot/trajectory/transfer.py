"""Carrying the load along a straight line, from rest to rest, smooth enough for four rotors.

The path is p0 + (p1 - p0) s(t / duration) with the polynomial of degree 13 that has s(0) = 0, s(1) = 1 and
its first six derivatives zero at both ends. Its slope is 12012 u^6 (1 - u)^6, where 12012 = 13! / (6! 6!), so

* the peak speed is `PEAK_SPEED` distance / duration, halfway (u = 1/2): 12012 / 2^12 = 3003/1024,
* the peak acceleration is `PEAK_ACCELERATION` distance / duration^2, where (1 - 2u)^2 = 1/11:
  6 * 12012 * (5/22)^5 / sqrt(11).

Over a long way this takes almost three times as long as the peak speed would, and the load creeps at both
ends. All but the shortest ways are therefore flown at constant speed between two ramps
(`autopilot.trajectory.ramp`); lifts and descents only where they are long.
"""

from __future__ import annotations

from math import comb, sqrt
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, axpy, scale, sub
from autopilot.trajectory.ramp import PEAK_RAMP_ACCEL
from autopilot.trajectory.signals import Jet

# Taylor coefficients of s(u): (power, coefficient) of u^7 ... u^13
STEP_TERMS = tuple((7 + k, float(comb(6 + k, k) * comb(13, 6 - k) * (-1) ** k)) for k in range(7))
PEAK_SPEED = 3003.0 / 1024.0
PEAK_ACCELERATION = 72072.0 * (5.0 / 22.0) ** 5 / sqrt(11.0)

# s: a lift that would take longer along the polynomial alone is flown at constant speed in between
CRUISE_AFTER_S = 10.0
_RAMP_SHARE = 1.0 / 3.0  # of the time of the shortest such lift

# of u^13 ... u^7; there are no lower powers
_COEFFICIENTS = tuple(float(comb(6 + k, k) * comb(13, 6 - k) * (-1) ** k) for k in range(6, -1, -1))


@kernel
def transfer(p0: Vec3, p1: Vec3, duration: float, t: float) -> Jet:
    """Position and its derivatives 1 ... 6 at time t (s); at rest in p0 before 0, in p1 after `duration`."""
    if t >= duration:
        return p1, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
    if t <= 0.0:
        return p0, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
    # the second half mirrors the first: s(u) = 1 - s(1 - u). The polynomial itself would lose digits there,
    # because its coefficients reach 24024 and alternate.
    second = t > 0.5 * duration
    u = (duration - t) / duration if second else t / duration
    # Horner's rule for all Taylor coefficients together: s_n = s^(n)(u) / n!
    s0, s1, s2, s3, s4, s5, s6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(14):
        s6 = s6 * u + s5
        s5 = s5 * u + s4
        s4 = s4 * u + s3
        s3 = s3 * u + s2
        s2 = s2 * u + s1
        s1 = s1 * u + s0
        s0 = s0 * u + (_COEFFICIENTS[i] if i < 7 else 0.0)
    path = sub(p1, p0)
    even = -1.0 if second else 1.0
    r = 1.0 / duration
    r2 = r * r
    return (
        axpy(-s0, path, p1) if second else axpy(s0, path, p0),
        scale(s1 * r, path),
        scale(even * 2.0 * s2 * r2, path),
        scale(6.0 * s3 * r2 * r, path),
        scale(even * 24.0 * s4 * r2 * r2, path),
        scale(120.0 * s5 * r2 * r2 * r, path),
        scale(even * 720.0 * s6 * r2 * r2 * r2, path),
    )


class Pace(NamedTuple):
    """How long a way takes from rest to rest, and each of the two ramps at its ends; 0: the polynomial over
    the whole way."""

    duration_s: float
    ramp_s: float = 0.0

    def peak_speed(self, distance: float) -> float:
        """The peak speed (m/s) over a distance (m) that it takes some time to fly."""
        mean = distance / (self.duration_s - self.ramp_s)  # with ramps, this is the constant speed
        return mean if self.ramp_s > 0.0 else PEAK_SPEED * mean

    def stretched(self, duration_s: float) -> Pace:
        """The same in at least so many seconds; no way still takes none."""
        if self.duration_s == 0.0 or duration_s <= self.duration_s:
            return self
        return Pace(duration_s, self.ramp_s * duration_s / self.duration_s)


def reachable_speed(distance: float, speed_max: float, accel_max: float) -> float:
    """The greatest speed (m/s), up to speed_max, to which two ramps over a distance (m) lead with peak
    acceleration <= accel_max (m/s^2): a ramp takes PEAK_RAMP_ACCEL speed / accel_max, at half the speed on
    average."""
    return min(speed_max, sqrt(distance * accel_max / PEAK_RAMP_ACCEL))


def pace(distance: float, speed_max: float, accel_max: float, min_move_s: float = 0.0) -> Pace:
    """The pace over a distance (m) with peak speed <= speed_max (m/s) and peak acceleration <= accel_max
    (m/s^2). No move, and no ramp, takes less than `min_move_s`: a short way that is quicker along the
    polynomial alone is flown along it."""
    if distance == 0.0:
        return Pace(0.0)
    alone = Pace(max(transfer_duration(distance, speed_max, accel_max), min_move_s))
    speed = reachable_speed(distance, speed_max, accel_max)
    ramp = max(PEAK_RAMP_ACCEL * speed / accel_max, min_move_s)
    steady = Pace(ramp + max(distance / speed, ramp), ramp)
    return min(alone, steady)


def lift_pace(distance: float, speed_max: float, accel_max: float, min_move_s: float = 0.0) -> Pace:
    """The same for lifting and lowering, near the ground: along the polynomial alone as long as that takes no
    more than `CRUISE_AFTER_S`, beyond that between ramps as gentle as it.

    The duration grows with the distance: the shortest way that is flown at constant speed takes as long as
    the longest that is not.
    """
    if distance == 0.0:
        return Pace(0.0)
    duration = max(transfer_duration(distance, speed_max, accel_max), min_move_s)
    least_s = max(CRUISE_AFTER_S, min_move_s / _RAMP_SHARE)
    if duration <= least_s:
        return Pace(duration)
    reachable = sqrt(distance * accel_max / PEAK_SPEED)
    speed = min(speed_max, reachable, distance / ((1.0 - _RAMP_SHARE) * least_s))
    ramp = max(PEAK_SPEED * speed / accel_max, min_move_s, least_s - distance / speed)
    return Pace(ramp + distance / speed, ramp)


@kernel
def transfer_duration(distance: float, speed_max: float, accel_max: float) -> float:
    """Shortest duration (s) with peak speed <= speed_max (m/s) and peak acceleration <= accel_max (m/s^2)."""
    return max(PEAK_SPEED * distance / speed_max, sqrt(PEAK_ACCELERATION * distance / accel_max))
