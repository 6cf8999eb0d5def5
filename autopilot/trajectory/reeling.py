"""Motions from rest to rest whose rate rises, stays and falls as it rose: of a winch, and along a line."""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, axpy, scale, sub
from autopilot.trajectory.ramp import Growth, ramp
from autopilot.trajectory.signals import Jet
from autopilot.trajectory.transfer import transfer


@kernel
def _growth(ramp_s: float, cruise_s: float, t: float) -> Growth:
    """Growth for a rate of 1, before the end of the motion."""
    left = 2.0 * ramp_s + cruise_s - t
    if t <= ramp_s:
        return ramp(ramp_s, max(t, 0.0))
    if left >= ramp_s:
        return (t - 0.5 * ramp_s, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    back = ramp(ramp_s, left)
    return (ramp_s + cruise_s - back[0], back[1], -back[2], back[3], -back[4], back[5], -back[6])


@kernel
def reel(begin: Vec3, speed: float, ramp_s: float, cruise_s: float, t: float) -> Jet:
    """Position of the load and its derivatives 1 ... 6 at time t (s) while the winch lowers it from `begin`,
    under a vehicle that stays where it is: the rate rises to `speed` (m/s; negative: the load is raised)
    along a ramp of `ramp_s`, stays for `cruise_s`, and falls as it rose."""
    x, y, z = begin
    if 2.0 * ramp_s + cruise_s - t <= 0.0:
        return (x, y, z - speed * (ramp_s + cruise_s)), ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
    w, down = _growth(ramp_s, cruise_s, t), -speed
    return (
        (x, y, z + down * w[0]),
        (0.0, 0.0, down * w[1]),
        (0.0, 0.0, down * w[2]),
        (0.0, 0.0, down * w[3]),
        (0.0, 0.0, down * w[4]),
        (0.0, 0.0, down * w[5]),
        (0.0, 0.0, down * w[6]),
    )


@kernel
def straight_way(begin: Vec3, end: Vec3, duration: float, ramp_s: float, t: float) -> Jet:
    """Position and its derivatives 1 ... 6 at time t (s) along a straight line, from rest to rest: along
    `transfer`, or, with a ramp, at constant speed between two ramps of `ramp_s`."""
    if ramp_s == 0.0 or t >= duration:
        return transfer(begin, end, duration, t)
    velocity = scale(1.0 / (duration - ramp_s), sub(end, begin))
    w = _growth(ramp_s, duration - 2.0 * ramp_s, t)
    return (
        axpy(w[0], velocity, begin),
        scale(w[1], velocity),
        scale(w[2], velocity),
        scale(w[3], velocity),
        scale(w[4], velocity),
        scale(w[5], velocity),
        scale(w[6], velocity),
    )
