"""Heading: where the nose points, and how it turns to the requested heading.

The heading is an angle from east to north, rad, that continues to count beyond half a turn. It is led to the
requested heading within limits of rate and acceleration, and its acceleration follows with a lag, so that
angle, rate and acceleration never jump:

    rate asked = along + s(distance)
    accel asked = K_V (rate asked - rate)
    accel' = W (accel asked - accel)

where s is K_P distance near the aim, and far from it the rate from which the heading can still be braked.
Where the heading rests at its aim, all of this is zero and nothing is to be decided.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, copysign, cos, exp, hypot, inf, nan, pi, remainder, sin, sqrt

from autopilot.control.records import HeadingReference
from autopilot.geometry.linear import E1, ZERO, Mat3, Vec3

K_P = 2.0  # 1/s, requested rate per radian of distance from the aim
K_V = 4.0 * K_P  # 1/s, critically damped with K_P
LAG_RATE = 25.0  # rad/s, of the acceleration
BRAKE_SHARE = 0.7  # of the acceleration, with which braking is planned
LONGEST_STEP_S = 0.1  # longest time that passes in one step, whatever the clock says
ARRIVED = 1e-5  # rad, rad/s and rad/s^2
NEAREST_M = 0.5  # distance from a place below which the nose is no longer turned to it

EAST_NOSE = HeadingReference(E1, ZERO, ZERO)


@dataclass(frozen=True, slots=True)
class HeadingLimits:
    """How fast the nose is turned."""

    rate: float  # rad/s, towards an angle
    fastest: float  # rad/s, for a requested rate
    accel: float  # rad/s^2


@dataclass(frozen=True, slots=True)
class Towards:
    """Point to an angle (rad), which moves at `along` (rad/s) from `since_us` on."""

    angle: float
    along: float = 0.0
    since_us: int = 0
    rate: float = inf  # rad/s, at most


@dataclass(frozen=True, slots=True)
class Spin:
    """Turn continuously at a rate, rad/s, counter-clockwise seen from above."""

    rate: float


@dataclass(frozen=True, slots=True)
class Gaze:
    """Point to a place, ENU, as long as it is not close by."""

    place: Vec3


Aim = Towards | Spin | Gaze
EAST = Towards(0.0)


@dataclass(frozen=True, slots=True)
class Heading:
    """Angle with two derivatives at an instant, and the aim."""

    angle: float = 0.0  # rad, from east to north
    rate: float = 0.0  # rad/s
    accel: float = 0.0  # rad/s^2
    at_us: int = 0
    aim: Aim = EAST

    @property
    def rests(self) -> bool:
        """Whether the heading stays as it is until another aim is requested."""
        aim = self.aim
        still = self.rate == 0.0 and self.accel == 0.0
        return still and isinstance(aim, Towards) and aim.along == 0.0 and aim.angle == self.angle

    def nose(self, ahead_s: float) -> HeadingReference:
        """b_1d with two derivatives, `ahead_s` seconds after this instant."""
        rate, accel = self.rate + ahead_s * self.accel, self.accel
        angle = self.angle + ahead_s * (self.rate + 0.5 * ahead_s * accel)
        c, s = cos(angle), sin(angle)
        if rate == 0.0 and accel == 0.0:
            return HeadingReference((c, s, 0.0), ZERO, ZERO)
        square = rate * rate
        bend = (-accel * s - square * c, accel * c - square * s, 0.0)
        return HeadingReference((c, s, 0.0), (-rate * s, rate * c, 0.0), bend)

    def asked(self, aim: Aim, now_us: int) -> Heading:
        """The same heading with another aim."""
        if aim == self.aim:
            return self
        return replace(self, aim=aim, at_us=now_us if self.rests else self.at_us)

    def stopped(self, now_us: int, limits: HeadingLimits) -> Heading:
        """The heading that comes to rest where it can be stopped."""
        return self.asked(Towards(self.stop_angle(limits)), now_us)

    def stop_angle(self, limits: HeadingLimits) -> float:
        """Where the heading can be brought to rest, rad."""
        if self.rate == 0.0:
            return self.angle
        return self.angle + self.rate / K_P + copysign(_braking(abs(self.rate), limits.accel), self.rate)

    def at_rest(self) -> Heading:
        """The present heading at rest, for a vehicle that stands."""
        return Heading(self.angle, aim=Towards(self.angle))

    def onward(self, now_us: int, place: Vec3, velocity: Vec3, limits: HeadingLimits) -> Heading:
        """The heading at `now_us`, of a vehicle that is at `place` (m) with a velocity (m/s), ENU."""
        dt = min((now_us - self.at_us) * 1e-6, LONGEST_STEP_S)
        if self.rests or dt <= 0.0:
            return self
        rate, accel = self._asked_rate(place, velocity, limits), self.accel
        wanted = _within(K_V * (rate - self.rate), limits.accel)
        accel = wanted + (accel - wanted) * exp(-LAG_RATE * dt)
        slope = (accel - self.accel) / dt
        angle = self.angle + dt * (self.rate + dt * (self.accel / 2.0 + dt * slope / 6.0))
        rate = self.rate + dt * (self.accel + dt * slope / 2.0)
        after = Heading(angle, rate, accel, now_us, self.aim)
        return after.at_aim() if after.has_arrived else after

    @property
    def has_arrived(self) -> bool:
        """Whether the heading is at an aim that does not move, apart from rounding."""
        aim = self.aim
        if not isinstance(aim, Towards) or aim.along != 0.0:
            return False
        return max(abs(aim.angle - self.angle), abs(self.rate), abs(self.accel)) < ARRIVED

    def at_aim(self) -> Heading:
        """The heading at rest at its aim."""
        assert isinstance(self.aim, Towards)
        return Heading(self.aim.angle, at_us=self.at_us, aim=self.aim)

    def _asked_rate(self, place: Vec3, velocity: Vec3, limits: HeadingLimits) -> float:
        match self.aim:
            case Spin(rate):
                return _within(rate, limits.fastest)
            case Towards(angle, along, since_us, fastest):
                along = _within(along, limits.fastest)
                distance = angle + along * (self.at_us - since_us) * 1e-6 - self.angle
                return along + _approach(distance, min(fastest, limits.rate), limits.accel)
            case Gaze(there):
                x, y = there[0] - place[0], there[1] - place[1]
                away = hypot(x, y)
                if away < NEAREST_M:
                    return 0.0
                along = _within((y * velocity[0] - x * velocity[1]) / (away * away), limits.fastest)
                return along + _approach(turn(atan2(y, x) - self.angle), limits.rate, limits.accel)


EASTWARD = Heading()


def turn(angle: float) -> float:
    """The same angle within -pi ... pi."""
    return remainder(angle, 2.0 * pi)


def nearest(angle: float, heading: Heading) -> float:
    """The same angle, counted so that it is at most half a turn away from the heading."""
    return heading.angle + turn(angle - heading.angle)


def heading_of(R: Mat3) -> float:
    """Angle from east to north (rad) of the nose, the first column of R; NaN for one that points up or
    down."""
    x, y = R[0][0], R[1][0]
    return nan if x == 0.0 and y == 0.0 else atan2(y, x)


def _within(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def _braking(rate: float, accel: float) -> float:
    """Angle in which a rate is braked, beside K_P's part."""
    return 0.5 * rate * rate / (BRAKE_SHARE * accel)


def _approach(distance: float, limit: float, accel: float) -> float:
    """Rate (rad/s) of approach to an angle at which the heading must come to rest."""
    brake, away = BRAKE_SHARE * accel, abs(distance)
    bend = brake / (K_P * K_P)
    speed = K_P * away if away <= bend else sqrt(2.0 * brake * (away - 0.5 * bend))
    return copysign(min(speed, limit), distance)
