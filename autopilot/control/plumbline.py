"""The law `plumbline`: the cascade of the thesis with exact derivatives in place of its command filters.

    x_d .. x_d'''' --> A, A', A'' (3-43) -> q_c, q_c', q_c'' (3-42) -> F (3-31) -> R_c (3-27) -+-> M (3-36),
    x_d'' .. x_d^(6) -> F_d, F_d', F_d'' by flatness, (F - F_d)', (F - F_d)'' by filter -------+   f (3-35)

| symbol         | code name     | value    | unit       | equation |
|----------------|---------------|----------|------------|----------|
| k_R, k_Omega   | k_R, k_Omega  | 0.9, 0.1 | N m, N m s | (3-21)   |
| k_q, k_w       | k_q, k_omega  | 3.9, 2   | N, N s     | (3-33)   |
| k_x, k_v       | k_x, k_v      | 6, 2.75  | N/m, N s/m | (3-43)   |
| F              | F             |          | N          | (3-31)   |
| F_d            | F_d           |          | N          | m (x_d'' + g e_3) - m_Q L q_d'' |
| omega_n, zeta  | force         | 25, 0.98 | rad/s      | (4-3)    |
| f, f'          | thrust, thrust_rate |    | N, N/s     | (3-35)   |
| D              | air           | `PLB_DRAG`, `PLB_DRAG_2` | N | drag and wind on the vehicle |

What the thesis filters is computed here:

* e_x, e_v and all that follows are taken from the reference itself, with its derivatives up to the sixth.
* q_c' and q_c'' are those of (3-42) along the motion of the model under the thrust that the rotors give now
  (`load_motion`, `direction_jet`), feedback and all.
* Of F, whose derivatives would need those of the moment, the part F_d that the reference alone asks for has
  exact derivatives by flatness. Only the rest, which vanishes with the errors, is passed through a command
  filter (4-2) for its two; F itself is not filtered. R_c, Omega_c, Omega_c' follow from F, F', F'' exactly.
* The rotors are asked for F - D, so that the air's force D on the vehicle, as far as it is known, does not
  count.
* f' is that of f = F . R e_3, with F' from the tick before: f' = F' . R e_3 + F . (W x R e_3), W = R Omega.

Memory comes in and goes out. `thrust` of `load_position` is what the rotors give at this instant, which the
caller knows better than the law: `autopilot.actuation`.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.command_filter import (
    FilterConstants,
    FilterState,
    filter_acceleration,
    filter_start,
    filter_step,
)
from autopilot.control.direction_jet import direction_jet, position_jet
from autopilot.control.load_attitude import load_attitude_force, normal_force_tracking, thrust_along
from autopilot.control.load_motion import Drag, air_force, load_motion
from autopilot.control.quad_attitude import AttitudeCommand, attitude_from_axes, attitude_moment
from autopilot.control.records import Command, Jet, Reference, State, Vehicle
from autopilot.control.thesis import attitude_towards
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, apply, axpy, column, cross, dot, norm, scale, sub
from missions.flatness import unit_derivatives_4

OMEGA_FORCE = 25.0  # rad/s
ZETA = 0.98

# N; a shorter force has no direction to follow, and a load falling freely no cable direction
_LEAST_FORCE = 1e-3
# sine of the least angle between heading and thrust axis at which R_c is differentiated
_LEAST_SINE = 1e-2


class PlumblineGains(NamedTuple):
    """Vectors are diagonals: of the body frame for k_R, k_Omega, of the world for k_x, k_v."""

    k_R: Vec3  # N m
    k_Omega: Vec3  # N m s
    k_q: float  # N
    k_omega: float  # N s
    k_x: Vec3  # N/m
    k_v: Vec3  # N s/m


class PlumblineMemory(NamedTuple):
    """All that load position remembers from one tick to the next."""

    force: FilterState  # of F - F_d
    thrust_rate: float  # f', N/s
    begun: float  # 0.0: nothing is remembered yet


PLUMBLINE_GAINS = PlumblineGains(
    k_R=(0.9, 0.9, 0.9),
    k_Omega=(0.1, 0.1, 0.1),
    k_q=3.9,
    k_omega=2.0,
    k_x=(6.0, 6.0, 6.0),
    k_v=(2.75, 2.75, 2.75),
)


@kernel
def start() -> PlumblineMemory:
    """Memory of a law that begins now: its first tick starts the filter at the force of that tick."""
    zero: Vec3 = (0.0, 0.0, 0.0)
    return PlumblineMemory(filter_start(zero, zero), 0.0, 0.0)


@kernel
def flat_force(jet: Jet, vehicle: Vehicle) -> tuple[Vec3, Vec3, Vec3]:
    """F_d, F_d', F_d'' (N, N/s, N/s^2): the force that flies the load along the jet exactly.

    The weight at rest where the jet asks for free fall, which has no such force.
    """
    mass = vehicle.quad_mass + vehicle.load_mass
    reach = vehicle.quad_mass * vehicle.cable_length
    pull: Vec3 = (jet[2][0], jet[2][1], jet[2][2] + vehicle.gravity)
    if mass * norm(pull) < _LEAST_FORCE:
        zero: Vec3 = (0.0, 0.0, 0.0)
        return (0.0, 0.0, mass * vehicle.gravity), zero, zero
    # q_d = -u
    _, _, u2, u3, u4 = unit_derivatives_4(pull, jet[3], jet[4], jet[5], jet[6])
    return (
        axpy(reach, u2, scale(mass, pull)),
        axpy(reach, u3, scale(mass, jet[3])),
        axpy(reach, u4, scale(mass, jet[4])),
    )


@kernel
def commanded_attitude(F: Vec3, F_dot: Vec3, F_ddot: Vec3, b1_d: Vec3, state: State) -> AttitudeCommand:
    """R_c of (3-27) with Omega_c, Omega_c'; without the rates where F vanishes or lies along the heading."""
    zero: Vec3 = (0.0, 0.0, 0.0)
    n = norm(F)
    if n < _LEAST_FORCE or norm(cross(F, b1_d)) < _LEAST_SINE * n:
        return AttitudeCommand(attitude_towards(F, b1_d, state.R), zero, zero)
    return attitude_from_axes(F, F_dot, F_ddot, b1_d, zero, zero)


@kernel
def load_position(
    memory: PlumblineMemory,
    state: State,
    reference: Reference,
    thrust: float,
    gains: PlumblineGains,
    force_filter: FilterConstants,
    drag: Drag,
    push: Vec3,
    vehicle: Vehicle,
) -> tuple[PlumblineMemory, Command]:
    """Load position mode: x_L follows the reference (3-43), (3-44), (3-31), (3-36).

    `thrust`, N: what the rotors give at this instant; `push`, N, world: what the air does to the vehicle
    besides drag in still air.
    """
    jet = reference.jet
    air = add(air_force(state.v_quad, drag), push)
    motion = load_motion(state, thrust, memory.thrust_rate, air, vehicle)
    position = position_jet(state, motion, jet, gains.k_x, gains.k_v, vehicle)
    q_c = direction_jet(position, state)
    direction = load_attitude_force(
        state.q_cable,
        state.q_cable_dot,
        q_c,
        normal_force_tracking(state.q_cable, position.A),
        gains.k_q,
        gains.k_omega,
        vehicle.quad_mass,
        vehicle.cable_length,
    )
    F = sub(direction.F, air)

    F_d, F_d_dot, F_d_ddot = flat_force(jet, vehicle)
    rest = sub(F, F_d)
    zero: Vec3 = (0.0, 0.0, 0.0)
    force = filter_step(memory.force, rest, force_filter) if memory.begun != 0.0 else filter_start(rest, zero)
    F_dot = add(F_d_dot, force.x2)
    F_ddot = add(F_d_ddot, filter_acceleration(force, force_filter))

    attitude = commanded_attitude(F, F_dot, F_ddot, reference.b1_d, state)
    result = attitude_moment(
        state.R, state.omega_body, attitude, gains.k_R, gains.k_Omega, 1.0, vehicle.inertia
    )
    b3 = column(state.R, 2)
    b3_dot = cross(apply(state.R, state.omega_body), b3)
    command = Command(
        thrust_along(F, state.R),
        result.moment,
        position.e_x,
        position.e_v,
        direction.e_q,
        direction.e_q_dot,
        result.e_R,
        result.e_Omega,
        result.psi_R,
        direction.psi_q,
        q_c.q_c,
        attitude.R_c,
    )
    return PlumblineMemory(force, dot(F_dot, b3) + dot(F, b3_dot), 1.0), command
