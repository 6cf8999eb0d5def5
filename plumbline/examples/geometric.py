"""The geometric load controller of Sreenath, Lee and Kumar, compiled.

K. Sreenath, T. Lee, V. Kumar: Geometric Control and Differential Flatness of a Quadrotor UAV with a
Cable-Suspended Load. IEEE Conference on Decision and Control, 2013.

| symbol     | code name    | frame | unit     | meaning                                           |
|------------|--------------|-------|----------|---------------------------------------------------|
| e_x, e_v   | e_x, e_v     | world | m, m/s   | position and velocity error of the load           |
| A          | A            | world | N        | desired force on load and vehicle together        |
| q, q_c     | q, q_c       | world |          | direction of the cable, and the computed one      |
| e_q, e_q'  | e_q, e_q_dot | world | , 1/s    | q x (q x q_c), and q' - (q_c x q_c') x q          |
| F_n        | F_n          | world | N        | component of the force along the cable            |
| F_pd, F_ff | F_pd, F_ff   | world | N        | feedback and feed-forward across it               |

F = F_n - F_pd - F_ff; the built-in attitude controller replaces that of the paper. The direction q_c is the
computed one, but its derivatives are those of the reference, which are the same while the load is at its
desired position.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from plumbline.laws import Asked, Now, Parameter, force, kernel
from plumbline.vectors import Vec3, add, axpy, cross, dot, norm, scale, sub, unit_derivatives

PARAMETERS = {
    "GEO_KX": Parameter(10.0, 0.0, 100.0, "1/s^2", "Gain of the load's position error"),
    "GEO_KV": Parameter(6.0, 0.0, 100.0, "1/s", "Gain of the load's velocity error"),
    "GEO_KQ": Parameter(80.0, 0.0, 500.0, "1/s^2", "Gain of the cable's direction error"),
    "GEO_KW": Parameter(16.0, 0.0, 100.0, "1/s", "Gain of the cable's rate error"),
}


class Nothing(NamedTuple):
    """The memory of the controller, which is empty."""


class Gains(NamedTuple):
    """Gains of the two loops: those of the paper divided by the mass of vehicle and load, and by m_Q L."""

    k_x: float  # 1/s^2
    k_v: float  # 1/s
    k_q: float  # 1/s^2
    k_omega: float  # 1/s


class Geometric(Gains):
    """The controller, which consists of its gains."""

    parameters = PARAMETERS

    @classmethod
    def build(cls, parameters: Mapping[str, float]) -> Geometric:
        """The controller with the gains given by the parameters."""
        return cls(parameters["GEO_KX"], parameters["GEO_KV"], parameters["GEO_KQ"], parameters["GEO_KW"])

    @kernel
    def load_position(self, memory: Nothing, now: Now) -> tuple[Nothing, Asked]:
        """The load follows the reference."""
        q, q_dot = now.state.q_cable, now.state.q_cable_dot
        believed, length = now.believed, now.cable.length
        m_Q, mass = believed.quad_mass, believed.quad_mass + believed.load_mass
        up: Vec3 = (0.0, 0.0, believed.gravity)
        x_d, v_d, a_d, jerk_d, snap_d = now.reference.jet[:5]

        e_x, e_v = sub(now.state.x_load, x_d), sub(now.state.v_load, v_d)
        commanded = axpy(-self.k_v, e_v, axpy(-self.k_x, e_x, add(a_d, up)))
        A = axpy(m_Q * length * dot(q_dot, q_dot), q, scale(mass, commanded))
        q_c = scale(-1.0 / norm(A), A)
        _, q_c_dot, q_c_ddot = unit_derivatives(
            scale(-1.0, add(a_d, up)), scale(-1.0, jerk_d), scale(-1.0, snap_d)
        )

        e_q = cross(q, cross(q, q_c))
        e_q_dot = sub(q_dot, cross(cross(q_c, q_c_dot), q))
        F_n = scale(dot(A, q), q)
        F_pd = scale(-m_Q * length, axpy(self.k_omega, e_q_dot, scale(self.k_q, e_q)))
        F_ff = scale(
            m_Q * length,
            add(scale(dot(q, cross(q_c, q_c_dot)), cross(q, q_dot)), cross(cross(q_c, q_c_ddot), q)),
        )
        return memory, force(sub(sub(F_n, F_pd), F_ff))
