"""Differential flatness: from the load's path to the whole state and the inputs that fly it.

Symbols (world ENU unless stated otherwise; primes are time derivatives)

=========  ==================  ======================================================================
symbol     code                meaning
=========  ==================  ======================================================================
x_L        jet[0]              position of the load (m); jet[n] is its n-th derivative
q          q_cable             unit vector from vehicle to load
T          tension             cable tension (N)
x_Q        x_quad              position of the vehicle (m), x_L - L q
f R e3     F                   thrust force (N)
R          R                   attitude, body FLU -> world; columns b1, b2, b3
Omega      omega_body          body rate (rad/s), body frame
M          moment              moment (N m), body frame, (2-35)
D          air                 drag of the vehicle (N), -(c_1 + c_2 |x_Q'|) x_Q'
=========  ==================  ======================================================================

Newton's law for the load gives T q = -m_L (x_L'' + g e3), hence q and T. Newton's law for both bodies (the
sum of the two, equivalent to (2-31) and (2-33)) gives F = (m_Q + m_L)(x_L'' + g e3) - m_Q L q''. The moment
needs F'', thus q'''' and the sixth derivative of x_L. In air the rotors give F - D instead of F. Model: the
cable is massless, inextensible, taut and attached at the centre of mass; the load has no drag. The map is
singular where the load falls freely and where F is parallel to the heading.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    E3,
    Mat3,
    Vec3,
    add,
    add3,
    axpy,
    cross,
    dot,
    from_columns,
    norm,
    scale,
    times,
)
from autopilot.geometry.s2 import unit_derivatives
from autopilot.trajectory.signals import Jet


class FlatState(NamedTuple):
    """State and inputs along a flat trajectory; see the module's table for symbols, frames and units."""

    q_cable: Vec3
    q_cable_dot: Vec3
    q_cable_ddot: Vec3
    x_quad: Vec3
    v_quad: Vec3
    R: Mat3
    omega_body: Vec3
    omega_body_dot: Vec3
    thrust: float
    moment: Vec3
    tension: float


@kernel
def unit_derivatives_4(
    v: Vec3, v1: Vec3, v2: Vec3, v3: Vec3, v4: Vec3
) -> tuple[Vec3, Vec3, Vec3, Vec3, Vec3]:
    """u = v/|v| and its first four derivatives from those of v.

    Leibniz' rule for v = n u solved for u^(k), and n' = u . v' (as u . u' = 0) differentiated k - 1 times.
    """
    n = norm(v)
    r = 1.0 / n
    u = scale(r, v)
    n1 = dot(u, v1)
    u1 = scale(r, axpy(-n1, u, v1))
    n2 = dot(u1, v1) + dot(u, v2)
    u2 = scale(r, axpy(-2.0 * n1, u1, axpy(-n2, u, v2)))
    n3 = dot(u2, v1) + 2.0 * dot(u1, v2) + dot(u, v3)
    u3 = scale(r, axpy(-3.0 * n1, u2, axpy(-3.0 * n2, u1, axpy(-n3, u, v3))))
    n4 = dot(u3, v1) + 3.0 * dot(u2, v2) + 3.0 * dot(u1, v3) + dot(u, v4)
    u4 = axpy(-4.0 * n1, u3, axpy(-6.0 * n2, u2, axpy(-4.0 * n3, u1, axpy(-n4, u, v4))))
    return u, u1, u2, u3, scale(r, u4)


@kernel
def _drag_compensation(v: Vec3, a: Vec3, j: Vec3, linear: float, quadratic: float) -> tuple[Vec3, Vec3, Vec3]:
    """-D, -D' and -D'' for a vehicle with velocity v, acceleration a and jerk j in air at rest."""
    s = norm(v)
    # s' and s'' have no limit at rest, but enter only in products with v and s, which vanish there
    r = 1.0 / s if s > 1e-9 else 0.0
    s1 = r * dot(v, a)
    s2 = r * (dot(a, a) + dot(v, j) - s1 * s1)
    k = linear + quadratic * s
    return (
        scale(k, v),
        axpy(quadratic * s1, v, scale(k, a)),
        axpy(quadratic * s2, v, axpy(2.0 * quadratic * s1, a, scale(k, j))),
    )


@kernel
def _attitude(F: Vec3, F1: Vec3, F2: Vec3, heading: float) -> tuple[Mat3, Vec3, Vec3]:
    """R with b3 along F and b1 as near as possible to the heading, Omega and Omega' (body frame).

    b2 is the normalised b3 x b1d, b1 = b2 x b3. Omega = (b3 . b2', b1 . b3', b2 . b1') follows from
    R' = R hat(Omega), (2-34); Omega' is its derivative.
    """
    b1_d = (cos(heading), sin(heading), 0.0)
    b3, b3_1, b3_2 = unit_derivatives(F, F1, F2)
    b2, b2_1, b2_2 = unit_derivatives(cross(b3, b1_d), cross(b3_1, b1_d), cross(b3_2, b1_d))
    b1 = cross(b2, b3)
    b1_1 = add(cross(b2_1, b3), cross(b2, b3_1))
    b1_2 = add3(cross(b2_2, b3), scale(2.0, cross(b2_1, b3_1)), cross(b2, b3_2))
    omega = (dot(b3, b2_1), dot(b1, b3_1), dot(b2, b1_1))
    omega_dot = (
        dot(b3_1, b2_1) + dot(b3, b2_2),
        dot(b1_1, b3_1) + dot(b1, b3_2),
        dot(b2_1, b1_1) + dot(b2, b1_2),
    )
    return from_columns(b1, b2, b3), omega, omega_dot


@kernel
def flat_outputs(
    jet: Jet,
    heading: float,
    quad_mass: float,
    load_mass: float,
    cable_length: float,
    inertia: Vec3,
    gravity: float,
    drag_linear: float = 0.0,
    drag_quadratic: float = 0.0,
) -> FlatState:
    """State and inputs that fly the load's path `jet` exactly, with a constant heading (rad).

    The heading is measured from east to north. Masses in kg, `cable_length` in m, `inertia` the principal
    moments (kg m^2), `gravity` in m/s^2; drag of the vehicle in N s/m and N s^2/m^2.
    """
    pull = axpy(gravity, E3, jet[2])
    u, u1, u2, u3, u4 = unit_derivatives_4(pull, jet[3], jet[4], jet[5], jet[6])
    # q = -u: the cable pulls the load from above
    mass_length = quad_mass * cable_length
    mass = quad_mass + load_mass
    F = axpy(mass_length, u2, scale(mass, pull))
    F1 = axpy(mass_length, u3, scale(mass, jet[3]))
    F2 = axpy(mass_length, u4, scale(mass, jet[4]))
    v_quad = axpy(cable_length, u1, jet[1])
    a_quad = axpy(cable_length, u2, jet[2])
    j_quad = axpy(cable_length, u3, jet[3])
    air, air1, air2 = _drag_compensation(v_quad, a_quad, j_quad, drag_linear, drag_quadratic)
    F, F1, F2 = add(F, air), add(F1, air1), add(F2, air2)
    R, omega, omega_dot = _attitude(F, F1, F2, heading)
    moment = add(times(inertia, omega_dot), cross(omega, times(inertia, omega)))
    return FlatState(
        scale(-1.0, u),
        scale(-1.0, u1),
        scale(-1.0, u2),
        axpy(cable_length, u, jet[0]),
        v_quad,
        R,
        omega,
        omega_dot,
        norm(F),
        moment,
        load_mass * norm(pull),
    )
