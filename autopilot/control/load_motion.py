"""The motion of load and cable under the present thrust: (2-31), (2-36) and their time derivatives.

| symbol       | code name                | frame | unit    | equation |
|--------------|--------------------------|-------|---------|----------|
| f, f'        | thrust, thrust_rate      |       | N, N/s  | (3-35)   |
| D            | air                      | I     | N       | drag of the vehicle |
| F, F'        | F, F_dot                 | I     | N, N/s  | f R e_3 + D |
| W            | W                        | I     | rad/s   | R Omega  |
| q .. q'''    | q_cable .. q_dddot       | I     | , 1/s .. 1/s^3 | (2-36) |
| x_L'', x_L'''| a_load, j_load           | I     | m/s^2, m/s^3 | (2-31) |
| s            | s                        |       | 1/s^2   | q' . q'  |
| p            | p                        |       | N       | q . F    |
| T            | T                        |       | N       | p - m_Q L s |
| m            | mass                     |       | kg      | m_Q + m_L |
| m_Q L        | m_Q_L                    |       | kg m    |          |

F is all that acts on the vehicle besides weight and cable. With R' = R hat(Omega) (2-34), and D' left out,
which is a hundredth of the rest, F' = f' R e_3 + W x f R e_3. Then

    (2-31)    m (x_L'' + g e_3) = T q           m x_L''' = T' q + T q'
    (2-36)    m_Q L q'' = p q - F - m_Q L s q   m_Q L q''' = p' q + p q' - F' - m_Q L (s' q + s q')

with p' = q'.F + q.F', s' = 2 q'.q'', T' = p' - m_Q L s'. A cable that would have to push does nothing:
T = 0. Model: the cable is massless, inextensible, taut and attached at the centre of mass; the air is at rest
and exerts no force on the load.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.records import State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, apply, axpy, column, cross, dot, scale, sub


class LoadMotion(NamedTuple):
    """Derivatives that are not part of the state, world frame."""

    a_load: Vec3  # m/s^2
    j_load: Vec3  # m/s^3
    q_ddot: Vec3  # 1/s^2
    q_dddot: Vec3  # 1/s^3


@kernel
def load_motion(state: State, thrust: float, thrust_rate: float, air: Vec3, vehicle: Vehicle) -> LoadMotion:
    """The motion of load and cable under the thrust f (N), which changes by f' (N/s) while the body turns."""
    q, q_dot, b3 = state.q_cable, state.q_cable_dot, column(state.R, 2)
    m_Q_L = vehicle.quad_mass * vehicle.cable_length
    mass = vehicle.quad_mass + vehicle.load_mass
    lift = scale(thrust, b3)
    F = add(lift, air)
    F_dot = axpy(thrust_rate, b3, cross(apply(state.R, state.omega_body), lift))

    s = dot(q_dot, q_dot)
    p = dot(q, F)
    # the cable pulls or does nothing
    T = min(0.0, p - m_Q_L * s)
    a_load = sub(scale(T / mass, q), (0.0, 0.0, vehicle.gravity))
    q_ddot = axpy(-s, q, scale(1.0 / m_Q_L, sub(scale(p, q), F)))

    s_dot = 2.0 * dot(q_dot, q_ddot)
    T_dot = dot(q_dot, F) + dot(q, F_dot) - m_Q_L * s_dot if T < 0.0 else 0.0
    force_rate = add(scale(T_dot, q), scale(T, q_dot))
    j_load = scale(1.0 / mass, force_rate)
    turning = sub(axpy(dot(q_dot, F) + dot(q, F_dot), q, scale(p, q_dot)), F_dot)
    q_dddot = sub(scale(1.0 / m_Q_L, turning), axpy(s_dot, q, scale(s, q_dot)))
    return LoadMotion(a_load, j_load, q_ddot, q_dddot)
