"""Effects of moving air and of the nearby ground on the rotors: drag, flapping, ground effect.

| symbol | code | frame, unit | |
|---|---|---|---|
| F_i | rows[stage, i] | N | thrust of a rotor far from the ground |
| r_i | hub | body, m | its hub, from the centre of mass |
| u_i | u | body, m/s | velocity of the hub relative to the air, R^T (x_Q' - w) + Omega x r_i |
| k | rotor_drag | 1/s | induced drag |
| a | rotor_flap | rad/(m/s) | backward tilt of the disc |
| K | blade_stiffness | N m/rad | moment at the hub per tilt |
| R_r, z | rotor_radius | m | radius, height of the hub over the ground along the rotor's axis |
| A | | m^2 | pi R_r^2 |

In the disc's plane, with u' the part of u_i there:

    H_i = -(k/g + a) F_i u'              at the hub
    M_i = K a (e3 x -u')

This is the lumped drag of Mahony, Kumar and Corke (2012), equation (13): linear in the velocity, proportional
to the thrust. A disc that tilts by a |u'| has a backward thrust component of a F |u'|; stiff blades transmit
the tilt to the hub as a moment. In hover the drag is k + a g in 1/s, for each kilogram that the rotors carry.

Near the ground a rotor gives more thrust at the same power (Cheeseman and Bennett 1955, in the second form,
in which forward speed blows the wash away):

    F_i' = F_i (1 + c b / (1 - b)),   b = (R_r / 4 z)^2 / (1 + (|u'| / v_i)^2),   v_i^2 = F_i / (2 rho A)

c is `ground_effect`. The formula holds from z = R_r/2 on; below, the height counts as R_r/2.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import ZERO, Mat3, Vec3, add, apply_transposed, cross
from sitl.plant.records import Air, Truth
from sitl.plant.rotors import PITCH, ROLL, RotorRows

_MIN_HEIGHT = 0.5  # rotor radii, above which the formula holds
_NO_WASH = 1e-9  # N, added to a denominator to avoid 0 / 0


class AirWrench(NamedTuple):
    """Force (N) and moment (N m) of the air on the rotors, body frame."""

    force: Vec3
    moment: Vec3


@kernel
def has_rotor_air_effects(truth: Truth) -> bool:
    """Whether drag, flapping or ground effect act on the rotors."""
    air = truth.air
    return air.rotor_drag > 0.0 or air.rotor_flap > 0.0 or air.ground_effect > 0.0


@kernel
def hub_of(rotors: RotorRows, i: int, truth: Truth) -> Vec3:
    """r_i, the hub of rotor i."""
    table = rotors.table
    return (-truth.arm * table[i, PITCH], truth.arm * table[i, ROLL], truth.rotor_height)


@kernel
def ground_gain(thrust: float, height: float, across: float, air: Air) -> float:
    """F' / F - 1 of a rotor with this thrust (N) and height (m); `across` is |u'|^2."""
    disc = pi * air.rotor_radius * air.rotor_radius
    lift = if_above(thrust, 0.0, thrust, 0.0)
    min_height = _MIN_HEIGHT * air.rotor_radius
    near = air.rotor_radius / (4.0 * if_above(height, min_height, height, min_height))
    b = near * near * lift / (lift + 2.0 * air.density * disc * across + _NO_WASH)
    return air.ground_effect * b / (1.0 - b)


@kernel
def rotor_air_wrench(
    rotors: RotorRows, stage: int, x_quad: Vec3, v_quad: Vec3, R: Mat3, omega: Vec3, wind: Vec3, truth: Truth
) -> AirWrench:
    """Force and moment in addition to the rotors' thrust and torque; the rotor forces are in row `stage`."""
    air = truth.air
    air_velocity = apply_transposed(R, (v_quad[0] - wind[0], v_quad[1] - wind[1], v_quad[2] - wind[2]))
    lag = air.rotor_drag / truth.gravity + air.rotor_flap
    stiff = air.blade_stiffness * air.rotor_flap
    # a rotor with a horizontal axis has no ground below it
    upright = if_above(R[2][2], 0.0, R[2][2], 0.0)
    force, moment = ZERO, ZERO
    for i in range(rotors.table.shape[0]):
        thrust = rotors.rows[stage, i]
        hub = hub_of(rotors, i, truth)
        u = add(air_velocity, cross(omega, hub))
        extra_thrust = 0.0
        if air.ground_effect > 0.0:
            z = x_quad[2] + R[2][0] * hub[0] + R[2][1] * hub[1] + R[2][2] * hub[2]
            # its height along the axis is z / upright
            axis_height = if_above(upright, 1e-3, z / (upright + 1e-9), 1e9)
            extra_thrust = thrust * ground_gain(thrust, axis_height, u[0] * u[0] + u[1] * u[1], air)
        hub_force = (-lag * thrust * u[0], -lag * thrust * u[1], extra_thrust)
        force = add(force, hub_force)
        moment = add(moment, add(cross(hub, hub_force), (stiff * u[1], -stiff * u[0], 0.0)))
    return AirWrench(force, moment)
