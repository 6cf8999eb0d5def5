"""The quadrotor as third-party firmwares define it: which rotor each of their motors drives, how the flight
controller is mounted, and which force a rotor gives at a throttle of its motor.

ArduPilot and PX4 number the motors of an X in the same way: 1 front right, 2 rear left, both
counterclockwise; 3 front left, 4 rear right, both clockwise. A vehicle whose arms form a plus is an X for a
flight controller that is mounted turned by half a right angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, pi, sin
from typing import NamedTuple

from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat, quat_multiply
from autopilot.vehicle.layout import Layout

# angle from forward to the left, and the sign of the moment about the upward axis, of motors 1 to 4
_MOTORS = ((-0.25 * pi, -1.0), (0.75 * pi, -1.0), (0.25 * pi, 1.0), (-0.75 * pi, 1.0))
_MOUNTING_YAWS = (0.0, 0.25 * pi)  # of the flight controller to the left
_ANGLE_TOLERANCE = 0.15 * pi  # from the direction of a motor, within which a rotor is taken as its rotor
_ARM_TOLERANCE = 0.1  # share of the arm by which the distances of the rotors may differ
# share of the thrust that grows with the square of the throttle, for propellers with common speed controllers
THRUST_EXPO = 0.65


class FrameError(ValueError):
    """Third-party firmwares cannot fly the vehicle; the text says why."""


class Frame(NamedTuple):
    """How a firmware's motors and flight controller are placed on a vehicle."""

    rotor_of: tuple[int, ...]  # index of the rotor that each motor drives, in the order of the motors
    max_force_n: tuple[float, ...]  # force of that rotor at full throttle
    min_force_n: float  # force of a rotor at no throttle
    mounting_yaw: float  # rad, of the flight controller to the left of the vehicle's forward axis

    def forces(self, throttles: Sequence[float]) -> tuple[float, ...]:
        """Forces (N) of the rotors, in the vehicle's order, at these throttles of the motors, 0 ... 1."""
        found = [0.0] * len(self.rotor_of)
        for rotor, max_force, throttle in zip(self.rotor_of, self.max_force_n, throttles, strict=True):
            u = min(max(throttle, 0.0), 1.0)
            share = (1.0 - THRUST_EXPO) * u + THRUST_EXPO * u * u
            found[rotor] = self.min_force_n + (max_force - self.min_force_n) * share
        return tuple(found)

    def to_controller_axes(self, v: Vec3) -> Vec3:
        """A vector of the vehicle's axes in those of the flight controller, both FLU."""
        if self.mounting_yaw == 0.0:
            return v
        c, s = cos(self.mounting_yaw), sin(self.mounting_yaw)
        return (c * v[0] + s * v[1], c * v[1] - s * v[0], v[2])

    def attitude(self, quat_wxyz: Quat) -> Quat:
        """The flight controller's attitude, given the vehicle's."""
        if self.mounting_yaw == 0.0:
            return quat_wxyz
        half: Quat = (cos(0.5 * self.mounting_yaw), 0.0, 0.0, sin(0.5 * self.mounting_yaw))
        return quat_multiply(quat_wxyz, half)


def frame_of(layout: Layout, min_force_n: float, max_force_n: float) -> Frame:
    """The frame of a vehicle whose rotors give these forces; FrameError if it is not an X."""
    if not 0.0 <= min_force_n < max_force_n < inf:
        raise FrameError(
            f"rotors of {min_force_n:g} to {max_force_n:g} N; a throttle needs rotors from 0 N or more to a "
            "finite force (rotor_min_n, rotor_max_n)"
        )
    for mounting_yaw in _MOUNTING_YAWS:
        order = _rotor_order(layout, mounting_yaw)
        if order:
            strengths = tuple(max_force_n * layout[rotor].strength for rotor in order)
            return Frame(order, strengths, min_force_n, mounting_yaw)
    raise FrameError(
        "ArduPilot, PX4 and Betaflight need four rotors with alternating spin, in an X or a plus "
        '(frame = "x" or "plus")'
    )


def _rotor_order(layout: Layout, mounting_yaw: float) -> tuple[int, ...]:
    """The rotor of each motor with the flight controller turned by this yaw; empty if they do not fit."""
    reach = [hypot(rotor.x, rotor.y) for rotor in layout]
    if len(layout) != len(_MOTORS) or max(reach) - min(reach) > _ARM_TOLERANCE * max(reach):
        return ()
    found = []
    for angle, yaw in _MOTORS:
        for i, rotor in enumerate(layout):
            angle_error = atan2(rotor.y, rotor.x) - angle - mounting_yaw
            if abs(atan2(sin(angle_error), cos(angle_error))) < _ANGLE_TOLERANCE and rotor.yaw * yaw > 0.0:
                found.append(i)
                break
    return tuple(found) if len(set(found)) == len(_MOTORS) else ()
