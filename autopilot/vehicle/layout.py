"""Where the rotors are and how they differ: the shape of a vehicle, for truth and belief, without its size.

Size and strength are numbers of the vehicle beside it (`arm_m`, `rotor_max_n`, ...), which parameters may
change: a rotor is told in units of these. `PLUS` is the quadrotor of (2-13). Importing this is cheap.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import NamedTuple

GREATEST_FORCE_N = 1000.0  # of a rotor
FEWEST, MOST = 4, 14  # HIL_ACTUATOR_CONTROLS has sixteen controls, of which gripper and winch take two


class Rotor(NamedTuple):
    """One rotor. Its axis stands along the thrust axis; turning counterclockwise, seen from above, it turns
    the vehicle clockwise."""

    x: float  # forward of the centre of mass, of `arm_m`
    y: float  # to its left
    yaw: (
        float  # moment about the upward axis, of `torque_ratio_m` times its force; negative: counterclockwise
    )
    strength: float = 1.0  # its limits, of `rotor_min_n` and `rotor_max_n`
    lag: float = 1.0  # of `rotor_tau_s`


Layout = tuple[Rotor, ...]

PLUS: Layout = (
    Rotor(-1.0, 0.0, -1.0),
    Rotor(0.0, -1.0, 1.0),
    Rotor(1.0, 0.0, -1.0),
    Rotor(0.0, 1.0, 1.0),
)


def regular(count: int, ahead: bool, spins: tuple[float, ...]) -> Layout:
    """Rotors at equal angles on a circle, counterclockwise from the one at the rear; `ahead`: an arm points
    forward, else the gap between two does. Each of `spins` is the sign of a rotor's moment about the upward
    axis."""
    first = pi if ahead else pi - pi / count
    places = [first + 2.0 * pi * i / count for i in range(count)]
    return tuple(
        Rotor(_tidy(cos(angle)), _tidy(sin(angle)), spin) for angle, spin in zip(places, spins, strict=True)
    )


def _tidy(value: float) -> float:
    """Without the rounding of angles, so that what lies on an axis lies there exactly."""
    return round(value, 12) + 0.0
