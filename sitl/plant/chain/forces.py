"""Forces on vehicle, cable and load other than the tensions.

| symbol | code | unit | |
|---|---|---|---|
| rho | model.mass | kg/m | half of each link's mass lies at each of its ends |
| d, C_d | diameter, drag_coefficient | m | a link is a cylinder across the flow |
| v_n | across | m/s | air speed of the middle of a link, across it |

The drag of a link is -rho_air d l C_d |v_n| v_n / 2 and half of it acts at each end (only the component of
the flow across a cylinder causes drag: the cross-flow principle).
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    ZERO,
    Mat3,
    Vec3,
    add,
    apply_transposed,
    axpy,
    cross,
    dot,
    norm,
    scale,
    sub,
)
from autopilot.geometry.so3 import quat_normalise, rotation_from_quat
from sitl.plant.chain.records import ChainRows, LoadBody, put, vector
from sitl.plant.contact import point_force
from sitl.plant.rates import drag_force, rates
from sitl.plant.records import ChainModel, Motion, Truth
from sitl.plant.rotors import END, RotorRows, Wrench


class Bodies(NamedTuple):
    """Vehicle and load, each with position, velocity, attitude (body to world) and body rate."""

    x_quad: Vec3
    v_quad: Vec3
    quat: tuple[float, float, float, float]
    omega: Vec3
    x_load: Vec3
    v_load: Vec3
    load: LoadBody


class Drags(NamedTuple):
    """Drag of the half links at vehicle and load, N."""

    on_quad: Vec3
    on_load: Vec3


class FreeRates(NamedTuple):
    """Accelerations of the bodies without the tensions, and the normal forces of the ground."""

    quad: Vec3  # m/s^2, with the half link that it carries
    spin: Vec3  # rad/s^2, of the vehicle
    load: Vec3  # m/s^2, with the half link that it carries
    load_spin: Vec3  # rad/s^2
    quad_normal: float  # N
    load_normal: float  # N


@kernel
def moments_of(model: ChainModel, truth: Truth) -> Vec3:
    """Principal moments of inertia of the load, kg m^2."""
    across = truth.load_mass * model.gyration * model.gyration
    upright = truth.load_mass * model.gyration_upright * model.gyration_upright
    return (across, across, upright)


@kernel
def _link_drag(rows: ChainRows, i: int, wind: Vec3, factor: float) -> Vec3:
    """Half of the drag of the link from point i - 1 to point i, N."""
    along = sub(vector(rows.x, i), vector(rows.x, i - 1))
    length = norm(along)
    air = sub(scale(0.5, add(vector(rows.v, i), vector(rows.v, i - 1))), wind)
    if not length > 0.0:
        return ZERO
    across = axpy(-dot(air, along) / (length * length), along, air)
    return scale(-factor * norm(across), across)


@kernel
def free_points(rows: ChainRows, model: ChainModel, truth: Truth, wind: Vec3, length: float) -> Drags:
    """Write the accelerations of the points between to `rows.free`; return the drag at the ends."""
    n = rows.link.shape[0]
    mass = model.mass * length / n
    area = truth.air.cable_diameter * length / n
    factor = 0.25 * truth.air.density * model.drag_coefficient * area
    before = first = _link_drag(rows, 1, wind, factor)
    for i in range(1, n):
        after = _link_drag(rows, i + 1, wind, factor)
        ground = point_force(rows.x[i, 2], vector(rows.v, i), mass, truth)
        force = add(add(before, after), ground)
        put(rows.free, i, axpy(1.0 / mass, force, (0.0, 0.0, -truth.gravity)))
        before = after
    return Drags(first, before)


@kernel
def _load_moment(
    at: Bodies, R: Mat3, model: ChainModel, truth: Truth, wind: Vec3, normal: float, inertia: Vec3
) -> Vec3:
    """Angular acceleration of the load by air and ground, rad/s^2, body frame.

    Its drag acts at the distance `pressure` forward of the centre. Where the load lies on the ground,
    friction brakes its rotation as it brakes a slide, with the load's radius as lever arm.
    """
    omega = at.load.omega
    drag = drag_force(at.v_load, wind, truth.load_drag, truth.load_drag_quadratic)
    moment = cross((model.pressure, 0.0, 0.0), apply_transposed(R, drag))
    moment = axpy(-model.spin_drag * norm(omega), omega, moment)
    momentum = (inertia[0] * omega[0], inertia[1] * omega[1], inertia[2] * omega[2])
    brake = truth.slip_rate
    max_moment = truth.friction * normal * truth.load_radius
    if brake * norm(momentum) > max_moment:
        brake = max_moment / norm(momentum)
    moment = axpy(-brake, momentum, sub(moment, cross(omega, momentum)))
    return (moment[0] / inertia[0], moment[1] / inertia[1], moment[2] / inertia[2])


@kernel
def free_bodies(
    at: Bodies,
    wrench: Wrench,
    rotors: RotorRows,
    model: ChainModel,
    truth: Truth,
    wind: Vec3,
    half: float,
    drags: Drags,
) -> FreeRates:
    """Accelerations of vehicle and load, each with half a link of mass `half` (kg) and its drag.

    The accelerations of the bodies alone are those of the plant with a slack cable (`sitl.plant.rates`). The
    force of each rotor is in the row END.
    """
    motion = Motion(
        at.x_load,
        at.v_load,
        sub(at.x_load, at.x_quad),
        sub(at.v_load, at.v_quad),
        at.quat,
        at.omega,
        0.0,
        0.0,
    )
    found = rates(motion, wrench, rotors, END, truth, wind, 0.0)
    a_load = found.motion.v_load
    a_quad = found.accel_quad
    g = (0.0, 0.0, -truth.gravity)
    # a half link falls by its own weight; its mass reduces the effect of the other forces
    quad = axpy(truth.quad_mass / (truth.quad_mass + half), sub(a_quad, g), g)
    load = axpy(truth.load_mass / (truth.load_mass + half), sub(a_load, g), g)
    quad = axpy(1.0 / (truth.quad_mass + half), drags.on_quad, quad)
    load = axpy(1.0 / (truth.load_mass + half), drags.on_load, load)
    load_spin = ZERO
    if model.gyration > 0.0:
        R = rotation_from_quat(quat_normalise(at.load.quat))
        inertia = moments_of(model, truth)
        load_spin = _load_moment(at, R, model, truth, wind, found.load_normal, inertia)
    return FreeRates(quad, found.motion.omega, load, load_spin, found.quad_normal, found.load_normal)
