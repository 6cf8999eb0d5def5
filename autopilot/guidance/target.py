"""A target that moves by itself and that the load accompanies: its motion, and the place beside it.

A target is known by reports of its position, about one a second. If a report has no velocity, the velocity is
that of the reported positions, smoothed, and the acceleration is that of the velocities in the same way. The
place lies at a distance from the target, at an angle from its course: straight behind it, for example. The
course of a target that stands is that of its last motion, and its level velocities are noise of a receiver,
except for their mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, exp, hypot, inf, nan, pi, remainder, sin, tau

from autopilot.geometry.linear import ZERO, Vec3, axpy, sub
from autopilot.guidance.setpoint_follower import PositionSetpoint, smoothed_rate

_FAST = 1.0  # m/s: with more, a single velocity has a direction and a rate of turning that are not noise
_MEAN_S = 3.0  # time constant of the mean velocity of a slower target
# m/s, of the mean velocity: with more a target that stood moves, with less one that moved stands. Noise of
# 0.2 m/s, once a second, is one of 0.08 m/s in the mean
_START_SPEED, _STOP_SPEED = 0.4, 0.3
_MIN_FACING_M = 0.5  # level distance of the place from which the target has a direction


@dataclass(frozen=True, slots=True)
class TargetPlace:
    """Where the load is to be beside a target, and how quickly it follows changes of its motion."""

    height_m: float
    height_over_target: bool  # else over home
    distance_m: float  # level
    angle: float  # rad from the course to the place, clockwise seen from above: 0 ahead, pi behind
    max_turning_m_s: float  # speed at which the place moves round the target at most
    smoothing_s: float  # time constant of a velocity or an acceleration that is not reported


@dataclass(frozen=True, slots=True)
class Target:
    """The motion of a target by its last report; ENU from home."""

    position: Vec3
    velocity: Vec3
    course: float  # rad, from east to north
    at_us: int
    accel: Vec3 = ZERO
    course_rate: float = 0.0  # rad/s
    mean_velocity: Vec3 = ZERO  # that of a fast target is not smoothed
    moves: bool = False

    def reported(
        self, position: Vec3, velocity: Vec3 | None, accel: Vec3 | None, now_us: int, place: TargetPlace
    ) -> Target:
        """The target with another report; None: it is not reported."""
        elapsed_s = (now_us - self.at_us) * 1e-6
        if elapsed_s <= 0.0:
            return self
        share = 1.0 - exp(-elapsed_s / place.smoothing_s)
        if velocity is None:
            velocity = smoothed_rate(self.velocity, sub(position, self.position), elapsed_s, share)
        if accel is None:
            accel = smoothed_rate(self.accel, sub(velocity, self.velocity), elapsed_s, share)
        mean_velocity, moves = self._motion(velocity, 1.0 - exp(-elapsed_s / _MEAN_S))
        # one that has just stopped still has a mean velocity
        has_course = moves and _level_speed(velocity) > _STOP_SPEED
        course = atan2(mean_velocity[1], mean_velocity[0]) if has_course else self.course
        turn = remainder(course - self.course, tau)
        max_turn = place.max_turning_m_s * elapsed_s / place.distance_m if place.distance_m > 0.0 else inf
        turn = max(-max_turn, min(turn, max_turn))
        course_rate = self.course_rate + share * (turn / elapsed_s - self.course_rate)
        return Target(
            position, velocity, self.course + turn, now_us, accel, course_rate, mean_velocity, moves
        )

    def _motion(self, velocity: Vec3, share: float) -> tuple[Vec3, bool]:
        """The mean velocity after another velocity, and whether the target moves."""
        if _level_speed(velocity) > _FAST:
            return velocity, True
        mean_velocity = axpy(share, sub(velocity, self.mean_velocity), self.mean_velocity)
        moves = _level_speed(mean_velocity) > (_STOP_SPEED if self.moves else _START_SPEED)
        return (ZERO if self.moves and not moves else mean_velocity), moves

    def setpoint(self, place: TargetPlace) -> PositionSetpoint:
        """The place beside it, which moves as it does, and the heading from there to it."""
        direction = self.course - place.angle
        x, y, z = self.position
        vx, vy, _ = self.velocity if self.moves else self.mean_velocity
        ax, ay, _ = self.accel if self.moves else ZERO
        height = z + place.height_m if place.height_over_target else place.height_m
        turning = self.course_rate if _level_speed(self.velocity) > _FAST else 0.0
        to_x, to_y = place.distance_m * cos(direction), place.distance_m * sin(direction)
        rises = 1.0 if place.height_over_target else 0.0
        ax, ay = ax - turning**2 * to_x, ay - turning**2 * to_y
        return PositionSetpoint(
            (x + to_x, y + to_y, height),
            (vx - turning * to_y, vy + turning * to_x, rises * self.velocity[2]),
            (ax, ay, rises * self.accel[2]),
            accel_rate=(-turning * ay, turning * ax, 0.0),
            since_us=self.at_us,
            heading=direction + pi if place.distance_m >= _MIN_FACING_M else nan,
        )


def first_report(
    position: Vec3, velocity: Vec3 | None, accel: Vec3 | None, now_us: int, load: Vec3
) -> Target:
    """A target of which nothing was known: if it stands, its course is away from the load."""
    moving = ZERO if velocity is None else velocity
    is_fast = _level_speed(moving) > _FAST
    direction = moving if is_fast else sub(position, load)
    mean_velocity = moving if is_fast else ZERO
    course = atan2(direction[1], direction[0])
    return Target(position, moving, course, now_us, accel or ZERO, 0.0, mean_velocity, is_fast)


def _level_speed(velocity: Vec3) -> float:
    return hypot(velocity[0], velocity[1])
