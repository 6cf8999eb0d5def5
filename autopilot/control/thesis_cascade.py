"""The thesis's cascade with its command filters (4-3), in its three flight modes, each usable alone (3-2).

    load_position:  x_d -> filter -> (3-43) A -> (3-42) q_c -> filter -+
    load_attitude:                                      q_d -> filter -+-> (3-31) F -> (3-27) R_c -+
    quad_attitude:                                                                            R_d -+
                                           -> R_c, and R_c', R_c'' by filter -> (3-36) M, (3-35) f

| symbol          | code name       | value          | unit       | equation |
|-----------------|-----------------|----------------|------------|----------|
| k_R, k_Omega    | k_R, k_Omega    | 0.9, 0.1       | N m, N m s | (3-21)   |
| epsilon         | epsilon         | 1              |            | (3-21)   |
| k_q, k_w        | k_q, k_omega    | 3.9, 2         | N, N s     | (3-33)   |
| k_x, k_v        | k_x, k_v        | 6, 2.75        | N/m, N s/m | (3-43)   |
| omega_n of R    | attitude        | 30             | rad/s      | (4-3)    |
| omega_n of q    | direction       | 25             | rad/s      | (4-3)    |
| omega_n of x_d  | reference       | 25             | rad/s      | (4-3)    |
| zeta            |                 | 0.98           |            | (4-3)    |

How the filtered values are used decides how the cascade flies, and the thesis leaves part of it open. Here:

* The errors e_x, e_v, e_q, e_q' are taken from the filtered commands, x_1 and x_2 of (4-2), as in Figure 4-5.
  The filtered q_c is normalised, q_c' and q_c'' are the exact derivatives of the normalised vector.
* The errors e_R and Psi_R are taken from R_c itself (3-27): nine filtered numbers are not a rotation. The
  filters give only R_c' and R_c'', as 4-3 says, for (3-28) and (3-18): Omega_c = vee(R_c^T R_c').

This gives the printed step response of Case A; benchmarks/thesis_assumptions.py has the other choices.

Memory is passed in and returned. A mode starts from `start`, at the present motion, so that no command jumps.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.command_filter import (
    FilterConstants,
    FilterState,
    filter_acceleration,
    filter_constants,
    filter_start,
    filter_step,
)
from autopilot.control.load_attitude import (
    DirectionCommand,
    held_attitude_force,
    load_attitude_force,
    normal_force_tracking,
    thrust_along,
)
from autopilot.control.load_position import computed_direction, load_position_force
from autopilot.control.quad_attitude import (
    AttitudeCommand,
    attitude_from_rates,
    attitude_moment,
    column_rates,
    heading_axis,
)
from autopilot.control.records import Command, Reference, State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, column, cross, from_columns, norm, scale
from autopilot.geometry.s2 import unit_derivatives

OMEGA_ATTITUDE = 30.0  # rad/s, 4-3
OMEGA_DIRECTION = 25.0
OMEGA_REFERENCE = 25.0
ZETA = 0.98

# A filtered unit vector shrinks while its command turns fast; below this length its direction means nothing
_MIN_LENGTH = 0.1
# N; a smaller force has no direction to follow
_MIN_FORCE = 1e-3


class ThesisGains(NamedTuple):
    """Gains of Table 4-3. Vectors are diagonals: of the body frame for k_R, k_Omega, of the world for k_x,
    k_v."""

    k_R: Vec3  # N m
    k_Omega: Vec3  # N m s
    k_q: float  # N
    k_omega: float  # N s
    k_x: Vec3  # N/m
    k_v: Vec3  # N s/m
    epsilon: float


class ThesisFilters(NamedTuple):
    """Constants of the three command filters, for one control period."""

    attitude: FilterConstants
    direction: FilterConstants
    reference: FilterConstants


class ThesisMemory(NamedTuple):
    """All that the cascade remembers from one tick to the next."""

    reference: FilterState  # of x_d
    direction: FilterState  # of q_c
    b1: FilterState  # of the first column of R_c
    b2: FilterState  # of the second
    b3: FilterState  # of the third


THESIS_GAINS = ThesisGains(
    k_R=(0.9, 0.9, 0.9),
    k_Omega=(0.1, 0.1, 0.1),
    k_q=3.9,
    k_omega=2.0,
    k_x=(6.0, 6.0, 6.0),
    k_v=(2.75, 2.75, 2.75),
    epsilon=1.0,
)


def thesis_filters(
    dt: float,
    omega_attitude: float = OMEGA_ATTITUDE,
    omega_direction: float = OMEGA_DIRECTION,
    omega_reference: float = OMEGA_REFERENCE,
    zeta: float = ZETA,
) -> ThesisFilters:
    """Filter constants for the control period dt (s); natural frequencies in rad/s."""
    return ThesisFilters(
        filter_constants(omega_attitude, zeta, dt),
        filter_constants(omega_direction, zeta, dt),
        filter_constants(omega_reference, zeta, dt),
    )


@kernel
def start(state: State, x_d: Vec3, v_d: Vec3) -> ThesisMemory:
    """Memory of a cascade that begins now: filters at the present q and R with their rates, and at x_d,
    v_d."""
    R = state.R
    b1_dot, b2_dot, b3_dot = column_rates(R, state.omega_body)
    return ThesisMemory(
        filter_start(x_d, v_d),
        filter_start(state.q_cable, state.q_cable_dot),
        filter_start(column(R, 0), b1_dot),
        filter_start(column(R, 1), b2_dot),
        filter_start(column(R, 2), b3_dot),
    )


@kernel
def filtered_direction(
    memory: FilterState, q_raw: Vec3, constants: FilterConstants
) -> tuple[FilterState, DirectionCommand]:
    """The commanded cable direction, passed through its filter, with two derivatives."""
    memory = filter_step(memory, q_raw, constants)
    if norm(memory.x1) < _MIN_LENGTH:
        # the command has jumped by nearly half a turn: begin again from it
        memory = filter_start(q_raw, (0.0, 0.0, 0.0))
    q_c, q_c_dot, q_c_ddot = unit_derivatives(memory.x1, memory.x2, filter_acceleration(memory, constants))
    return memory, DirectionCommand(q_c, q_c_dot, q_c_ddot)


@kernel
def filtered_rates(
    memory: ThesisMemory, R_c: Mat3, constants: FilterConstants
) -> tuple[ThesisMemory, AttitudeCommand]:
    """The commanded attitude, with the rate and acceleration that its filter gives, element by element."""
    b1 = filter_step(memory.b1, column(R_c, 0), constants)
    b2 = filter_step(memory.b2, column(R_c, 1), constants)
    b3 = filter_step(memory.b3, column(R_c, 2), constants)
    R_c_dot = from_columns(b1.x2, b2.x2, b3.x2)
    R_c_ddot = from_columns(
        filter_acceleration(b1, constants),
        filter_acceleration(b2, constants),
        filter_acceleration(b3, constants),
    )
    memory = ThesisMemory(memory.reference, memory.direction, b1, b2, b3)
    return memory, attitude_from_rates(R_c, R_c_dot, R_c_ddot)


@kernel
def attitude_towards(F: Vec3, b1_d: Vec3, R: Mat3) -> Mat3:
    """R_c of (3-27): thrust axis along F (3-30), nose towards b1_d (3-29). Without a force the axis stays."""
    n = norm(F)
    b3_c = scale(1.0 / n, F) if n > _MIN_FORCE else column(R, 2)
    b1_c = heading_axis(b3_c, b1_d)
    b2_c = cross(b3_c, b1_c)
    return from_columns(b1_c, b2_c, b3_c)


@kernel
def quad_attitude(
    memory: ThesisMemory,
    state: State,
    R_d: Mat3,
    thrust: float,
    gains: ThesisGains,
    filters: ThesisFilters,
    vehicle: Vehicle,
) -> tuple[ThesisMemory, Command]:
    """Vehicle attitude mode: R follows R_d (3-21). The caller gives the thrust, N.

    Also the innermost loop of the other modes, which pass it their R_c: the moment is then (3-36).
    """
    memory, attitude = filtered_rates(memory, R_d, filters.attitude)
    result = attitude_moment(
        state.R, state.omega_body, attitude, gains.k_R, gains.k_Omega, gains.epsilon, vehicle.inertia
    )
    zero: Vec3 = (0.0, 0.0, 0.0)
    command = Command(
        thrust,
        result.moment,
        zero,
        zero,
        zero,
        zero,
        result.e_R,
        result.e_Omega,
        result.psi_R,
        0.0,
        state.q_cable,
        attitude.R_c,
    )
    return memory, command


@kernel
def with_errors(
    c: Command, e_x: Vec3, e_v: Vec3, e_q: Vec3, e_q_dot: Vec3, psi_q: float, q_c: Vec3
) -> Command:
    """The command of the innermost loop with the errors of the loops around it."""
    return Command(c.thrust, c.moment, e_x, e_v, e_q, e_q_dot, c.e_R, c.e_Omega, c.psi_R, psi_q, q_c, c.R_c)


@kernel
def load_attitude(
    memory: ThesisMemory,
    state: State,
    q_d: Vec3,
    b1_d: Vec3,
    pull: float,
    gains: ThesisGains,
    filters: ThesisFilters,
    vehicle: Vehicle,
) -> tuple[ThesisMemory, Command]:
    """Load attitude mode: q follows q_d (3-31), (3-36), with (3-32) scaled by `pull` in N."""
    zero: Vec3 = (0.0, 0.0, 0.0)
    direction_memory, q_c = filtered_direction(memory.direction, q_d, filters.direction)
    direction = held_attitude_force(state, q_c, pull, gains.k_q, gains.k_omega, vehicle)
    memory, command = quad_attitude(
        ThesisMemory(memory.reference, direction_memory, memory.b1, memory.b2, memory.b3),
        state,
        attitude_towards(direction.F, b1_d, state.R),
        thrust_along(direction.F, state.R),
        gains,
        filters,
        vehicle,
    )
    return memory, with_errors(
        command, zero, zero, direction.e_q, direction.e_q_dot, direction.psi_q, q_c.q_c
    )


@kernel
def load_position(
    memory: ThesisMemory,
    state: State,
    reference: Reference,
    gains: ThesisGains,
    filters: ThesisFilters,
    vehicle: Vehicle,
) -> tuple[ThesisMemory, Command]:
    """Load position mode: x_L follows the reference (3-43), (3-44), (3-31), (3-36).

    Only the position of the reference is used: as in the thesis, its derivatives come from the filter.
    """
    x = filter_step(memory.reference, reference.jet[0], filters.reference)
    position = load_position_force(
        state.x_load,
        state.v_load,
        state.q_cable,
        state.q_cable_dot,
        x.x1,
        x.x2,
        filter_acceleration(x, filters.reference),
        gains.k_x,
        gains.k_v,
        vehicle.quad_mass,
        vehicle.load_mass,
        vehicle.cable_length,
        vehicle.gravity,
    )
    q_raw = computed_direction(position.A) if norm(position.A) > _MIN_FORCE else state.q_cable
    direction_memory, q_c = filtered_direction(memory.direction, q_raw, filters.direction)
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
    memory, command = quad_attitude(
        ThesisMemory(x, direction_memory, memory.b1, memory.b2, memory.b3),
        state,
        attitude_towards(direction.F, reference.b1_d, state.R),
        thrust_along(direction.F, state.R),
        gains,
        filters,
        vehicle,
    )
    return memory, with_errors(
        command, position.e_x, position.e_v, direction.e_q, direction.e_q_dot, direction.psi_q, q_c.q_c
    )
