"""Load attitude: the force that turns the cable towards q_c, (3-27)-(3-35).

| symbol      | code name              | frame | unit       | equation       |
|-------------|------------------------|-------|------------|----------------|
| q, q'       | q_cable, q_cable_dot   | I     | , 1/s      | (2-9), (2-32)  |
| q_d, q_c    | q_c                    | I     |            | (3-8), (3-42)  |
| q_c', q_c'' | q_c_dot, q_c_ddot      | I     | 1/s, 1/s^2 | 4-3            |
| e_q         | e_q                    | I     |            | (3-10)         |
| e_q'        | e_q_dot                | I     | 1/s        | (3-11)         |
| Psi_q       | psi_q                  |       |            | (3-8)          |
| k_q, k_w    | k_q, k_omega           |       | N, N s     | (3-33)         |
| F_n         | F_n                    | I     | N          | (3-32), (3-44) |
| F_pd        | F_pd                   | I     | N          | (3-33)         |
| F_ff        | F_ff                   | I     | N          | (3-34)         |
| F           | F                      | I     | N          | (3-31)         |
| f           | f                      |       | N          | (3-35)         |
| m_Q, L      | quad_mass, cable_length|       | kg, m      | (2-36)         |

Why the signs of (3-31) are what they are: (2-36) says that across the cable m_Q L q'' = -F, for q x (q x F)
is minus the part of F normal to q. The direction error e_q = q x (q x q_d) points away from q_d. To follow,
the cable needs m_Q L q'' = -k_q e_q - k_w e_q' + (feed-forward) = F_pd + F_ff, and the vehicle must push the
other way: F = F_n - F_pd - F_ff. The feed-forward cancels the part of e_q'' besides q'', and the printed
(3-34) is right: with w_d = q_d x q_d', (w_d x q)' across q is (q . w_d)(q x q') + w_d' x q.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.records import State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, add, column, cross, dot, scale, sub
from autopilot.geometry.s2 import direction_error, direction_rate_error, psi_direction


class DirectionCommand(NamedTuple):
    """A commanded cable direction with two derivatives, world frame."""

    q_c: Vec3
    q_c_dot: Vec3  # 1/s
    q_c_ddot: Vec3  # 1/s^2


class DirectionResult(NamedTuple):
    """The force that the vehicle should exert, and the errors that it corrects; world frame."""

    F: Vec3  # N
    e_q: Vec3
    e_q_dot: Vec3  # 1/s
    psi_q: float


@kernel
def load_attitude_force(
    q_cable: Vec3,
    q_cable_dot: Vec3,
    command: DirectionCommand,
    F_n: Vec3,
    k_q: float,
    k_omega: float,
    quad_mass: float,
    cable_length: float,
) -> DirectionResult:
    """F of (3-31), given its part along the cable F_n: (3-32) or (3-44), see `normal_force_*`."""
    q_c, q_c_dot, q_c_ddot = command.q_c, command.q_c_dot, command.q_c_ddot
    e_q = direction_error(q_cable, q_c)
    e_q_dot = direction_rate_error(q_cable, q_cable_dot, q_c, q_c_dot)
    F_pd = add(scale(-k_q, e_q), scale(-k_omega, e_q_dot))
    m_Q_L = quad_mass * cable_length
    turning = dot(q_cable, cross(q_c, q_c_dot))
    F_ff = add(
        scale(m_Q_L * turning, cross(q_cable, q_cable_dot)),
        scale(m_Q_L, cross(cross(q_c, q_c_ddot), q_cable)),
    )
    F = sub(sub(F_n, F_pd), F_ff)
    return DirectionResult(F, e_q, e_q_dot, psi_direction(q_cable, q_c))


@kernel
def normal_force_held(q_cable: Vec3, q_c: Vec3, pull: float) -> Vec3:
    """F_n of (3-32), for the load attitude mode: -(q_d . q) q, times a pull in N.

    The printed formula has no unit: as it stands it is a force of 1 N, which lets a vehicle of 4.9 N fall.
    The pull is what the vehicle has to lift (`height.cable_pull`), so that the mode can be held; 1.0 gives
    the printed law.
    """
    return scale(-pull * dot(q_c, q_cable), q_cable)


@kernel
def held_attitude_force(
    state: State, command: DirectionCommand, pull: float, k_q: float, k_omega: float, vehicle: Vehicle
) -> DirectionResult:
    """F of (3-31) for the load attitude mode, with F_n of `normal_force_held`."""
    return load_attitude_force(
        state.q_cable,
        state.q_cable_dot,
        command,
        normal_force_held(state.q_cable, command.q_c, pull),
        k_q,
        k_omega,
        vehicle.quad_mass,
        vehicle.cable_length,
    )


@kernel
def normal_force_tracking(q_cable: Vec3, A: Vec3) -> Vec3:
    """F_n of (3-44), for the load position mode: (A . q) q."""
    return scale(dot(A, q_cable), q_cable)


@kernel
def thrust_along(F: Vec3, R: Mat3) -> float:
    """f of (3-35): F . R e_3. Negative if the vehicle is upside down relative to the force; the mixer
    then limits it."""
    return dot(F, column(R, 2))
