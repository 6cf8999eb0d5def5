"""The remaining calibration error of a motion capture room: a distortion of its space.

A measured position has an error that depends only on the place. Along each axis j the error is one wave,
whose direction d_j and phase phi_j are drawn with the seed:

    e_j(x) = sqrt(2) E cos(2 pi d_j . x / L + phi_j)

Its deviation over the room is E. Vehicle and load are measured in the same room, so at the same place their
errors are the same.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import int_per_lane
from autopilot.geometry.linear import Vec3, dot, norm
from sitl.sensors.elementary import cosine_sine
from sitl.sensors.noise import Noise, gaussian, words

_MASK = 0xFFFFFFFF
_WORDS = 4294967296.0  # in a turn
_STREAM = 9  # separate from those of sensors and gusts, `sitl.world`
_ANGLES = 3  # block


class Room(NamedTuple):
    """Deviation on each axis (m; 0: none), and the length of a wave (m)."""

    error: float
    length: float


@kernel
def _wave(axis: int, angle: int, place: Vec3, length: float, noise: Noise) -> float:
    direction = gaussian(noise, axis)
    turns = dot(direction, place) / (norm(direction) * length)
    return cosine_sine((int_per_lane(turns * _WORDS) + angle) & _MASK)[0]


@kernel
def distortion(place: Vec3, room: Room, noise: Noise) -> Vec3:
    """The error at a place (ENU, m); of `noise` only seed and scale are used."""
    room_noise = Noise(noise.seed, _STREAM, 0, 1.0)
    angle = words(room_noise, _ANGLES)
    size = sqrt(2.0) * room.error * noise.scale
    return (
        size * _wave(0, angle[0], place, room.length, room_noise),
        size * _wave(1, angle[1], place, room.length, room_noise),
        size * _wave(2, angle[2], place, room.length, room_noise),
    )
