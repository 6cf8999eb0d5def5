"""The ground: level, at z = 0, under the feet and blade tips of the vehicle and under the load.

Every contact point has a spring and a damper along z, and friction across. The constants come from a natural
frequency and a damping ratio and from the mass of the body, so one step size is stable for all masses. The
springs are longer by their own static deflection g / omega^2: a body at rest stands exactly at its height.
"""

from __future__ import annotations

from math import sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import ZERO, Mat3, Vec3, add, apply, apply_transposed, cross
from sitl.plant.records import Truth

# directions of the contact points of the vehicle: four feet, then four blade tips
_X = (1.0, 1.0, -1.0, -1.0, 1.0, 0.0, -1.0, 0.0)
_Y = (1.0, -1.0, 1.0, -1.0, 0.0, 1.0, 0.0, -1.0)
# the vehicle stands on four points: each carries this share of its mass
_SHARE = 0.25


@kernel
def point_force(height: float, v: Vec3, mass: float, truth: Truth) -> Vec3:
    """Force of the ground on a point at `height` (m) above it that moves at `v` and carries `mass`.

    The damper fades in over the static deflection, so the force is continuous at the touch, and never pulls.
    Friction acts like a damper up to Coulomb's limit, so its rate is bounded, however hard the impact.
    """
    if height >= 0.0:
        return ZERO
    omega = truth.contact_frequency
    depth = -height
    deflection = truth.gravity / (omega * omega)
    fade = if_above(deflection, depth, depth / deflection, 1.0)
    normal = mass * omega * (omega * depth - 2.0 * truth.contact_damping * fade * v[2])
    if normal <= 0.0:
        return ZERO
    slide = sqrt(v[0] * v[0] + v[1] * v[1])
    brake = truth.slip_rate * mass
    if brake * slide > truth.friction * normal:
        brake = truth.friction * normal / slide
    return (-brake * v[0], -brake * v[1], normal)


@kernel
def load_force(x_load: Vec3, v_load: Vec3, truth: Truth) -> Vec3:
    """Force of the ground on the load, N."""
    deflection = truth.gravity / (truth.contact_frequency * truth.contact_frequency)
    return point_force(x_load[2] - truth.load_radius - deflection, v_load, truth.load_mass, truth)


@kernel
def quad_reach(truth: Truth) -> float:
    """Radius in m of a ball about the vehicle that contains all its contact points."""
    return truth.gear_height + 1.5 * truth.gear_spread + truth.rotor_reach + truth.rotor_height


@kernel
def quad_wrench(x_quad: Vec3, v_quad: Vec3, R: Mat3, omega: Vec3, truth: Truth) -> tuple[Vec3, Vec3]:
    """Force (N, world) and moment (N m, body) of the ground on the vehicle."""
    force, moment = ZERO, ZERO
    if x_quad[2] > quad_reach(truth):
        return force, moment
    deflection = truth.gravity / (truth.contact_frequency * truth.contact_frequency)
    for i in range(8):
        if i < 4:
            reach, z = truth.gear_spread, -truth.gear_height - deflection
        else:
            reach, z = truth.rotor_reach, truth.rotor_height
        point = (reach * _X[i], reach * _Y[i], z)
        height = x_quad[2] + R[2][0] * point[0] + R[2][1] * point[1] + R[2][2] * point[2]
        if height < 0.0:
            v = add(v_quad, apply(R, cross(omega, point)))
            f = point_force(height, v, _SHARE * truth.quad_mass, truth)
            force = add(force, f)
            moment = add(moment, cross(point, apply_transposed(R, f)))
    return force, moment
