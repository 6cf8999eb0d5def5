"""The direction that an attitude run commands, with its first and second derivative."""

from __future__ import annotations

from math import cos, pi, sin, sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import E3, ZERO, Vec3, add, axpy, scale


@kernel
def swing_direction(
    tilt_north_rad: float, tilt_east_rad: float, duration_s: float, t: float
) -> tuple[Vec3, Vec3, Vec3]:
    """Unit vector u(t), ENU, tilted from the vertical by theta(t) = tilt sin^2(pi t / duration), u' and u''.

    It is vertical and at rest before 0 and after the duration. For a run of the vehicle u is its thrust axis
    R_d e3; for a run of the load u points from load to vehicle: q_cable_d = -u.
    """
    tilt = sqrt(tilt_north_rad * tilt_north_rad + tilt_east_rad * tilt_east_rad)
    if tilt == 0.0 or t <= 0.0 or t >= duration_s:
        return E3, ZERO, ZERO
    side = (tilt_east_rad / tilt, tilt_north_rad / tilt, 0.0)
    rate = 2.0 * pi / duration_s
    theta = 0.5 * tilt * (1.0 - cos(rate * t))
    theta_dot = 0.5 * tilt * rate * sin(rate * t)
    theta_ddot = 0.5 * tilt * rate * rate * cos(rate * t)
    u = add(scale(cos(theta), E3), scale(sin(theta), side))
    across = add(scale(-sin(theta), E3), scale(cos(theta), side))
    return u, scale(theta_dot, across), axpy(theta_ddot, across, scale(-theta_dot * theta_dot, u))
