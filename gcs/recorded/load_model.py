"""A load on a cable below a vehicle whose motion is known: its forces and equations of motion.

    L q'' = -(I - q q') (a + g e_3 - f / m_L) - L |q'|^2 q

with the cable's direction q (from vehicle to load), the vehicle's acceleration a, and the forces f on the
load besides weight and cable, here as accelerations f / m_L:

    -c |v_L| v_L                        drag, of the load's velocity v_L
    (k o + s e_3 x o) w(|o| / r)        wash of the rotors, w(u) = u / (1 + u^4), which spreads over the
                                        ground and pushes outwards and tangentially; o is the horizontal
                                        position of the load relative to the point where the wash comes
                                        down, on the vehicle's thrust axis of some tenths of a second ago
    -e a                                a force proportional to the vehicle's acceleration
    p                                   a constant push, for instance from a frame that is not quite level
    d                                   turbulence: a Markov process of first order in x and y

Massless, taut cable; the load is a point. World frame z up; SI units. The state is the tuple
(q_x, q_y, q_x', q_y', d_x, d_y) with q_z < 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from autopilot.geometry.kernel import kernel

LoadState = tuple[float, float, float, float, float, float]
# acceleration (3) and velocity (3) of the vehicle, and its position relative to where its wash comes down (2)
Drive = tuple[float, float, float, float, float, float, float, float]

_MIN_DOWN = 1e-3  # of -q_z: the equations are for a cable that points down
_STEPS = 2  # of integration from row to row


class LoadModel(NamedTuple):
    """Parameters of the load's motion; the last nine are those of its estimation."""

    length_m: float  # from the attachment at the vehicle to the load
    gravity_m_s2: float
    drag_per_m: float  # c
    wash_per_s2: float  # k
    swirl_per_s2: float  # s
    wash_radius_m: float  # r
    wash_delay_s: float
    acceleration_share: float  # e
    push_x_m_s2: float  # p
    push_y_m_s2: float
    mass_ratio: float  # load / vehicle
    vehicle_drag_per_s: float  # of the vehicle: force per mass and velocity
    tilt_share: float  # share of the vehicle's horizontal acceleration that its attitude shows
    turbulence_m_s2: float  # standard deviation of d
    turbulence_s: float  # its correlation time
    force_density: float  # white noise of the load's acceleration, m/s^2 / sqrt(Hz)
    seen_m: float  # standard deviation of the load's position
    seen_s: float  # standard deviation of its time
    tilt_noise: float  # standard deviation of the thrust's direction
    tilt_per_accel: float  # relative growth of its variance with the squared horizontal acceleration
    tilt_walk: float  # random walk of its bias, 1/sqrt(s)


@kernel
def downward_q_z(qx: float, qy: float) -> float:
    """q_z of a cable that points down."""
    return -math.sqrt(max(_MIN_DOWN**2, 1.0 - qx * qx - qy * qy))


@kernel
def _rates(s: LoadState, u: Drive, m: LoadModel) -> LoadState:
    qx, qy, wx, wy, dx, dy = s
    ax, ay, az, vx, vy, vz, cx, cy = u
    qz = downward_q_z(qx, qy)
    wz = -(qx * wx + qy * wy) / qz
    lx, ly, lz = vx + m.length_m * wx, vy + m.length_m * wy, vz + m.length_m * wz
    drag = m.drag_per_m * math.sqrt(lx * lx + ly * ly + lz * lz)
    ox, oy = cx + m.length_m * qx, cy + m.length_m * qy
    far = math.sqrt(ox * ox + oy * oy) / m.wash_radius_m
    spread = far / (1.0 + far * far * far * far)
    wash, swirl = m.wash_per_s2 * spread, m.swirl_per_s2 * spread
    share = 1.0 + m.acceleration_share
    fx = dx + m.push_x_m_s2 + wash * ox - swirl * oy - drag * lx - share * ax
    fy = dy + m.push_y_m_s2 + wash * oy + swirl * ox - drag * ly - share * ay
    fz = -m.gravity_m_s2 - drag * lz - az
    along = fx * qx + fy * qy + fz * qz
    turning = wx * wx + wy * wy + wz * wz
    return (
        wx,
        wy,
        (fx - along * qx) / m.length_m - turning * qx,
        (fy - along * qy) / m.length_m - turning * qy,
        -dx / m.turbulence_s,
        -dy / m.turbulence_s,
    )


@kernel
def _advanced(s: LoadState, rate: LoadState, h: float) -> LoadState:
    return (
        s[0] + h * rate[0],
        s[1] + h * rate[1],
        s[2] + h * rate[2],
        s[3] + h * rate[3],
        s[4] + h * rate[4],
        s[5] + h * rate[5],
    )


@kernel
def _parabola(v0: float, v1: float, a0: float, a1: float, h: float, part: float) -> tuple[float, float]:
    """Acceleration and velocity at a part of a step h: the acceleration is the parabola with the values a0
    and a1 at the ends and the integral v1 - v0."""
    bend = 6.0 * ((v1 - v0) / h - 0.5 * (a0 + a1))
    rest = 1.0 - part
    accel = rest * a0 + part * a1 + part * rest * bend
    square = 0.5 * part * part
    return accel, v0 + h * ((part - square) * a0 + square * a1 + square * (1.0 - part / 1.5) * bend)


@kernel
def _interpolated(a: Drive, b: Drive, h: float, part: float) -> Drive:
    rest = 1.0 - part
    ax, vx = _parabola(a[3], b[3], a[0], b[0], h, part)
    ay, vy = _parabola(a[4], b[4], a[1], b[1], h, part)
    az, vz = _parabola(a[5], b[5], a[2], b[2], h, part)
    return (ax, ay, az, vx, vy, vz, rest * a[6] + part * b[6], rest * a[7] + part * b[7])


@kernel
def step_load(s: LoadState, h: float, before: Drive, after: Drive, m: LoadModel) -> LoadState:
    """The state a time h later, while the drive changes from `before` to `after` (Runge-Kutta 4)."""
    part = 1.0 / _STEPS
    e = h * part
    for i in range(_STEPS):
        first = _interpolated(before, after, h, i * part)
        middle = _interpolated(before, after, h, (i + 0.5) * part)
        last = _interpolated(before, after, h, (i + 1) * part)
        k1 = _rates(s, first, m)
        k2 = _rates(_advanced(s, k1, 0.5 * e), middle, m)
        k3 = _rates(_advanced(s, k2, 0.5 * e), middle, m)
        k4 = _rates(_advanced(s, k3, e), last, m)
        s = _advanced(_advanced(_advanced(_advanced(s, k1, e / 6), k2, e / 3), k3, e / 3), k4, e / 6)
    return s


@kernel
def thrust_tilt(s: LoadState, u: Drive, m: LoadModel) -> tuple[float, float]:
    """Direction of the thrust, (b_x / b_z, b_y / b_z), that the motion of vehicle and load requires.

    b is along m_Q (a + g e_3) + D v - T q with the cable's tension T; the drive should be smoothed as
    strongly as the attitude that is compared with it.
    """
    qx, qy, wx, wy = s[0], s[1], s[2], s[3]
    qz = downward_q_z(qx, qy)
    wz = -(qx * wx + qy * wy) / qz
    ax, ay, az = u[0], u[1], u[2] + m.gravity_m_s2
    turning = wx * wx + wy * wy + wz * wz
    pull = m.mass_ratio * (m.length_m * turning - (qx * ax + qy * ay + qz * az))
    up = az - pull * qz
    return (
        (m.tilt_share * ax - pull * qx + m.vehicle_drag_per_s * u[3]) / up,
        (m.tilt_share * ay - pull * qy + m.vehicle_drag_per_s * u[4]) / up,
    )
