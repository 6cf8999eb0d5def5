"""The commanded cable direction with its derivatives: (3-42), (3-43) differentiated along the motion.

| symbol       | code name          | frame | unit          | equation |
|--------------|--------------------|-------|---------------|----------|
| A, A', A''   | A, A_dot, A_ddot   | I     | N, N/s, N/s^2 | (3-43)   |
| e_x, e_v     | e_x, e_v           | I     | m, m/s        | (3-12), (3-13) |
| e_a, e_j     | e_a, e_j           | I     | m/s^2, m/s^3  | e_v', e_v'' |
| x_d .. x_d'''' | jet[0] .. jet[4] | I     | m .. m/s^4    | (3-12)   |
| k_x, k_v     | k_x, k_v           | I     | N/m, N s/m    | (3-43)   |
| e_i, k_i     | e_i, k_i           | I     | m s, N/m/s    | e_i' = e_x |
| s            | s                  |       | 1/s^2         | q' . q'  |
| T            | T                  |       | N             | q . A - m_Q L s |
| q_d          |                    | I     |               | -(x_d'' + g e_3) / its length |

    A   = -k_i e_i - k_x e_x - k_v e_v + m (x_d'' + g e_3) + m_Q L s q
    A'  = -k_i e_x - k_x e_v - k_v e_a + m x_d'''          + m_Q L (s' q + s q')
    A'' = -k_i e_v - k_x e_a - k_v e_j + m x_d''''         + m_Q L (s'' q + 2 s' q' + s q'')

The feedback, k_i e_i + k_x e_x + k_v e_v, is bounded smoothly by half the weight (`saturated`).

The derivatives are those of a load that moves by (2-31) under the commanded pull T, not under the pull that
the rotors give at this instant:

    m (e_a + x_d'' + g e_3) = T q    m (e_j + x_d''') = T' q + T q'

and the swing is that of the reference: s' = 2 q_d' . q_d'', s'' = 2 q_d'' . q_d'' (the part with q_d''' is
left out). Of q'' in A'' only the part across the cable is used. On the reference this is exact, and across
the cable it is exact wherever the load is.

With the actual pull and swing all derivatives would be exact, but the loop would fail. Where the vehicle
leans against the cable, in wind or far from its path, T' is f times lean times body rate. With an error of
the direction, the commanded attitude then becomes a function of the body rate: at 17 deg of lean and 0.1 rad
of error this cancels all of the inertia that the attitude loop assumes, and the vehicle chases a commanded
attitude that runs away from it.

The derivatives of q_c = -A/|A| follow exactly. The thesis obtains them by a filter. With the derivatives of
the reference alone, without those of the errors, the cascade is unstable with the gains of the thesis.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from autopilot.control.load_attitude import DirectionCommand
from autopilot.control.load_motion import LoadMotion
from autopilot.control.load_position import load_position_force
from autopilot.control.records import Jet, State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add, add3, axpy, dot, norm, scale, sub, times
from autopilot.geometry.s2 import tangent, unit_derivatives

# of the weight: bound of the feedback, however great the errors are
MAX_FEEDBACK_SHARE = 0.5
# of the weight: an upward part of A above _UPRIGHT is unchanged, below _FALLING it is set to the mean of the
# two: a vehicle that falls with its load could not turn, and noise would decide where a short A points
_BLEND_END, _BLEND_START = 0.4, 0.1
_MIN_UPWARD = 0.5 * (_BLEND_END + _BLEND_START)
_BLEND_RANGE = _BLEND_END - _BLEND_START
# N; a smaller A has no direction to follow
_MIN_FORCE = 1e-3


class PositionJet(NamedTuple):
    """The force A of (3-43) with two derivatives, and the errors that it corrects; world frame."""

    A: Vec3  # N
    A_dot: Vec3  # N/s
    A_ddot: Vec3  # N/s^2
    e_x: Vec3  # m
    e_v: Vec3  # m/s


@kernel
def saturated(v: Vec3, v_dot: Vec3, v_ddot: Vec3, limit: float) -> tuple[Vec3, Vec3, Vec3]:
    """limit v / sqrt(limit^2 + v^2), which is v while v is small and never longer than `limit`; with its
    derivatives."""
    n = sqrt(limit * limit + dot(v, v))
    u = scale(1.0 / n, v)
    n_dot = dot(u, v_dot)
    u_dot = scale(1.0 / n, axpy(-n_dot, u, v_dot))
    n_ddot = dot(u_dot, v_dot) + dot(u, v_ddot)
    u_ddot = scale(1.0 / n, axpy(-2.0 * n_dot, u_dot, axpy(-n_ddot, u, v_ddot)))
    return scale(limit, u), scale(limit, u_dot), scale(limit, u_ddot)


@kernel
def with_min_upward(A: Vec3, A_dot: Vec3, A_ddot: Vec3, weight: float) -> tuple[Vec3, Vec3, Vec3]:
    """A with an upward part of at least a quarter of the weight (N), and its derivatives: A itself where the
    upward part is at least 0.4 of the weight, else less steep, with three continuous derivatives."""
    share = (A[2] - _BLEND_START * weight) / (_BLEND_RANGE * weight)
    if share >= 1.0:
        return A, A_dot, A_ddot
    t = max(share, 0.0)
    t3 = t * t * t
    upward = weight * (_MIN_UPWARD + _BLEND_RANGE * t3 * t * (2.5 - 3.0 * t + t * t))
    slope = t3 * (10.0 - 15.0 * t + 6.0 * t * t)
    curvature = 30.0 * t * t * (1.0 - t) * (1.0 - t) / (_BLEND_RANGE * weight)
    return (
        (A[0], A[1], upward),
        (A_dot[0], A_dot[1], slope * A_dot[2]),
        (A_ddot[0], A_ddot[1], slope * A_ddot[2] + curvature * A_dot[2] * A_dot[2]),
    )


@kernel
def reference_swing(jet: Jet, vehicle: Vehicle) -> tuple[float, float]:
    """s' (1/s^3) and s'' (1/s^4, without the part of the third derivative of q_d) on the reference."""
    upward = (jet[2][0], jet[2][1], jet[2][2] + vehicle.gravity)
    lift, lift_dot, lift_ddot = with_min_upward(upward, jet[3], jet[4], vehicle.gravity)
    _, u_dot, u_ddot = unit_derivatives(lift, lift_dot, lift_ddot)
    return 2.0 * dot(u_dot, u_ddot), 2.0 * dot(u_ddot, u_ddot)


@kernel
def position_jet(
    state: State,
    motion: LoadMotion,
    jet: Jet,
    e_i: Vec3,
    k_i: Vec3,
    k_x: Vec3,
    k_v: Vec3,
    vehicle: Vehicle,
) -> PositionJet:
    """A, A', A'' for a load that moves under the pull of A itself; gains are diagonals in the world frame.

    With k_i = 0 and small errors A is that of (3-43), except where that lets the load fall
    (`with_min_upward`).
    """
    q, q_dot = state.q_cable, state.q_cable_dot
    result = load_position_force(
        state.x_load,
        state.v_load,
        q,
        q_dot,
        jet[0],
        jet[1],
        jet[2],
        k_x,
        k_v,
        vehicle.quad_mass,
        vehicle.load_mass,
        vehicle.cable_length,
        vehicle.gravity,
    )
    mass = vehicle.quad_mass + vehicle.load_mass
    m_Q_L = vehicle.quad_mass * vehicle.cable_length
    weight = mass * vehicle.gravity
    limit = MAX_FEEDBACK_SHARE * weight
    s = dot(q_dot, q_dot)
    s_dot, s_ddot = reference_swing(jet, vehicle)

    feedback = add3(times(k_i, e_i), times(k_x, result.e_x), times(k_v, result.e_v))
    bounded, _, _ = saturated(feedback, ZERO, ZERO, limit)
    A_raw = sub(add3(result.A, times(k_x, result.e_x), times(k_v, result.e_v)), bounded)
    T = dot(q, A_raw) - m_Q_L * s
    e_a = sub(axpy(T / mass, q, (0.0, 0.0, -vehicle.gravity)), jet[2])

    feedback_dot = add3(times(k_i, result.e_x), times(k_x, result.e_v), times(k_v, e_a))
    _, bounded_dot, _ = saturated(feedback, feedback_dot, ZERO, limit)
    swing_dot = add(scale(s_dot, q), scale(s, q_dot))
    A_raw_dot = sub(add(scale(mass, jet[3]), scale(m_Q_L, swing_dot)), bounded_dot)
    T_dot = dot(q_dot, A_raw) + dot(q, A_raw_dot) - m_Q_L * s_dot
    e_j = sub(scale(1.0 / mass, add(scale(T_dot, q), scale(T, q_dot))), jet[3])

    feedback_ddot = add3(times(k_i, result.e_v), times(k_x, e_a), times(k_v, e_j))
    _, _, bounded_ddot = saturated(feedback, feedback_dot, feedback_ddot, limit)
    swing_ddot = add3(scale(s_ddot, q), scale(2.0 * s_dot, q_dot), scale(s, tangent(q, motion.q_ddot)))
    A_raw_ddot = sub(add(scale(mass, jet[4]), scale(m_Q_L, swing_ddot)), bounded_ddot)
    A, A_dot, A_ddot = with_min_upward(A_raw, A_raw_dot, A_raw_ddot, weight)
    return PositionJet(A, A_dot, A_ddot, result.e_x, result.e_v)


@kernel
def direction_jet(position: PositionJet, state: State) -> DirectionCommand:
    """q_c = -A/|A| with q_c' and q_c''; if A vanishes, the present direction at rest."""
    if norm(position.A) < _MIN_FORCE:
        zero: Vec3 = (0.0, 0.0, 0.0)
        return DirectionCommand(state.q_cable, zero, zero)
    u, u_dot, u_ddot = unit_derivatives(position.A, position.A_dot, position.A_ddot)
    return DirectionCommand(scale(-1.0, u), scale(-1.0, u_dot), scale(-1.0, u_ddot))
