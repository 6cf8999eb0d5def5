"""Load position: the cable direction that drives the load to its reference, (3-40)-(3-44).

| symbol     | code name             | frame | unit     | equation |
|------------|-----------------------|-------|----------|----------|
| x_L, v_L   | x_load, v_load        | I     | m, m/s   | (2-30)   |
| x_d .. x_d''| x_d, v_d, a_d        | I     | m, m/s, m/s^2 | (3-12) |
| e_x        | e_x                   | I     | m        | (3-12)   |
| e_v        | e_v                   | I     | m/s      | (3-13)   |
| k_x, k_v   | k_x, k_v              | I     | N/m, N s/m | (3-43) |
| A          | A                     | I     | N        | (3-43)   |
| q_c        | q_c                   | I     |          | (3-42)   |

A is the force that the vehicle must exert along the cable to move vehicle and load by (2-31): hence
q_c = -A/|A|, the cable points from the vehicle down to the load. The term m_Q L (q'.q') q has the sign that
it gets in (2-31) when moved to the other side; both printed formulas agree with this sign.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, dot, norm, scale, sub, times


class PositionResult(NamedTuple):
    """The force A and the errors that it corrects; world frame."""

    A: Vec3  # N
    e_x: Vec3  # m
    e_v: Vec3  # m/s


@kernel
def load_position_force(
    x_load: Vec3,
    v_load: Vec3,
    q_cable: Vec3,
    q_cable_dot: Vec3,
    x_d: Vec3,
    v_d: Vec3,
    a_d: Vec3,
    k_x: Vec3,
    k_v: Vec3,
    quad_mass: float,
    load_mass: float,
    cable_length: float,
    gravity: float,
) -> PositionResult:
    """A of (3-43); the gains are diagonals in the world frame."""
    e_x = sub(x_load, x_d)
    e_v = sub(v_load, v_d)
    feedback = sub(scale(-1.0, times(k_x, e_x)), times(k_v, e_v))
    mass = quad_mass + load_mass
    support = (mass * a_d[0], mass * a_d[1], mass * (a_d[2] + gravity))
    swing = scale(quad_mass * cable_length * dot(q_cable_dot, q_cable_dot), q_cable)
    return PositionResult(add(feedback, add(support, swing)), e_x, e_v)


@kernel
def computed_direction(A: Vec3) -> Vec3:
    """q_c of (3-42): -A/|A|; nan where A vanishes, that is where the load is commanded to fall freely."""
    return scale(-1.0 / norm(A), A)
