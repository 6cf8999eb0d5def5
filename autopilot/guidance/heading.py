"""Heading: where the vehicle points, and how it turns to the commanded heading.

The heading is an angle from east to north, rad, that continues to count beyond half a turn. It is led to the
commanded heading within limits of rate and acceleration, and its acceleration follows with a lag, so that
angle, rate and acceleration never jump:

    commanded rate = along + s(distance)
    commanded accel = K_V (commanded rate - rate)
    accel' = W (commanded accel - accel)

where s is K_P distance near the aim, and far from it the rate from which the heading can still be braked.
Where the heading is at rest at its aim, all of this is zero and nothing is to be decided.
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
MAX_STEP_S = 0.1  # longest time that passes in one step, whatever the clock says
ARRIVAL_TOLERANCE = 1e-5  # rad, rad/s and rad/s^2
MIN_LOOK_DISTANCE_M = 0.5  # distance from a place below which the vehicle is no longer turned to it

EAST_REFERENCE = HeadingReference(E1, ZERO, ZERO)


@dataclass(frozen=True, slots=True)
class HeadingLimits:
    """How fast the heading is turned."""

    approach_rate: float  # rad/s, towards an angle
    max_rate: float  # rad/s, for a requested rate
    accel: float  # rad/s^2


@dataclass(frozen=True, slots=True)
class TurnTo:
    """Point to an angle (rad), which moves at `target_rate` (rad/s) from `since_us` on."""

    angle: float
    target_rate: float = 0.0
    since_us: int = 0
    max_rate: float = inf  # rad/s


@dataclass(frozen=True, slots=True)
class Spin:
    """Turn continuously at a rate, rad/s, counter-clockwise seen from above."""

    rate: float


@dataclass(frozen=True, slots=True)
class FacePoint:
    """Point to a place, ENU, as long as it is not close by."""

    place: Vec3


Aim = TurnTo | Spin | FacePoint
EAST_AIM = TurnTo(0.0)


@dataclass(frozen=True, slots=True)
class Heading:
    """Angle with two derivatives at an instant, and the aim."""

    angle: float = 0.0  # rad, from east to north
    rate: float = 0.0  # rad/s
    accel: float = 0.0  # rad/s^2
    at_us: int = 0
    aim: Aim = EAST_AIM

    @property
    def is_settled(self) -> bool:
        """Whether the heading stays as it is until another aim is commanded."""
        aim = self.aim
        still = self.rate == 0.0 and self.accel == 0.0
        return still and isinstance(aim, TurnTo) and aim.target_rate == 0.0 and aim.angle == self.angle

    def reference(self, ahead_s: float) -> HeadingReference:
        """b_1d with two derivatives, `ahead_s` seconds after this instant."""
        rate, accel = self.rate + ahead_s * self.accel, self.accel
        angle = self.angle + ahead_s * (self.rate + 0.5 * ahead_s * accel)
        c, s = cos(angle), sin(angle)
        if rate == 0.0 and accel == 0.0:
            return HeadingReference((c, s, 0.0), ZERO, ZERO)
        square = rate * rate
        bend = (-accel * s - square * c, accel * c - square * s, 0.0)
        return HeadingReference((c, s, 0.0), (-rate * s, rate * c, 0.0), bend)

    def with_aim(self, aim: Aim, now_us: int) -> Heading:
        """The same heading with another aim."""
        if aim == self.aim:
            return self
        return replace(self, aim=aim, at_us=now_us if self.is_settled else self.at_us)

    def stopped(self, now_us: int, limits: HeadingLimits) -> Heading:
        """The heading that comes to rest where it can be stopped."""
        return self.with_aim(TurnTo(self.stop_angle(limits)), now_us)

    def stop_angle(self, limits: HeadingLimits) -> float:
        """Where the heading can be brought to rest, rad."""
        if self.rate == 0.0:
            return self.angle
        return (
            self.angle + self.rate / K_P + copysign(_braking_angle(abs(self.rate), limits.accel), self.rate)
        )

    def at_rest(self) -> Heading:
        """The present heading at rest, for a vehicle on the ground."""
        return Heading(self.angle, aim=TurnTo(self.angle))

    def advanced(self, now_us: int, place: Vec3, velocity: Vec3, limits: HeadingLimits) -> Heading:
        """The heading at `now_us`, of a vehicle that is at `place` (m) with a velocity (m/s), ENU."""
        dt = min((now_us - self.at_us) * 1e-6, MAX_STEP_S)
        if self.is_settled or dt <= 0.0:
            return self
        rate, accel = self._commanded_rate(place, velocity, limits), self.accel
        commanded = _clamp(K_V * (rate - self.rate), limits.accel)
        accel = commanded + (accel - commanded) * exp(-LAG_RATE * dt)
        slope = (accel - self.accel) / dt
        angle = self.angle + dt * (self.rate + dt * (self.accel / 2.0 + dt * slope / 6.0))
        rate = self.rate + dt * (self.accel + dt * slope / 2.0)
        after = Heading(angle, rate, accel, now_us, self.aim)
        return after.at_aim() if after.has_arrived else after

    @property
    def has_arrived(self) -> bool:
        """Whether the heading is at an aim that does not move, apart from rounding."""
        aim = self.aim
        if not isinstance(aim, TurnTo) or aim.target_rate != 0.0:
            return False
        return max(abs(aim.angle - self.angle), abs(self.rate), abs(self.accel)) < ARRIVAL_TOLERANCE

    def at_aim(self) -> Heading:
        """The heading at rest at its aim."""
        assert isinstance(self.aim, TurnTo)
        return Heading(self.aim.angle, at_us=self.at_us, aim=self.aim)

    def _commanded_rate(self, place: Vec3, velocity: Vec3, limits: HeadingLimits) -> float:
        match self.aim:
            case Spin(rate):
                return _clamp(rate, limits.max_rate)
            case TurnTo(angle, along, since_us, max_rate):
                along = _clamp(along, limits.max_rate)
                distance = angle + along * (self.at_us - since_us) * 1e-6 - self.angle
                return along + _approach_rate(distance, min(max_rate, limits.approach_rate), limits.accel)
            case FacePoint(there):
                x, y = there[0] - place[0], there[1] - place[1]
                away = hypot(x, y)
                if away < MIN_LOOK_DISTANCE_M:
                    return 0.0
                along = _clamp((y * velocity[0] - x * velocity[1]) / (away * away), limits.max_rate)
                return along + _approach_rate(
                    wrap_pi(atan2(y, x) - self.angle), limits.approach_rate, limits.accel
                )


HEADING_EAST = Heading()


def wrap_pi(angle: float) -> float:
    """The same angle within -pi ... pi."""
    return remainder(angle, 2.0 * pi)


def unwrap_near(angle: float, heading: Heading) -> float:
    """The same angle, counted so that it is at most half a turn away from the heading."""
    return heading.angle + wrap_pi(angle - heading.angle)


def heading_of(R: Mat3) -> float:
    """Angle from east to north (rad) of the body's x axis, the first column of R; NaN for one that points
    up or down."""
    x, y = R[0][0], R[1][0]
    return nan if x == 0.0 and y == 0.0 else atan2(y, x)


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def _braking_angle(rate: float, accel: float) -> float:
    """Angle in which a rate is braked, beside K_P's part."""
    return 0.5 * rate * rate / (BRAKE_SHARE * accel)


def _approach_rate(distance: float, limit: float, accel: float) -> float:
    """Rate (rad/s) of approach to an angle at which the heading must come to rest."""
    brake, away = BRAKE_SHARE * accel, abs(distance)
    bend = brake / (K_P * K_P)
    speed = K_P * away if away <= bend else sqrt(2.0 * brake * (away - 0.5 * bend))
    return copysign(min(speed, limit), distance)
