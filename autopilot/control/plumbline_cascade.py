"""The law `plumbline`: the cascade of the thesis with exact derivatives in place of its command filters.

    x_d .. x_d'''' --> A, A', A'' (3-43) -> q_c, q_c', q_c'' (3-42) -> F (3-31) -> R_c (3-27) -+-> M (3-36),
    the same a moment before and after, along the motion of the model --> F', F'' --------------+   f (3-35)

| symbol         | code name     | value    | unit       | equation |
|----------------|---------------|----------|------------|----------|
| k_R, k_Omega   | k_R, k_Omega  | `design` | N m, N m s | (3-21)   |
| k_q, k_w       | k_q, k_omega  | `design` | N, N s     | (3-33)   |
| k_x, k_v       | k_x, k_v      | `design` | N/m, N s/m | (3-43)   |
| e_i, k_i       | integral, k_i | `design` | m s, N/m/s | e_i' = e_x |
| F              | F             |          | N          | (3-31)   |
| f, f'          | thrust, thrust_rate |    | N, N/s     | (3-35)   |
| D              | air           | `PLB_DRAG`, `PLB_DRAG_2` | N | drag and wind on the vehicle |

What the thesis filters is computed here:

* e_x, e_v and all that follows are computed from the reference itself, with its derivatives up to the sixth.
* q_c' and q_c'' are those of (3-42) along the motion of the load under the commanded pull
  (`direction_jet`), including the feedback.
* F' and F'' are differences of F along the motion of the model, under the thrust and moment that the rotors
  give now. The second derivative of this thrust is left out: on the path F hardly depends on it. Near hover F
  depends on load and cable alone, F' also on the attitude, F'' also on the body rate; the poles are therefore
  those of the three loops, each by itself (`design`). R_c, Omega_c, Omega_c' follow from F, F', F'' exactly.
* The rotors are commanded F - D, which cancels the air's force D on the vehicle as far as it is known.
* While the load is lifted, it is followed more slowly: the bandwidths of load and cable are multiplied by
  `pace`.
* Load attitude begins with q_c and three derivatives in place of A.
* f' is the derivative of f = F . R e_3, computed at the tick before: f' = F' . R e_3 + F . (W x R e_3) with
  W = R Omega.

Memory is passed in and returned. `thrust` of `load_position` is what the rotors give at this instant, which
the caller takes from `autopilot.control.actuators.rotor_model`.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from autopilot.control.direction_jet import PositionJet, direction_jet, position_jet, with_min_upward
from autopilot.control.drag import Drag, drag_force
from autopilot.control.load_attitude import (
    DirectionCommand,
    DirectionResult,
    held_attitude_force,
    load_attitude_force,
    normal_force_tracking,
    thrust_along,
)
from autopilot.control.load_motion import LoadMotion, load_motion
from autopilot.control.quad_attitude import AttitudeCommand, attitude_from_axes, attitude_moment
from autopilot.control.records import Command, HeadingReference, Jet, Reference, State, Vehicle
from autopilot.control.thesis_cascade import attitude_towards
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    Vec3,
    add,
    add3,
    apply,
    axpy,
    column,
    cross,
    dot,
    mul,
    norm,
    scale,
    sub,
    times,
)
from autopilot.geometry.rigid_body import angular_accel
from autopilot.geometry.s2 import normalise, tangent, unit_derivatives
from autopilot.geometry.so3 import exp
from autopilot.vehicle.rotors import MAX_TURN_RATE

# s, of the differences along the motion: truncation and rounding both below 1e-3 N/s^2
DIFFERENCE_STEP = 2e-3

MAX_INTEGRAL_SHARE = 0.05  # of the weight: what the integral of the error may ask for

# N; a smaller force has no direction to follow, and a freely falling load has no cable direction
_MIN_FORCE = 1e-3
# sine of the least angle between heading and thrust axis at which R_c is differentiated
_MIN_SINE = 1e-2
# tangent of the greatest lean, 70 deg, and the least upward force, in weights of the vehicle
_MAX_LEAN_TANGENT = 2.7
_MIN_LIFT = 0.2
# of the pull along the cable: the greatest force across it for errors, besides that for the reference
MAX_ACROSS_SHARE = 0.7
_PACE_RISE_TIME = 0.3  # s, in which the pace of load and cable would rise from nothing to full
_FULL_RANGE_TIME = 0.1  # s, shortest time in which the thrust is assumed to pass through its whole range


class PlumblineGains(NamedTuple):
    """Vectors are diagonals: of the body frame for k_R, k_Omega, of the world for k_x, k_v."""

    k_R: Vec3  # N m
    k_Omega: Vec3  # N m s
    k_q: float  # N
    k_omega: float  # N s
    k_x: Vec3  # N/m
    k_v: Vec3  # N s/m
    k_i: Vec3  # N/m/s


class PlumblineMemory(NamedTuple):
    """All that load position remembers from one tick to the next."""

    thrust_rate: float  # f', N/s
    integral: Vec3  # e_i, of e_x, m s
    pace: float  # factor on the bandwidths of load and cable; 1: as designed


class CommandedForce(NamedTuple):
    """The force that the vehicle should exert, and what it is made from."""

    F: Vec3  # N, world
    position: PositionJet
    direction: DirectionResult
    q_c: DirectionCommand


@kernel
def start() -> PlumblineMemory:
    """Memory of a law that begins now: the thrust is assumed to be steady."""
    return PlumblineMemory(0.0, (0.0, 0.0, 0.0), 1.0)


@kernel
def smooth_limit(v: Vec3, limit: float) -> Vec3:
    """v, shortened smoothly to less than `limit`: by 0.2 % where v is 0.3 times as long as that."""
    share = dot(v, v) / max(limit * limit, _MIN_FORCE * _MIN_FORCE)
    return scale(1.0 / sqrt(sqrt(1.0 + share * share)), v)


@kernel
def limit_length(v: Vec3, limit: float) -> Vec3:
    """v, shortened to `limit` where it is longer."""
    n = norm(v)
    return v if n <= limit else scale(limit / n, v)


@kernel
def with_pace(gains: PlumblineGains, pace: float) -> PlumblineGains:
    """The gains with `pace` times the bandwidth in the loops of load and cable."""
    square = pace * pace
    return PlumblineGains(
        gains.k_R,
        gains.k_Omega,
        square * gains.k_q,
        pace * gains.k_omega,
        scale(square, gains.k_x),
        scale(pace, gains.k_v),
        scale(pace * square, gains.k_i),
    )


@kernel
def max_level_moment(vehicle: Vehicle) -> float:
    """N m, the greatest about a level axis beside half of the greatest thrust."""
    return 0.5 * vehicle.moment_per_force * vehicle.arm * (vehicle.rotor_max - vehicle.rotor_min)


@kernel
def commanded_attitude(
    F: Vec3, F_dot: Vec3, F_ddot: Vec3, heading: HeadingReference, state: State, vehicle: Vehicle
) -> AttitudeCommand:
    """R_c of (3-27) with Omega_c, Omega_c', no faster than the rotors can turn the vehicle.

    Without the rates where F vanishes, lies along the heading or leans more than the vehicle may.
    """
    zero: Vec3 = (0.0, 0.0, 0.0)
    b1_d = heading.b1_d
    sideways = norm((F[0], F[1], 0.0))
    upward = max(F[2], _MIN_LIFT * vehicle.quad_mass * vehicle.gravity)
    if sideways > _MAX_LEAN_TANGENT * upward:
        shrink = _MAX_LEAN_TANGENT * upward / sideways
        return AttitudeCommand(
            attitude_towards((shrink * F[0], shrink * F[1], upward), b1_d, state.R), zero, zero
        )
    n = norm(F)
    if n < _MIN_FORCE or norm(cross(F, b1_d)) < _MIN_SINE * n:
        return AttitudeCommand(attitude_towards(F, b1_d, state.R), zero, zero)
    attitude = attitude_from_axes(F, F_dot, F_ddot, b1_d, heading.b1_d_dot, heading.b1_d_ddot)
    J = max(vehicle.inertia[0], vehicle.inertia[1])
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    return AttitudeCommand(
        attitude.R_c,
        limit_length(attitude.Omega_c, MAX_TURN_RATE * min(1.0, n / weight)),
        limit_length(
            attitude.Omega_c_dot,
            max_level_moment(vehicle) / J,
        ),
    )


@kernel
def shifted_jet(jet: Jet, h: float) -> Jet:
    """The reference h seconds later, extrapolated from its six derivatives."""
    h2, h3, h4 = 0.5 * h * h, h * h * h / 6.0, h * h * h * h / 24.0
    x, v, a, j, s, c, p = jet
    return (
        add(add3(x, scale(h, v), scale(h2, a)), add(scale(h3, j), scale(h4, s))),
        add(add3(v, scale(h, a), scale(h2, j)), add(scale(h3, s), scale(h4, c))),
        add(add3(a, scale(h, j), scale(h2, s)), add(scale(h3, c), scale(h4, p))),
        add(add3(j, scale(h, s), scale(h2, c)), scale(h3, p)),
        add3(s, scale(h, c), scale(h2, p)),
        axpy(h, p, c),
        p,
    )


@kernel
def shifted_state(state: State, motion: LoadMotion, omega_dot: Vec3, h: float, vehicle: Vehicle) -> State:
    """The state h seconds later along the motion of the model; `omega_dot` is Omega', rad/s^2, body."""
    h2 = 0.5 * h * h
    q = normalise(add3(state.q_cable, scale(h, state.q_cable_dot), scale(h2, motion.q_ddot)))
    q_dot = add3(state.q_cable_dot, scale(h, motion.q_ddot), scale(h2, motion.q_dddot))
    x = add3(state.x_load, scale(h, state.v_load), scale(h2, motion.a_load))
    v = add3(state.v_load, scale(h, motion.a_load), scale(h2, motion.j_load))
    L = vehicle.cable_length
    return State(
        x,
        v,
        q,
        q_dot,
        add(state.x_quad, sub(sub(x, state.x_load), scale(L, sub(q, state.q_cable)))),
        add(state.v_quad, sub(sub(v, state.v_load), scale(L, sub(q_dot, state.q_cable_dot)))),
        mul(state.R, exp(add(scale(h, state.omega_body), scale(h2, omega_dot)))),
        axpy(h, omega_dot, state.omega_body),
        state.a_quad,
    )


@kernel
def reference_force_across(q_cable: Vec3, jet: Jet, vehicle: Vehicle) -> Vec3:
    """The force across the cable that the reference itself needs, N: -m_Q L q_d'', at most the weight."""
    mass = vehicle.quad_mass + vehicle.load_mass
    # q_d = -lift / |lift|
    lift, jerk, snap = with_min_upward(
        (jet[2][0], jet[2][1], jet[2][2] + vehicle.gravity), jet[3], jet[4], vehicle.gravity
    )
    _, _, u_ddot = unit_derivatives(lift, jerk, snap)
    m_Q_L = vehicle.quad_mass * vehicle.cable_length
    return smooth_limit(scale(m_Q_L, tangent(q_cable, u_ddot)), mass * vehicle.gravity)


@kernel
def commanded_force(
    state: State,
    motion: LoadMotion,
    air: Vec3,
    jet: Jet,
    e_i: Vec3,
    gains: PlumblineGains,
    vehicle: Vehicle,
) -> CommandedForce:
    """F of (3-31), with drag and wind compensated, and what it is made from."""
    position = position_jet(state, motion, jet, e_i, gains.k_i, gains.k_x, gains.k_v, vehicle)
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
    along = dot(state.q_cable, direction.F)
    pull = scale(along, state.q_cable)
    reference_force = reference_force_across(state.q_cable, jet, vehicle)
    across = smooth_limit(sub(sub(direction.F, pull), reference_force), MAX_ACROSS_SHARE * norm(position.A))
    return CommandedForce(sub(add3(pull, reference_force, across), air), position, direction, q_c)


@kernel
def shifted_force(
    state: State,
    motion: LoadMotion,
    omega_dot: Vec3,
    f: float,
    f_dot: float,
    jet: Jet,
    e_i: Vec3,
    h: float,
    gains: PlumblineGains,
    drag: Drag,
    push: Vec3,
    vehicle: Vehicle,
) -> Vec3:
    """F, N, as it will be h seconds later, while the thrust f (N) changes by f' (N/s)."""
    later = shifted_state(state, motion, omega_dot, h, vehicle)
    air = add(drag_force(later.v_quad, drag), push)
    later_motion = load_motion(later, f + h * f_dot, f_dot, air, vehicle)
    e_x, e_v = sub(state.x_load, jet[0]), sub(state.v_load, jet[1])
    later_integral = add3(e_i, scale(h, e_x), scale(0.5 * h * h, e_v))
    return commanded_force(later, later_motion, air, shifted_jet(jet, h), later_integral, gains, vehicle).F


@kernel
def differences(F_before: Vec3, F: Vec3, F_after: Vec3) -> tuple[Vec3, Vec3]:
    """F' and F'' (N/s, N/s^2) from F, and from F a DIFFERENCE_STEP before and after."""
    F_dot = scale(0.5 / DIFFERENCE_STEP, sub(F_after, F_before))
    F_ddot = scale(1.0 / (DIFFERENCE_STEP * DIFFERENCE_STEP), sub(add(F_after, F_before), scale(2.0, F)))
    return F_dot, F_ddot


@kernel
def commanded_thrust_rate(F: Vec3, F_dot: Vec3, state: State, vehicle: Vehicle) -> float:
    """f', N/s: the derivative of F . R e_3, no faster than the rotors pass through their range."""
    b3 = column(state.R, 2)
    b3_dot = cross(apply(state.R, state.omega_body), b3)
    limit = vehicle.thrust_per_force * (vehicle.rotor_max - vehicle.rotor_min) / _FULL_RANGE_TIME
    return min(limit, max(-limit, dot(F_dot, b3) + dot(F, b3_dot)))


@kernel
def command_of(
    F: Vec3,
    attitude: AttitudeCommand,
    e_x: Vec3,
    e_v: Vec3,
    direction: DirectionResult,
    q_c: Vec3,
    state: State,
    gains: PlumblineGains,
    vehicle: Vehicle,
) -> Command:
    """The command (3-35), (3-36) that exerts F, with the errors that F corrects."""
    result = attitude_moment(
        state.R, state.omega_body, attitude, gains.k_R, gains.k_Omega, 1.0, vehicle.inertia
    )
    return Command(
        thrust_along(F, state.R),
        result.moment,
        e_x,
        e_v,
        direction.e_q,
        direction.e_q_dot,
        result.e_R,
        result.e_Omega,
        result.psi_R,
        direction.psi_q,
        q_c,
        attitude.R_c,
    )


@kernel
def load_position(
    memory: PlumblineMemory,
    state: State,
    reference: Reference,
    thrust: float,
    moment: Vec3,
    gains: PlumblineGains,
    drag: Drag,
    push: Vec3,
    period: float,
    vehicle: Vehicle,
) -> tuple[PlumblineMemory, Command]:
    """Load position mode: x_L follows the reference (3-43), (3-44), (3-31), (3-36).

    `thrust`, N, and `moment`, N m: what the rotors give at this instant; `push`, N, world: force of the
    air on the vehicle besides drag in still air; `period`, s, is that of the law.
    """
    jet = reference.jet
    gains = with_pace(gains, memory.pace)
    air = add(drag_force(state.v_quad, drag), push)
    motion = load_motion(state, thrust, memory.thrust_rate, air, vehicle)
    commanded = commanded_force(state, motion, air, jet, memory.integral, gains, vehicle)
    F, position, direction = commanded.F, commanded.position, commanded.direction

    omega_dot = angular_accel(state.omega_body, moment, vehicle.inertia)
    F_after = shifted_force(
        state,
        motion,
        omega_dot,
        thrust,
        memory.thrust_rate,
        jet,
        memory.integral,
        DIFFERENCE_STEP,
        gains,
        drag,
        push,
        vehicle,
    )
    F_before = shifted_force(
        state,
        motion,
        omega_dot,
        thrust,
        memory.thrust_rate,
        jet,
        memory.integral,
        -DIFFERENCE_STEP,
        gains,
        drag,
        push,
        vehicle,
    )
    F_dot, F_ddot = differences(F_before, F, F_after)
    heading = HeadingReference(reference.b1_d, reference.b1_d_dot, reference.b1_d_ddot)
    attitude = commanded_attitude(F, F_dot, F_ddot, heading, state, vehicle)
    command = command_of(
        F, attitude, position.e_x, position.e_v, direction, commanded.q_c.q_c, state, gains, vehicle
    )
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    integral = axpy(period, position.e_x, memory.integral)
    integral_force = norm(times(gains.k_i, integral))
    if integral_force > MAX_INTEGRAL_SHARE * weight:
        integral = scale(MAX_INTEGRAL_SHARE * weight / integral_force, integral)
    pace = min(1.0, memory.pace + period / _PACE_RISE_TIME)
    return PlumblineMemory(commanded_thrust_rate(F, F_dot, state, vehicle), integral, pace), command


@kernel
def shifted_direction(command: DirectionCommand, q_c_dddot: Vec3, h: float) -> DirectionCommand:
    """The commanded direction h seconds later, extrapolated from its three derivatives."""
    q_c, q_c_dot, q_c_ddot = command.q_c, command.q_c_dot, command.q_c_ddot
    return DirectionCommand(
        normalise(add3(q_c, scale(h, q_c_dot), scale(0.5 * h * h, q_c_ddot))),
        add3(q_c_dot, scale(h, q_c_ddot), scale(0.5 * h * h, q_c_dddot)),
        axpy(h, q_c_dddot, q_c_ddot),
    )


@kernel
def held_direction(
    state: State, q_c: DirectionCommand, pull: float, gains: PlumblineGains, vehicle: Vehicle
) -> DirectionResult:
    """F of (3-31) with (3-32) scaled by `pull`, N; its part across the cable is limited."""
    direction = held_attitude_force(state, q_c, pull, gains.k_q, gains.k_omega, vehicle)
    along = scale(dot(state.q_cable, direction.F), state.q_cable)
    across = smooth_limit(sub(direction.F, along), MAX_ACROSS_SHARE * abs(pull))
    return DirectionResult(add(along, across), direction.e_q, direction.e_q_dot, direction.psi_q)


@kernel
def load_attitude(
    memory: PlumblineMemory,
    state: State,
    q_c: DirectionCommand,
    q_c_dddot: Vec3,
    b1_d: Vec3,
    pull: float,
    thrust: float,
    moment: Vec3,
    gains: PlumblineGains,
    drag: Drag,
    push: Vec3,
    vehicle: Vehicle,
) -> tuple[PlumblineMemory, Command]:
    """Load attitude mode: q follows q_c (3-31), (3-36), with (3-32) scaled by `pull` in N.

    `thrust`, N, `moment`, N m, and `push`, N, as in `load_position`.
    """
    air = add(drag_force(state.v_quad, drag), push)
    motion = load_motion(state, thrust, memory.thrust_rate, air, vehicle)
    omega_dot = angular_accel(state.omega_body, moment, vehicle.inertia)
    h = DIFFERENCE_STEP
    after = shifted_state(state, motion, omega_dot, h, vehicle)
    before = shifted_state(state, motion, omega_dot, -h, vehicle)
    direction = held_direction(state, q_c, pull, gains, vehicle)
    F = direction.F
    F_dot, F_ddot = differences(
        held_direction(before, shifted_direction(q_c, q_c_dddot, -h), pull, gains, vehicle).F,
        F,
        held_direction(after, shifted_direction(q_c, q_c_dddot, h), pull, gains, vehicle).F,
    )
    zero: Vec3 = (0.0, 0.0, 0.0)
    attitude = commanded_attitude(F, F_dot, F_ddot, HeadingReference(b1_d, zero, zero), state, vehicle)
    command = command_of(F, attitude, zero, zero, direction, q_c.q_c, state, gains, vehicle)
    thrust_rate = commanded_thrust_rate(F, F_dot, state, vehicle)
    return PlumblineMemory(thrust_rate, memory.integral, memory.pace), command
