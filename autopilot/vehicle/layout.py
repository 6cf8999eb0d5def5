"""Where the rotors are and how they differ: the shape of a vehicle, for truth and belief, without its size.

Size and strength are separate numbers of the vehicle (`arm_m`, `rotor_max_n`, ...), which parameters may
change: a rotor is described in units of these. `PLUS` is the quadrotor of (2-13). Importing this is cheap.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import NamedTuple

MAX_ROTOR_FORCE_N = 1000.0  # of a rotor
# HIL_ACTUATOR_CONTROLS has sixteen controls, of which gripper and winch take two
MIN_ROTORS, MAX_ROTORS = 4, 14


class Rotor(NamedTuple):
    """One rotor. Its axis is parallel to the thrust axis; if it turns counterclockwise, seen from above, it
    turns the vehicle clockwise."""

    x: float  # place forward of the centre of mass, in units of `arm_m`
    y: float  # place to its left
    yaw: float  # moment about the upward axis / (`torque_ratio_m` * force); negative: turns counterclockwise
    strength: float = 1.0  # its limits, in units of `rotor_min_n` and `rotor_max_n`
    lag: float = 1.0  # in units of `rotor_tau_s`


Layout = tuple[Rotor, ...]

PLUS: Layout = (
    Rotor(-1.0, 0.0, -1.0),
    Rotor(0.0, -1.0, 1.0),
    Rotor(1.0, 0.0, -1.0),
    Rotor(0.0, 1.0, 1.0),
)


def regular_layout(count: int, arm_backward: bool, spins: tuple[float, ...]) -> Layout:
    """Rotors at equal angles on a circle, counterclockwise from the rear; `arm_backward`: an arm points
    backward, otherwise the gap between two. Each of `spins` is the sign of a rotor's moment about the upward
    axis."""
    first = pi if arm_backward else pi - pi / count
    angles = [first + 2.0 * pi * i / count for i in range(count)]
    return tuple(
        Rotor(_without_rounding_error(cos(angle)), _without_rounding_error(sin(angle)), spin)
        for angle, spin in zip(angles, spins, strict=True)
    )


def _without_rounding_error(value: float) -> float:
    """The value without the rounding error of angles, so that a rotor on an axis lies exactly on it."""
    return round(value, 12) + 0.0
