"""Rotation of a rigid body, and motion of its points away from the centre of mass (where a sensor sits, or
the cable is attached).

| symbol | code | frame, unit | |
|---|---|---|---|
| Omega, M | omega, moment | body, rad/s, N m | |
| J | inertia | body, kg m^2 | along its principal axes |
| r | arm | body, m | from the centre of mass to the point |
| x_S | | world, m | x_Q + R r |

    J Omega' = M - Omega x J Omega
    x_S'  = x_Q' + R (Omega x r)
    x_S'' = x_Q'' + R (Omega' x r + Omega x (Omega x r))
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, add, apply, cross, sub, times


@kernel
def angular_accel(omega: Vec3, moment: Vec3, inertia: Vec3) -> Vec3:
    """Omega', rad/s^2."""
    torque = sub(moment, cross(omega, times(inertia, omega)))
    return (torque[0] / inertia[0], torque[1] / inertia[1], torque[2] / inertia[2])


@kernel
def arm_velocity(R: Mat3, omega: Vec3, arm: Vec3) -> Vec3:
    """x_S' - x_Q'."""
    return apply(R, cross(omega, arm))


@kernel
def arm_accel(omega: Vec3, omega_dot: Vec3, arm: Vec3) -> Vec3:
    """R^T (x_S'' - x_Q'')."""
    return add(cross(omega_dot, arm), cross(omega, cross(omega, arm)))
