"""Where a point of the world is in the picture of an environment: a perspective projection.

The camera looks down from the south-east. Its position depends on the present state alone: it follows the
desired position of the load, and moves away if the load is far from that.
"""

from __future__ import annotations

from math import ceil, cos, hypot, log10, radians, sin
from typing import NamedTuple

import numpy as np

from autopilot.geometry.linear import Vec3
from sitl.world import Floats

_AZIMUTH, _ELEVATION = radians(-65.0), radians(32.0)  # of the camera, seen from the scene
_SIDE = 0.9  # the shorter side of the picture, in a plane at distance 1
_USED = 0.86  # share of the shorter side that the scene fills
_GROUND_M = 3.0  # height of the load up to which the ground below it is in the picture
_NEAR_M = 0.6  # error of the load up to which the camera only follows the desired position
_FINE_M = 10.0  # height of the camera up to which the grid on the ground has lines every metre
_NEAREST_M = 0.1  # distance from the camera below which nothing is drawn

_OUTWARD = np.array(  # from the scene to the camera
    [cos(_ELEVATION) * cos(_AZIMUTH), cos(_ELEVATION) * sin(_AZIMUTH), sin(_ELEVATION)]
)
_RIGHT = np.array([-sin(_AZIMUTH), cos(_AZIMUTH), 0.0])
_AXES = np.stack((_RIGHT, np.cross(_OUTWARD, _RIGHT), -_OUTWARD))  # right, up, forward


class Camera(NamedTuple):
    """A camera, whose direction is always the same."""

    eye: Floats  # m, (3,) world
    centre: Floats  # m, (3,) the point that it looks at
    middle: Floats  # pixels, (2,) where this point is in the picture
    focal: float  # pixels
    size: tuple[int, int]  # pixels, width and height of the picture

    def pixels(self, points: Floats) -> Floats:
        """(..., 2) pixels to the right and up from the lower left corner, of points (..., 3) in m; NaN for
        points that are not in front of the camera."""
        seen = (points - self.eye) @ _AXES.T
        depth = np.where(seen[..., 2] > _NEAREST_M, seen[..., 2], np.nan)
        return np.asarray(self.middle + self.focal * seen[..., :2] / depth[..., None])

    @property
    def grid_m(self) -> float:
        """Distance of the lines of a grid on the ground that is neither too fine nor too coarse: 1 m, or 10 m
        and so on from high up."""
        return float(10.0 ** max(0, ceil(log10(self.eye[2] / _FINE_M))))

    def ground(self) -> Floats:
        """The point (3,) on the ground in the direction in which it looks."""
        return np.asarray(self.eye - self.eye[2] / _OUTWARD[2] * _OUTWARD)

    def scale(self, point: Floats) -> float:
        """Pixels per metre at a point (3,)."""
        return self.focal / max(float((point - self.eye) @ _AXES[2]), _NEAREST_M)


def camera_at(desired: Vec3, load: Vec3, reach: float, size: tuple[int, int]) -> Camera:
    """The camera for a desired and a true position of the load, and a vehicle that reaches `reach` (m) above
    the load."""
    low, high = max(0.0, desired[2] - _GROUND_M), desired[2] + reach
    error = np.array(load) - np.array(desired)
    distance = hypot(*error)
    excess = max(0.0, distance - _NEAR_M)
    centre = np.array([desired[0], desired[1], 0.5 * (low + high)])
    if excess > 0.0:
        centre += 0.5 * excess / distance * error
    # the ends of a vertical line of twice this length have equal distances from the edges of the picture
    half = 0.5 * (high - low) + 0.5 * excess
    across, along, side = half * cos(_ELEVATION), half * sin(_ELEVATION), _USED * _SIDE
    away = (across + hypot(across, side * along)) / side
    focal = min(size) / _SIDE
    shift = 0.5 * focal * (across / (away - along) - across / (away + along))
    middle = np.array([0.5 * size[0], 0.5 * size[1] - shift])
    return Camera(centre + away * _OUTWARD, centre, middle, focal, size)
