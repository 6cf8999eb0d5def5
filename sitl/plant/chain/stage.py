"""An implicit Euler step of vehicle, cable and load: the stage of which `sitl.plant.chain.step` takes two.

With y the positions and attitudes, v the velocities and body rates, and y_b, v_b the base of the stage,

    y = y_b + tau y'(y, v)        v = v_b + tau a(y, v, T(y, v))

is solved by iteration. An iterate gives all positions. From these follow the forces and the directions of the
links, then all tensions together (`sitl.plant.chain.tension`), and from them the next velocities. The stiff
part, the stretch, is thus solved for in each iteration; only the rotation of the links is left to iterate. It
converges by a factor of about (tau omega)^2, omega being the highest transverse frequency of the cable.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    ZERO,
    Mat3,
    Vec3,
    add,
    apply,
    apply_transposed,
    axpy,
    cross,
    dot,
    norm,
    scale,
    sub,
)
from autopilot.geometry.so3 import Quat, quat_normalise, rotation_from_quat
from sitl.plant.attachment import attachment_position, attachment_velocity, inverse_inertia_times, moment_arm
from sitl.plant.chain.forces import Bodies, FreeRates, free_bodies, free_points, moments_of
from sitl.plant.chain.records import (
    DIAGONAL,
    OFF_DIAGONAL,
    RHS,
    STRETCH_BASE,
    TENSION,
    ChainRows,
    LoadBody,
    hook_of,
    put,
    vector,
)
from sitl.plant.chain.tension import find_tensions
from sitl.plant.records import ChainModel, Truth
from sitl.plant.rotors import RotorRows, Wrench

_MAX_ITERATIONS = 25
_CONVERGED = 1e-13  # m, the most by which the last iteration moves a point


class CableLength(NamedTuple):
    """The length of the cable itself at one instant."""

    length: float  # m
    rate: float  # m/s


@kernel
def length_after(cable_length: CableLength, accel: float, t: float) -> CableLength:
    """The length t seconds later, reeled with the acceleration `accel`, m/s^2."""
    return CableLength(
        cable_length.length + t * (cable_length.rate + 0.5 * t * accel), cable_length.rate + t * accel
    )


class StageEnd(NamedTuple):
    """The end of a stage."""

    at: Bodies
    free: FreeRates
    converged: bool


@kernel
def _turned(base: Quat, omega: Vec3, tau: float) -> Quat:
    """The q of q = base + tau q'(q, omega), which is linear in q."""
    a, b, c = 0.5 * tau * omega[0], 0.5 * tau * omega[1], 0.5 * tau * omega[2]
    s = 1.0 / (1.0 + a * a + b * b + c * c)
    w, x, y, z = base
    return (
        s * (w - x * a - y * b - z * c),
        s * (x + w * a + y * c - z * b),
        s * (y + w * b + z * a - x * c),
        s * (z + w * c + x * b - y * a),
    )


@kernel
def bodies_after(base: Bodies, speed: Bodies, tau: float) -> Bodies:
    """The bodies after the stage if they have the velocities of `speed` then."""
    return Bodies(
        axpy(tau, speed.v_quad, base.x_quad),
        speed.v_quad,
        _turned(base.quat, speed.omega, tau),
        speed.omega,
        axpy(tau, speed.v_load, base.x_load),
        speed.v_load,
        LoadBody(_turned(base.load.quat, speed.load.omega, tau), speed.load.omega),
    )


@kernel
def _place_points(rows: ChainRows, at: Bodies, R: Mat3, hook: Vec3, truth: Truth, tau: float) -> None:
    """Write the points after the stage if they have the speeds `rows.v` then; the ends are at the bodies."""
    n = rows.link.shape[0]
    for i in range(1, n):
        put(rows.x, i, axpy(tau, vector(rows.v, i), vector(rows.x_base, i)))
    R_quad = rotation_from_quat(quat_normalise(at.quat))
    put(rows.x, 0, attachment_position(at.x_quad, R_quad, truth))
    put(rows.v, 0, add(at.v_quad, attachment_velocity(R_quad, at.omega, truth)))
    put(rows.x, n, add(at.x_load, apply(R, hook)))
    put(rows.v, n, add(at.v_load, apply(R, cross(at.load.omega, hook))))


@kernel
def _direction(rows: ChainRows, i: int) -> Vec3:
    """The direction of link i, 0 ... n - 1."""
    return vector(rows.link, i)


@kernel
def _equations(
    rows: ChainRows,
    model: ChainModel,
    lightness_quad: float,
    lightness_load: float,
    cable_length: CableLength,
    tau: float,
) -> None:
    """Write the equations for the tensions; `rows.free` has the velocities after a stage without them."""
    link, n = rows.link, rows.link.shape[0]
    rest, rest_rate = cable_length.length / n, cable_length.rate / n
    stiffness, damping = model.stiffness / rest, model.damping / rest
    gain = tau * (stiffness * tau + damping)
    lightness = n / (model.mass * cable_length.length) if n > 1 else 0.0
    before = lightness_quad
    for i in range(n):
        q = _direction(rows, i)
        # the rate of the stretch without tensions, and the pull that would follow from it
        rate = dot(q, sub(vector(rows.free, i + 1), vector(rows.free, i))) - rest_rate
        pull = stiffness * (link[i, STRETCH_BASE] + tau * rate) + damping * rate
        after = lightness if i + 1 < n else lightness_load
        link[i, DIAGONAL] = before + after + 1.0 / gain
        link[i, RHS] = pull / gain
        if i + 1 < n:
            link[i, OFF_DIAGONAL] = -after * dot(q, _direction(rows, i + 1))
        before = after
    if rows.held[0] == 0.0:
        # the cable is attached to the load only: its first link connects nothing
        link[0, RHS], link[0, OFF_DIAGONAL] = -1.0, 0.0


@kernel
def _update_directions(rows: ChainRows) -> None:
    """Write the directions of the links; a link of zero length keeps its direction."""
    for i in range(rows.link.shape[0]):
        along = sub(vector(rows.x, i + 1), vector(rows.x, i))
        length = norm(along)
        if length > 0.0:
            put(rows.link, i, scale(1.0 / length, along))


@kernel
def implicit_euler(
    base: Bodies,
    guess: Bodies,
    rows: ChainRows,
    wrench: Wrench,
    rotors: RotorRows,
    truth: Truth,
    wind: Vec3,
    cable_length: CableLength,
    tau: float,
) -> StageEnd:
    """A stage of length tau (s) from `base` and the bases in `rows`; the result is returned and in `rows`.

    `guess` and `rows.v` hold the velocities with which the iteration begins. `cable_length` is that at
    the end of the stage.
    """
    model = truth.chain
    n, hook = rows.link.shape[0], hook_of(model)
    half = 0.5 * model.mass * cable_length.length / n
    mass_quad, mass_load = truth.quad_mass + half, truth.load_mass + half
    lightness = n / (model.mass * cable_length.length) if n > 1 else 0.0
    load_rotates, inertia = model.gyration > 0.0, moments_of(model, truth)
    speed, converged = guess, False
    for _ in range(_MAX_ITERATIONS):
        at = bodies_after(base, speed, tau)
        R = rotation_from_quat(quat_normalise(at.load.quat))
        _place_points(rows, at, R, hook, truth, tau)
        _update_directions(rows)
        drags = free_points(rows, model, truth, wind, cable_length.length)
        free = free_bodies(at, wrench, rotors, model, truth, wind, half, drags)
        # the velocities without any tension
        v_quad, v_load = axpy(tau, free.quad, base.v_quad), axpy(tau, free.load, base.v_load)
        spin = axpy(tau, free.load_spin, base.load.omega)
        for i in range(1, n):
            put(rows.free, i, axpy(tau, vector(rows.free, i), vector(rows.v_base, i)))
        omega = axpy(tau, free.spin, base.omega)
        R_quad = rotation_from_quat(quat_normalise(at.quat))
        put(rows.free, 0, add(v_quad, attachment_velocity(R_quad, omega, truth)))
        arm = moment_arm(_direction(rows, 0), R_quad, truth)
        quad_spin_per_pull = inverse_inertia_times(arm, truth)
        put(rows.free, n, add(v_load, apply(R, cross(spin, hook))))
        q = _direction(rows, n - 1)
        lever = cross(hook, apply_transposed(R, q))
        load_spin_per_pull = ZERO
        if load_rotates:
            load_spin_per_pull = (lever[0] / inertia[0], lever[1] / inertia[1], lever[2] / inertia[2])
        lightness_quad, lightness_load = (
            1.0 / mass_quad + dot(arm, quad_spin_per_pull),
            1.0 / mass_load + dot(lever, load_spin_per_pull),
        )
        _equations(rows, model, lightness_quad, lightness_load, cable_length, tau)
        tensions_found = find_tensions(rows.link)
        # the velocities with the tensions
        first, last = rows.link[0, TENSION], rows.link[n - 1, TENSION]
        omega = axpy(tau * first, quad_spin_per_pull, omega)
        change = norm(sub(omega, speed.omega))
        v_quad = axpy(tau * first / mass_quad, _direction(rows, 0), v_quad)
        v_load = axpy(-tau * last / mass_load, q, v_load)
        spin = axpy(-tau * last, load_spin_per_pull, spin)
        change = max(change, norm(sub(v_quad, speed.v_quad)), norm(sub(v_load, speed.v_load)))
        change = max(change, norm(sub(spin, speed.load.omega)))
        for i in range(1, n):
            pull = sub(
                scale(rows.link[i, TENSION], _direction(rows, i)),
                scale(rows.link[i - 1, TENSION], _direction(rows, i - 1)),
            )
            v = axpy(tau * lightness, pull, vector(rows.free, i))
            change = max(change, norm(sub(v, vector(rows.v, i))))
            put(rows.v, i, v)
        speed = Bodies(at.x_quad, v_quad, at.quat, omega, at.x_load, v_load, LoadBody(at.load.quat, spin))
        if tensions_found and tau * change < _CONVERGED:
            converged = True
            break
    at = bodies_after(base, speed, tau)
    R = rotation_from_quat(quat_normalise(at.load.quat))
    _place_points(rows, at, R, hook, truth, tau)
    return StageEnd(at, free, converged)
