"""Vehicle position, for the phases in which the cable is slack: take-off, set-down, a load on the ground.

| symbol      | code name    | frame | unit       | equation |
|-------------|--------------|-------|------------|----------|
| x_Q, v_Q    | x_quad, v_quad | I   | m, m/s     | (2-14)   |
| e_x, e_v    | e_x, e_v     | I     | m, m/s     | of the vehicle |
| k_x, k_v    | k_x, k_v     | I     | N/m, N s/m |          |
| m           | carried_mass + quad_mass | | kg   |          |
| F           | F            | I     | N          | F = -k_x e_x - k_v e_v + m (a_d + g e_3) |

The law is the one the thesis names for a vehicle without load [12]: F gives the thrust f = F . R e_3 (3-35)
and the thrust axis of R_c (3-27), which passes through the same command filter to the same attitude loop
(3-36).
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.load_attitude import thrust_along
from autopilot.control.records import Command, Reference, State, Vehicle
from autopilot.control.thesis_cascade import (
    ThesisFilters,
    ThesisGains,
    ThesisMemory,
    attitude_towards,
    quad_attitude,
    with_errors,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, norm, scale, sub, times

MAX_LEAN_TANGENT = 1.0  # tan 45 deg
# least and greatest upward force, in weights. The greatest is also enough to carry the load, because a cable
# may count as taut only when it pulls with most of the load's weight
_MIN_LIFT = 0.2
_MAX_LIFT = 1.6
# in weights: a vehicle that should lift less leans no more than one that lifts this. One that stands in the
# wind would otherwise lean the more the less it lifts, until the wind turns it over
_LEANING_LIFT = 0.8


class QuadPositionGains(NamedTuple):
    """Diagonals in the world frame."""

    k_x: Vec3  # N/m
    k_v: Vec3  # N s/m


# For 0.4 kg: 2.5 rad/s and damping 0.9 sideways, 4 rad/s up; see docs/control.md for the margin
QUAD_POSITION_GAINS = QuadPositionGains(k_x=(2.5, 2.5, 6.4), k_v=(1.8, 1.8, 3.0))


@kernel
def position_force(
    x_quad: Vec3,
    v_quad: Vec3,
    x_d: Vec3,
    v_d: Vec3,
    a_d: Vec3,
    gains: QuadPositionGains,
    mass: float,
    gravity: float,
) -> Vec3:
    """F, N, world frame, unlimited."""
    feedback = sub(scale(-1.0, times(gains.k_x, sub(x_quad, x_d))), times(gains.k_v, sub(v_quad, v_d)))
    return add(feedback, (mass * a_d[0], mass * a_d[1], mass * (a_d[2] + gravity)))


@kernel
def leaning_lift(up: float, weight: float) -> float:
    """The upward force (N) for which the vehicle leans that should lift `up`."""
    return max(up, _LEANING_LIFT * weight)


@kernel
def limited_force(F: Vec3, weight: float, carrying_lift: float) -> Vec3:
    """F with an upward part of 0.2 to 1.6 weights, or to `carrying_lift` (N) if that is more, for which the
    vehicle leans no more than 45 deg."""
    up = min(max(_MAX_LIFT * weight, carrying_lift), max(_MIN_LIFT * weight, F[2]))
    sideways = norm((F[0], F[1], 0.0))
    shrink = min(1.0, MAX_LEAN_TANGENT * leaning_lift(up, weight) / max(sideways, 1e-9))
    return (shrink * F[0], shrink * F[1], up)


@kernel
def quad_position(
    memory: ThesisMemory,
    state: State,
    reference: Reference,
    carried_mass: float,
    push: Vec3,
    position_gains: QuadPositionGains,
    gains: ThesisGains,
    filters: ThesisFilters,
    vehicle: Vehicle,
) -> tuple[ThesisMemory, Command]:
    """x_Q follows the reference, whose velocity and acceleration are used as given.

    `carried_mass`, kg, is what hangs on the vehicle: 0 while the cable is slack, the load's mass when it is
    not; `push`, N, world, is the assumed force of the wind on the vehicle. e_x, e_v of the command are
    errors of the vehicle. Only the attitude filters of the memory are used.
    """
    x_d, v_d, a_d = reference.jet[0], reference.jet[1], reference.jet[2]
    mass = vehicle.quad_mass + carried_mass
    unlimited = position_force(
        state.x_quad, state.v_quad, x_d, v_d, a_d, position_gains, mass, vehicle.gravity
    )
    weight = mass * vehicle.gravity
    carrying_lift = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    F = limited_force(sub(unlimited, push), weight, carrying_lift)
    R_c = attitude_towards((F[0], F[1], leaning_lift(F[2], weight)), reference.b1_d, state.R)
    memory, command = quad_attitude(memory, state, R_c, thrust_along(F, state.R), gains, filters, vehicle)
    zero: Vec3 = (0.0, 0.0, 0.0)
    return memory, with_errors(
        command, sub(state.x_quad, x_d), sub(state.v_quad, v_d), zero, zero, 0.0, state.q_cable
    )
