"""One fixed step of the plant with a cable of links: two implicit stages of second order.

The method is the singly diagonally implicit Runge-Kutta method of two stages with gamma = 1 - 1/sqrt(2)
(Alexander 1977), of order 2 and L-stable: an oscillation of the stretch that is too fast for the step is
damped out. Each stage is an implicit Euler step of length gamma h (`sitl.plant.chain.stage`); the second
begins from y + (1 - gamma) h y'_1 and ends at the end of the step.

If the iteration of a stage does not converge, the step is halved.
"""

from __future__ import annotations

from math import ceil, inf, sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, dot, norm, sub
from autopilot.geometry.packed import pack, unpack
from autopilot.geometry.so3 import Quat, quat_normalise, rotation_from_quat
from sitl.plant.attachment import inverse_inertia_times, moment_arm
from sitl.plant.chain.forces import Bodies
from sitl.plant.chain.records import (
    STRETCH_BASE,
    TENSION,
    ChainRows,
    LoadBody,
    copy,
    lay_straight,
    length_of,
    put,
    vector,
)
from sitl.plant.chain.stage import CableLength, StageEnd, implicit_euler, length_after
from sitl.plant.records import ChainModel, Motion, PlantState, Truth
from sitl.plant.rotors import BEFORE, END, FORCE, RotorRows, copy_row, set_targets, wrenches
from sitl.plant.runge_kutta import StepEnd
from sitl.plant.step import frozen_state, is_valid, state_of, zero_tiny_components

GAMMA = 1.0 - 1.0 / sqrt(2.0)
LONGEST_STEP = 5e-4  # s, benchmarks/cable_convergence.py: docs/realism-cable.md has the table
_SHORTEST_STEP = 1e-6  # s, at this length the last iterate is accepted
_CONTRACTION = 0.25  # of each iteration in a stage: the step is chosen to achieve it
# share of the load's weight: taut when every link pulls by more, slack when one pulls by less than half of it
TAUT_SHARE = 0.02


@kernel
def _bodies(state: PlantState, body: LoadBody) -> Bodies:
    return Bodies(
        state.x_quad,
        state.v_quad,
        state.quat_wxyz,
        state.omega_body,
        state.x_load,
        state.v_load,
        body,
    )


@kernel
def _normalised(at: Bodies) -> Bodies:
    """The same with quaternions of length 1."""
    load = LoadBody(quat_normalise(at.load.quat), at.load.omega)
    quat = quat_normalise(at.quat)
    return Bodies(at.x_quad, at.v_quad, quat, at.omega, at.x_load, at.v_load, load)


@kernel
def _update_hold(rows: ChainRows, state: PlantState, truth: Truth) -> None:
    """Record whether the vehicle holds the cable, and its length; a newly held cable is laid straight."""
    if truth.cable_length == inf:
        rows.held[0] = 0.0
        return
    if rows.held[0] == 0.0:
        lay_straight(rows, truth, state)
    rows.held[1] = length_of(truth)


@kernel
def step_length(rows: ChainRows, model: ChainModel, length: float, remaining: float, longest: float) -> float:
    """Length of the next step in s; divides `remaining` evenly.

    Short enough for the iteration of the stages, which converges by the factor (gamma h)^2 4 T / (l m), with
    T the greatest tension, l the length of a link and m the mass of a point.
    """
    n = rows.link.shape[0]
    if n > 1:
        max_tension = 0.0
        for i in range(n):
            max_tension = max(max_tension, rows.link[i, TENSION])
        link_length = length / n
        fastest = 4.0 * max_tension / (link_length * link_length * model.mass)
        if fastest * longest * longest * GAMMA * GAMMA > _CONTRACTION:
            longest = max(sqrt(_CONTRACTION / fastest) / GAMMA, _SHORTEST_STEP)
    if not remaining > longest * (1.0 + 1e-9):
        return remaining
    return remaining / ceil(remaining / longest - 1e-9)


@kernel
def _along(s: float, begin: Vec3, end: Vec3) -> Vec3:
    """begin + s (end - begin)."""
    return axpy(s, sub(end, begin), begin)


@kernel
def _quat_along(s: float, p: Quat, q: Quat) -> Quat:
    return (
        p[0] + s * (q[0] - p[0]),
        p[1] + s * (q[1] - p[1]),
        p[2] + s * (q[2] - p[2]),
        p[3] + s * (q[3] - p[3]),
    )


@kernel
def _bodies_along(s: float, begin: Bodies, end: Bodies) -> Bodies:
    """begin + s (end - begin), number by number."""
    return Bodies(
        _along(s, begin.x_quad, end.x_quad),
        _along(s, begin.v_quad, end.v_quad),
        _quat_along(s, begin.quat, end.quat),
        _along(s, begin.omega, end.omega),
        _along(s, begin.x_load, end.x_load),
        _along(s, begin.v_load, end.v_load),
        LoadBody(
            _quat_along(s, begin.load.quat, end.load.quat),
            _along(s, begin.load.omega, end.load.omega),
        ),
    )


@kernel
def _step(
    begin: Bodies,
    rows: ChainRows,
    rotors: RotorRows,
    truth: Truth,
    wind: Vec3,
    cable_length: CableLength,
    h: float,
) -> StageEnd:
    """A step of length h (s) from `begin` and the points in `rows`, which are moved to its end.
    `cable_length` is that at the beginning."""
    accel = truth.reel_accel
    n = rows.link.shape[0]
    copy(rows.x, rows.x_begin)
    copy(rows.v, rows.v_begin)
    copy(rows.x, rows.x_base)
    copy(rows.v, rows.v_base)
    for i in range(n):
        distance = norm(sub(vector(rows.x, i + 1), vector(rows.x, i)))
        rows.link[i, STRETCH_BASE] = distance - cable_length.length / n
    tau = GAMMA * h
    _, _, wrench = wrenches(rotors, truth, tau)
    first = implicit_euler(
        begin, begin, rows, wrench, rotors, truth, wind, length_after(cable_length, accel, tau), tau
    )
    if not first.converged:
        return first
    # y + (1 - gamma) h y'_1, with y'_1 = (y_1 - y) / tau
    share = (1.0 - GAMMA) / GAMMA
    for i in range(n + 1):
        put(rows.x_base, i, _along(share, vector(rows.x_begin, i), vector(rows.x, i)))
        put(rows.v_base, i, _along(share, vector(rows.v_begin, i), vector(rows.v, i)))
    for i in range(n):
        relative_velocity = sub(vector(rows.v, i + 1), vector(rows.v, i))
        rate = dot(vector(rows.link, i), relative_velocity) - length_after(cable_length, accel, tau).rate / n
        rows.link[i, STRETCH_BASE] += (1.0 - GAMMA) * h * rate
    _, _, wrench = wrenches(rotors, truth, h)
    base = _bodies_along(share, begin, first.at)
    return implicit_euler(
        base, first.at, rows, wrench, rotors, truth, wind, length_after(cable_length, accel, h), tau
    )


@kernel
def _min_tension(rows: ChainRows) -> float:
    """The least tension of all links, N."""
    min_tension = inf
    for i in range(rows.link.shape[0]):
        min_tension = min(min_tension, rows.link[i, TENSION])
    return min_tension


@kernel
def _closing_speed(begin: Bodies, cable_length: CableLength) -> float:
    """Speed in m/s at which vehicle and load separate, minus the rate at which the cable is let out."""
    line = sub(begin.x_load, begin.x_quad)
    return dot(line, sub(begin.v_load, begin.v_quad)) / norm(line) - cable_length.rate


@kernel
def advance_chain(
    state: PlantState, truth: Truth, rotors: RotorRows, wind: Vec3, h: float, rows: ChainRows
) -> PlantState:
    """The state h seconds later, and the cable in `rows`; see `sitl.plant.step.advance`.

    Direction and rate of the cable are those of the line from the attachment to the load's centre; the
    tension is that at the vehicle. `snap_speed` is the closing speed with which the cable came taut.
    """
    if state.diverged > 0.0 or not h > 0.0:
        return state
    model = truth.chain
    half_share = 0.5 * model.mass / rows.link.shape[0]
    _update_hold(rows, state, truth)
    set_targets(rotors, truth)
    copy_row(rotors, FORCE, BEFORE)
    at = _bodies(state, unpack(LoadBody, rows.body, 0))
    cable_length = CableLength(rows.held[1], truth.reel_rate)
    taut_tension = TAUT_SHARE * truth.load_mass * truth.gravity
    taut, slack_events, snap_speed = state.taut, state.slack_events, 0.0
    accel_quad, tension, quad_normal, load_normal = state.accel_quad, state.tension, 0.0, 0.0
    omega_dot = state.omega_dot_body
    remaining, longest = h, LONGEST_STEP
    while remaining > 0.0:
        t = step_length(rows, model, cable_length.length, remaining, longest)
        end = _step(at, rows, rotors, truth, wind, cable_length, t)
        if not end.converged and t > _SHORTEST_STEP:
            copy(rows.x_begin, rows.x)
            copy(rows.v_begin, rows.v)
            longest = 0.5 * t
            continue
        copy_row(rotors, END, FORCE)
        closing = _closing_speed(at, cable_length)
        at = _normalised(end.at)
        cable_length = length_after(cable_length, truth.reel_accel, t)
        tension, min_tension = rows.link[0, TENSION], _min_tension(rows)
        if taut > 0.0 and min_tension < 0.5 * taut_tension:
            taut = 0.0
            slack_events += 1.0
        elif taut <= 0.0 and min_tension > taut_tension:
            taut = 1.0
            snap_speed = max(snap_speed, closing)
        q = vector(rows.link, 0)
        accel_quad = axpy(tension / (truth.quad_mass + half_share * cable_length.length), q, end.free.quad)
        arm = moment_arm(q, rotation_from_quat(at.quat), truth)
        omega_dot = axpy(tension, inverse_inertia_times(arm, truth), end.free.spin)
        quad_normal, load_normal = end.free.quad_normal, end.free.load_normal
        remaining -= t
    rows.held[1] = cable_length.length
    cable, cable_dot = sub(at.x_load, at.x_quad), sub(at.v_load, at.v_quad)
    motion = Motion(
        at.x_load, at.v_load, cable, cable_dot, at.quat, at.omega, cable_length.length, cable_length.rate
    )
    if not is_valid(motion):
        copy_row(rotors, BEFORE, FORCE)
        return frozen_state(state)
    pack(LoadBody(at.load.quat, zero_tiny_components(at.load.omega)), rows.body, 0)
    for i in range(rows.v.shape[0]):
        put(rows.v, i, zero_tiny_components(vector(rows.v, i)))
    end_of_step = StepEnd(motion, 0.0, tension, accel_quad, quad_normal, load_normal, omega_dot)
    return state_of(end_of_step, state.q_cable, taut, slack_events, snap_speed, truth)


@kernel
def advance_chain_many(
    state: PlantState, truth: Truth, rotors: RotorRows, wind: Vec3, h: float, rows: ChainRows, n: int
) -> PlantState:
    """n steps of length h under the same commands and wind."""
    for _ in range(n):
        state = advance_chain(state, truth, rotors, wind, h, rows)
    return state
