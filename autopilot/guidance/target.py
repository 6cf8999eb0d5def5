"""A target that moves by itself and that the load accompanies: its motion, and the place beside it.

A target is known by reports of its position, about one a second. If a report has no velocity, the velocity is
that of the reported positions, smoothed, and the acceleration is that of the velocities in the same way. The
place lies at a distance from the target, at an angle from its course: straight behind it, for example. The
course of a target that stands is that of its last motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, exp, hypot, inf, isfinite, nan, pi, remainder, sin, tau

from autopilot.geometry.linear import ZERO, Vec3, sub
from autopilot.guidance.setpoint_follower import PositionSetpoint, smoothed_rate

# m/s: with less, the direction of the estimated velocity is noise
_MIN_COURSE_SPEED = 0.3
_MIN_TURNING_SPEED = 1.0  # m/s: with less, the rate of its turning is noise
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
        turn = remainder(_course(velocity, self.course) - self.course, tau)
        max_turn = place.max_turning_m_s * elapsed_s / place.distance_m if place.distance_m > 0.0 else inf
        turn = max(-max_turn, min(turn, max_turn))
        course_rate = self.course_rate + share * (turn / elapsed_s - self.course_rate)
        return Target(position, velocity, self.course + turn, now_us, accel, course_rate)

    def setpoint(self, place: TargetPlace) -> PositionSetpoint:
        """The place beside it, which moves as it does, and the heading from there to it."""
        direction = self.course - place.angle
        x, y, z = self.position
        vx, vy, vz = self.velocity
        ax, ay, az = self.accel
        height = z + place.height_m if place.height_over_target else place.height_m
        turning = self.course_rate if hypot(vx, vy) > _MIN_TURNING_SPEED else 0.0
        to_x, to_y = place.distance_m * cos(direction), place.distance_m * sin(direction)
        rises = 1.0 if place.height_over_target else 0.0
        ax, ay = ax - turning**2 * to_x, ay - turning**2 * to_y
        return PositionSetpoint(
            (x + to_x, y + to_y, height),
            (vx - turning * to_y, vy + turning * to_x, rises * vz),
            (ax, ay, rises * az),
            accel_rate=(-turning * ay, turning * ax, 0.0),
            since_us=self.at_us,
            heading=direction + pi if place.distance_m >= _MIN_FACING_M else nan,
        )


def first_report(
    position: Vec3, velocity: Vec3 | None, accel: Vec3 | None, now_us: int, load: Vec3
) -> Target:
    """A target of which nothing was known: if it stands, its course is away from the load."""
    away = sub(position, load)
    moving = ZERO if velocity is None else velocity
    return Target(position, moving, _course(moving, atan2(away[1], away[0])), now_us, accel or ZERO)


def _course(velocity: Vec3, otherwise: float) -> float:
    """The direction of a velocity (rad, from east to north), if it has one."""
    speed = hypot(velocity[0], velocity[1])
    return atan2(velocity[1], velocity[0]) if isfinite(speed) and speed > _MIN_COURSE_SPEED else otherwise
