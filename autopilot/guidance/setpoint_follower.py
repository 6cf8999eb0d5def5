"""Following requests that may change at any moment: setpoints of a stream, a stick, a circle.

Every request (one that jumps included) passes two filters. The governor moves a point r towards it within
limits of speed and acceleration; the smoother lets the load follow that point with derivatives up to the
sixth that never jump:

    (1 + D/w)^7 x = r,   D = d/dt.

Its response to an impulse is nowhere negative, so the load is no faster and no more accelerated than the
point, and does not overshoot where the point does not. It lags by 7/w; for a target that moves by itself (a
place with a velocity, a circle), the aim is therefore where the target will be by then. While the
acceleration of r is constant,

    x(t) = r - 7 r'/w + 28 r''/w^2 + exp(-w t) sum_k c_k t^k / k!,

with c_k = (D + w)^k of the difference at t = 0: nothing is integrated, and a leg restarted at any time
continues from the jet of the one before.

| symbol   | here     | unit  |
|----------|----------|-------|
| x        | jet      | m     |
| r        | point    | m     |
| w        | rate     | rad/s |
| k_p, k_v | K_P, K_V | 1/s   |
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import atan, ceil, comb, cos, exp, inf, isnan, nan, radians, sin, sqrt

from autopilot.control.records import Jet
from autopilot.geometry import so3
from autopilot.geometry.linear import ZERO, Mat3, Vec3, add, axpy, column, dot, mul, norm, scale, sub
from autopilot.guidance.heading import MAX_STEP_S
from autopilot.wire.dialect import plumbline as mavlink

ORDER = 7  # of the smoother: x and its derivatives 1 ... 6 are continuous
K_P = 1.2  # 1/s, requested speed per metre of distance of the governor's point
K_V = 4.0 * K_P  # 1/s, critically damped with K_P
BRAKE_SHARE = 0.7  # of the acceleration, with which braking is planned: the rest is a reserve
FORWARD_SHARE = 0.5  # of the acceleration, with which the point accelerates as its place does
SMOOTH_SHARE = 3.5  # rate of the smoother over that of the pendulum
SETTLING_PERIODS = 40.0  # periods 1/w of the smoother, after which it has arrived apart from rounding
MAX_LEAN_DEG = 60.0  # greatest lean that is requested of the vehicle
_MIN_UPWARD = cos(radians(MAX_LEAN_DEG))
FLOOR_M = 0.3  # height over home below which no setpoint takes the load

_BINOMIAL = tuple(tuple(float(comb(k, j)) for j in range(k + 1)) for k in range(ORDER))
_OF_INPUT = tuple(float(comb(ORDER, k)) for k in range(ORDER))  # of (1 + D/w)^7, except for the last
_FACTORIAL = (1.0, 1.0, 2.0, 6.0, 24.0, 120.0, 720.0)
MAX_CURVED_S = 1.0  # age of a setpoint after which its velocity no longer changes by its acceleration
ACCEL_SMOOTHING_S = 0.4  # time constant of an acceleration of velocities, and of the rate of accelerations
NEVER_US = 2**62
UNSPECIFIED: Vec3 = (nan, nan, nan)
Point = tuple[Vec3, Vec3, Vec3]  # position, velocity, acceleration


@dataclass(frozen=True, slots=True)
class PositionSetpoint:
    """What a stream requests of the load, ENU from home; NaN: nothing is requested on this axis.

    A position with a velocity moves at that velocity from `since_us` on, and a velocity with an acceleration
    changes by it, and by the rate of it, for `MAX_CURVED_S` at most. On an axis on which only an acceleration
    is requested, nothing holds the load.
    """

    position: Vec3 = UNSPECIFIED
    velocity: Vec3 = UNSPECIFIED
    accel: Vec3 = UNSPECIFIED
    since_us: int = 0
    heading: float = nan  # rad, from east to north
    yaw_rate: float = nan  # rad/s
    accel_rate: Vec3 = ZERO  # m/s^3

    def smoother_input(self, now_us: int, limits: FollowLimits) -> Point:
        """Position, velocity and acceleration that the smoother turns into this motion at `now_us`, without
        what is requested by an acceleration alone. NaN stays NaN in the position."""
        push, j = self._push(limits), self.accel_rate
        x, v = self.position, _limited(_nan_to_zero(self.velocity), limits.max_speed)
        a = sub(push, self.acceleration_only_part(push))
        age_s = max(0.0, (now_us - self.since_us) * 1e-6)
        t = min(age_s, MAX_CURVED_S)
        x = axpy(t * t * t / 6.0, j, axpy(0.5 * t * t, a, axpy(t, v, x)))
        v, a = axpy(0.5 * t * t, j, axpy(t, a, v)), axpy(t, j, a)
        if age_s > MAX_CURVED_S:
            x, a, j = axpy(age_s - t, v, x), ZERO, ZERO
        x, v, a = _input_of((x, v, a, j), limits.rate)
        return x, _limited(v, limits.max_speed), a

    def push_alone(self, limits: FollowLimits) -> Vec3:
        """The acceleration on the axes on which nothing else is requested."""
        return self.acceleration_only_part(self._push(limits))

    def _push(self, limits: FollowLimits) -> Vec3:
        return _limited(_nan_to_zero(self.accel), limits.accel)

    def after(self, before: Setpoint | None, max_accel: float) -> PositionSetpoint:
        """This setpoint as the next of a path: one with position and velocity gets the acceleration of the
        velocities if it has none, and the rate of the accelerations, unless the velocity changes by more than
        on a path within `max_accel` (m/s^2)."""
        if not isinstance(before, PositionSetpoint) or any(map(isnan, self.position)):
            return self
        elapsed_s = (self.since_us - before.since_us) * 1e-6
        change = sub(self.velocity, before.velocity)
        max_change = max_accel * (elapsed_s + ACCEL_SMOOTHING_S)
        if not 0.0 < elapsed_s < MAX_CURVED_S or not norm(change) <= max_change:
            return self
        share = 1.0 - exp(-elapsed_s / ACCEL_SMOOTHING_S)
        a, j = _nan_to_zero(before.accel), before.accel_rate
        if not any(map(isnan, self.accel)):
            rate = smoothed_rate(j, sub(self.accel, a), elapsed_s, share)
            return replace(self, accel_rate=_limited(rate, max_accel / ACCEL_SMOOTHING_S))
        if not all(map(isnan, self.accel)):
            return self
        # smoothing lags by its time constant, for which the rate makes up
        smoothed_before = before.smoothed_accel
        smoothed = smoothed_rate(smoothed_before, change, elapsed_s, share)
        rate = smoothed_rate(j, sub(smoothed, smoothed_before), elapsed_s, share)
        return replace(self, accel=axpy(ACCEL_SMOOTHING_S, rate, smoothed), accel_rate=rate)

    @property
    def smoothed_accel(self) -> Vec3:
        """The acceleration of the velocities of a path, before what makes up for the lag of its smoothing."""
        return axpy(-ACCEL_SMOOTHING_S, self.accel_rate, _nan_to_zero(self.accel))

    @property
    def is_fixed_position(self) -> bool:
        """Whether it requests a place that does not move, and nothing else."""
        moves = any(v != 0.0 and not isnan(v) for v in (*self.velocity, *self.accel, self.yaw_rate))
        return not moves and not all(map(isnan, self.position))

    def acceleration_only_part(self, v: Vec3) -> Vec3:
        """The parts of a vector along the axes on which only an acceleration is requested."""
        x, y, z = (
            v[axis]
            if isnan(self.position[axis]) and isnan(self.velocity[axis]) and not isnan(self.accel[axis])
            else 0.0
            for axis in range(3)
        )
        return (x, y, z)


@dataclass(frozen=True, slots=True)
class Circle:
    """A level circle flown at `rate` (rad/s, positive counter-clockwise seen from above)."""

    centre: Vec3
    radius: float
    rate: float
    start_angle: float  # angle from east at which it begins
    since_us: int
    ramp_s: float  # in which the rate is reached
    ends_us: int = NEVER_US  # when it has been flown

    def smoother_input(self, now_us: int, limits: FollowLimits) -> Point:
        """Position, velocity and acceleration that the smoother turns into the circle."""
        t = max(0.0, (now_us - self.since_us) * 1e-6)
        ramping = t < self.ramp_s
        progress_s = 0.5 * t * t / self.ramp_s if ramping else t - 0.5 * self.ramp_s
        turning = self.rate * (t / self.ramp_s if ramping else 1.0)
        share = turning / limits.rate
        angle = self.start_angle + self.rate * progress_s + ORDER * atan(share)
        radius = self.radius * (1.0 + share * share) ** (0.5 * ORDER)
        x, y = radius * cos(angle), radius * sin(angle)
        along = (-turning * y, turning * x, 0.0)
        return add(self.centre, (x, y, 0.0)), along, (-turning * turning * x, -turning * turning * y, 0.0)


@dataclass(frozen=True, slots=True)
class AttitudeSetpoint:
    """A requested attitude of the vehicle: its thrust axis, ENU, and the thrust in newtons; None: the thrust
    that keeps the height. Or, in place of an attitude, requested body rates."""

    upward: Vec3
    thrust_n: float | None
    heading: float = nan  # rad, from east to north
    yaw_rate: float = nan  # rad/s
    rates: Vec3 | None = None  # rad/s, body

    @property
    def is_too_steep(self) -> bool:
        """Whether the vehicle would lean by more than STEEPEST_DEG."""
        return not self.upward[2] >= _MIN_UPWARD


Setpoint = PositionSetpoint | Circle | AttitudeSetpoint


@dataclass(frozen=True, slots=True)
class FollowLimits:
    """Limits of the governor and the rate of the smoother."""

    approach_speed: float  # m/s, towards a position
    max_speed: float  # m/s, for a requested velocity
    accel: float  # m/s^2
    rate: float  # rad/s


@dataclass(frozen=True, slots=True)
class TrackPosition:
    """The load on its way to the governor's point, which moves at constant acceleration.

    `redirected` is the same motion restarted later; until then each moment of it is known.
    """

    begin: Jet
    point: Point
    rate: float
    duration_s: float = inf
    control_mode: int = mavlink.PLUMBLINE_CONTROL_LOAD_POSITION
    _weights: tuple[tuple[float, ...], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        w = self.rate
        steady = self._steady(0.0)
        axes = []
        for axis in range(3):
            e = [self.begin[n][axis] - (steady[n][axis] if n < 3 else 0.0) for n in range(ORDER)]
            row = [sum(_BINOMIAL[k][j] * w ** (k - j) * e[j] for j in range(k + 1)) for k in range(ORDER)]
            axes.append(tuple(row))
        object.__setattr__(self, "_weights", tuple(axes))

    def _steady(self, t: float) -> Point:
        """r - 7 r'/w + 28 r''/w^2 and its derivatives 1, 2."""
        x, v, a = self.point
        lag = ORDER / self.rate
        bend = 0.5 * ORDER * (ORDER + 1) / (self.rate * self.rate) - lag * t + 0.5 * t * t
        return axpy(bend, a, axpy(t - lag, v, x)), axpy(t - lag, a, v), a

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        t = max(t, 0.0)
        w, fade = self.rate, exp(-self.rate * t)
        p0, p1, p2, p3, p4, p5, p6 = [t**k / _FACTORIAL[k] for k in range(ORDER)]
        steady = self._steady(t)
        columns = []
        for axis in range(3):
            c0, c1, c2, c3, c4, c5, c6 = self._weights[axis]
            column = []
            for n in range(ORDER):
                left = 0.0 + c0 * p0 + c1 * p1 + c2 * p2 + c3 * p3 + c4 * p4 + c5 * p5 + c6 * p6
                column.append(fade * left + (steady[n][axis] if n < 3 else 0.0))
                c0, c1, c2, c3 = c1 - w * c0, c2 - w * c1, c3 - w * c2, c4 - w * c3
                c4, c5, c6 = c5 - w * c4, c6 - w * c5, 0.0 - w * c6
            columns.append(column)
        x, y, z = columns
        rows = [(x[n], y[n], z[n]) for n in range(ORDER)]
        return (rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6])

    def _point_at(self, t: float) -> tuple[Vec3, Vec3]:
        """Position and velocity of the point `t` seconds into this leg."""
        x, v, a = self.point
        return axpy(0.5 * t * t, a, axpy(t, v, x)), axpy(t, a, v)

    def coasting(self, t: float, rate: float) -> TrackPosition:
        """The motion from `t` seconds into this leg on, with its point continuing at its present velocity."""
        return TrackPosition(self.jet(t), (*self._point_at(t), ZERO), rate)

    def remaining(self, t: float) -> TrackPosition:
        """The same motion from `t` seconds into this leg on."""
        point = (*self._point_at(t), self.point[2])
        return TrackPosition(self.jet(t), point, self.rate, _round_to_us(max(self.duration_s - t, 0.0)))

    def stopped(self, t: float, accel: float) -> tuple[tuple[TrackPosition, ...], Vec3]:
        """The legs from `t` seconds into this leg on to rest, and the place of that rest.

        The point slows down at `accel` (m/s^2), and its descent as fast as keeps it above the floor. The legs
        last whole microseconds, as the clock counts, and the last leg lasts until only rounding is left of
        the motion.
        """
        x, v = self._point_at(t)
        level, drop = (v[0], v[1], 0.0), (0.0, 0.0, v[2])
        min_duration_s = norm(v) / accel
        level_s = drop_s = _ceil_to_us(min_duration_s)
        height = max(x[2] - FLOOR_M, 0.0)
        if v[2] < 0.0 and -0.5 * v[2] * min_duration_s > height:
            drop_s = _ceil_to_us(max(2.0 * height, -v[2] / accel * -v[2]) / -v[2])
            lift = -v[2] / drop_s
            level_s = _ceil_to_us(norm(level) / sqrt(max(accel * accel - lift * lift, 0.25 * accel * accel)))
        legs: list[TrackPosition] = []
        jet, gone_s = self.jet(t), 0.0
        for until_s in sorted({level_s, drop_s}):
            push = ZERO
            if gone_s < level_s:
                push = axpy(-1.0 / level_s, level, push)
            if gone_s < drop_s:
                push = axpy(-1.0 / drop_s, drop, push)
            lasts = _round_to_us(until_s - gone_s)
            if lasts <= 0.0:
                continue
            leg = TrackPosition(jet, (x, v, push), self.rate, lasts)
            x, v = axpy(0.5 * lasts * lasts, push, axpy(lasts, v, x)), axpy(lasts, push, v)
            jet, gone_s = leg.jet(lasts), until_s
            legs.append(leg)
        return (
            *legs,
            TrackPosition(jet, (x, ZERO, ZERO), self.rate, _round_to_us(SETTLING_PERIODS / self.rate)),
        ), x

    def redirected(
        self, t: float, setpoint: PositionSetpoint | Circle, limits: FollowLimits, now_us: int
    ) -> TrackPosition:
        """The motion from `t` seconds into this leg on, towards what is requested at `now_us`."""
        point = governor_point(*self._point_at(t), setpoint, limits, now_us)
        return TrackPosition(self.jet(t), point, limits.rate)


def _round_to_us(seconds: float) -> float:
    return round(seconds * 1e6) * 1e-6


def _ceil_to_us(seconds: float) -> float:
    return ceil(seconds * 1e6) * 1e-6


def start_following(jet: Jet, rate: float) -> TrackPosition:
    """A motion that continues from `jet` until something is requested.

    The point is at (1 + D/w)^7 x, as far as the jet determines it. A point that disagreed with the jet in its
    acceleration alone would jerk the load: the smoother answers with ten times as much.
    """
    return TrackPosition(jet, _input_of(jet, rate), rate)


def _input_of(motion: Sequence[Vec3], rate: float) -> Point:
    """(1 + D/w)^7 of a motion and its first two derivatives, as far as the derivatives of the motion that are
    given determine it."""
    point = []
    for n in range(3):
        derivative = ZERO
        for k in range(len(motion) - n):
            derivative = axpy(_OF_INPUT[k] / rate**k, motion[n + k], derivative)
        point.append(derivative)
    return point[0], point[1], point[2]


def smoothed_rate(rate: Vec3, change: Vec3, elapsed_s: float, share: float) -> Vec3:
    """A derivative that was `rate`, after a change of what it is the derivative of: `share` of the way to the
    mean of this time."""
    return axpy(share, sub(scale(1.0 / elapsed_s, change), rate), rate)


def approach_velocity(distance: Vec3, accel: float) -> Vec3:
    """Velocity (m/s) of approach to a point that must be reached at rest: K_P times the distance near it, and
    far from it the velocity that a deceleration of `accel` allows."""
    away = norm(distance)
    bend = accel / (K_P * K_P)
    if away <= bend:
        return scale(K_P, distance)
    return scale(sqrt(2.0 * accel * (away - 0.5 * bend)) / away, distance)


def _limited(v: Vec3, limit: float) -> Vec3:
    size = norm(v)
    return v if size <= limit else scale(limit / size, v)


def _nan_to_zero(v: Vec3) -> Vec3:
    return (0.0 if isnan(v[0]) else v[0], 0.0 if isnan(v[1]) else v[1], 0.0 if isnan(v[2]) else v[2])


def governor_point(
    x: Vec3, v: Vec3, setpoint: PositionSetpoint | Circle, limits: FollowLimits, now_us: int
) -> Point:
    """The governor's point: its position, its velocity, and its acceleration from now on."""
    aim, along, push = setpoint.smoother_input(now_us, limits)
    # on an axis without a requested position, the distance is zero
    distance = _nan_to_zero(sub(aim, x))
    if aim[2] < FLOOR_M:
        distance = (distance[0], distance[1], FLOOR_M - x[2])
        along = (along[0], along[1], max(along[2], 0.0))
    coasting = ZERO
    if isinstance(setpoint, PositionSetpoint):
        # the velocity to which an acceleration alone leads in the time in which velocities are reached
        reached = axpy(1.0 / K_V, setpoint.push_alone(limits), v)
        coasting = _limited(setpoint.acceleration_only_part(reached), limits.max_speed)
    # as the place accelerates; what is left of the acceleration brings the point to it, however it moves
    push = _limited(push, FORWARD_SHARE * limits.accel)
    accel_left = limits.accel - norm(push)
    # a velocity that leads away from the place is overcome
    away_speed = max(-dot(along, distance) / max(norm(distance), 1e-9), 0.0)
    approach = _limited(
        approach_velocity(distance, BRAKE_SHARE * accel_left), limits.approach_speed + away_speed
    )
    velocity_command = add(add(along, coasting), approach)
    # descend no faster than can be stopped at the floor
    height = max(x[2] - FLOOR_M, 0.0)
    min_velocity_z = -norm(approach_velocity((0.0, 0.0, height), BRAKE_SHARE * limits.accel))
    near_floor = min(velocity_command[2], v[2]) < min_velocity_z
    velocity_command = (velocity_command[0], velocity_command[1], max(velocity_command[2], min_velocity_z))
    correction = scale(K_V, sub(velocity_command, v))
    accel = add(push, _limited(correction, accel_left))
    if not near_floor:
        return x, v, accel
    # braking above the floor comes first, the remaining acceleration is for the rest
    lift = max(-limits.accel, min(push[2] + correction[2], limits.accel))
    level = _limited((accel[0], accel[1], 0.0), sqrt(limits.accel * limits.accel - lift * lift))
    return x, v, (level[0], level[1], lift)


@dataclass(frozen=True, slots=True)
class TrackAttitude:
    """The vehicle follows an attitude setpoint; the position of the load is uncontrolled.

    Where body rates are requested, `attitude` is the attitude that turns at these rates, as it is at `at_us`.
    """

    setpoint: AttitudeSetpoint
    anchor: Vec3
    attitude: Mat3 | None = None
    at_us: int = 0
    duration_s: float = inf
    control_mode: int = mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE

    def jet(self, t: float) -> Jet:
        """The anchor at rest: its height is kept where no thrust is requested."""
        return (self.anchor, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO)

    def upward(self, t: float) -> Vec3:
        """Unit vector, ENU: the requested thrust axis."""
        return self.setpoint.upward if self.attitude is None else column(self.attitude, 2)

    def updated(self, setpoint: AttitudeSetpoint, measured: Mat3, now_us: int) -> TrackAttitude:
        """The leg with what is requested at `now_us`, of a vehicle whose attitude is `measured`. Rates do not
        lean the vehicle further than a setpoint may."""
        if setpoint.rates is None:
            return replace(self, setpoint=setpoint, attitude=None)
        if self.attitude is None:
            return replace(self, setpoint=setpoint, attitude=measured, at_us=now_us)
        elapsed_s = min((now_us - self.at_us) * 1e-6, MAX_STEP_S)
        turned = mul(self.attitude, so3.exp(scale(elapsed_s, setpoint.rates)))
        leaning = turned[2][2] < min(_MIN_UPWARD, self.attitude[2][2])
        return replace(self, setpoint=setpoint, attitude=self.attitude if leaning else turned, at_us=now_us)


@dataclass(frozen=True, slots=True)
class SetpointStream:
    """The last request of one source, and its time."""

    setpoint: Setpoint | None = None
    at_us: int = -1

    def is_fresh(self, now_us: int, within_us: int) -> bool:
        """Whether a request arrived within that time."""
        return self.at_us >= 0 and now_us - self.at_us <= within_us


NO_STREAM = SetpointStream()
