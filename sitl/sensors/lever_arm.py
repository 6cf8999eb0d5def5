"""A sensor that sits away from the vehicle's centre of mass.

| symbol | code | frame, unit | |
|---|---|---|---|
| r | arm | body, m | from the centre of mass to the sensor |
| x_S | | world, m | x_Q + R r |

    x_S'  = x_Q' + R (Omega x r)
    x_S'' = x_Q'' + R (Omega' x r + Omega x (Omega x r))

With r = 0 nothing is added: the readings are, to the bit, those at the centre of mass.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, apply, cross
from autopilot.geometry.so3 import rotation_from_quat
from sitl.plant.records import PlantState


@kernel
def has_lever_arm(arm: Vec3) -> bool:
    """Whether the sensor sits away from the centre of mass."""
    return arm[0] != 0.0 or arm[1] != 0.0 or arm[2] != 0.0


@kernel
def position_of(state: PlantState, arm: Vec3) -> Vec3:
    """x_S."""
    return add(state.x_quad, apply(rotation_from_quat(state.quat_wxyz), arm))


@kernel
def velocity_of(state: PlantState, arm: Vec3) -> Vec3:
    """x_S'."""
    turning = cross(state.omega_body, arm)
    return add(state.v_quad, apply(rotation_from_quat(state.quat_wxyz), turning))


@kernel
def turning_accel(state: PlantState, arm: Vec3) -> Vec3:
    """R^T (x_S'' - x_Q'')."""
    omega = state.omega_body
    return add(cross(state.omega_dot_body, arm), cross(omega, cross(omega, arm)))
