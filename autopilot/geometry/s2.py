"""The sphere S2: errors (3-8)-(3-11) of a direction, and derivatives of a normalised vector."""

from __future__ import annotations

from math import sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, axpy, cross, dot, norm, scale, sub

_MIN_ALONG = 0.5  # least share of the pull along the axis: a larger slant of the cable counts as this one


@kernel
def normalise(v: Vec3) -> Vec3:
    """v / |v|; nan for the zero vector."""
    return scale(1.0 / norm(v), v)


@kernel
def tangent(q_cable: Vec3, v: Vec3) -> Vec3:
    """The part of v that is orthogonal to q_cable: projection on the tangent plane (2-10)."""
    return axpy(-dot(q_cable, v), q_cable, v)


@kernel
def force_along_cable(component: float, q_cable: Vec3, axis: Vec3) -> float:
    """The force along q_cable that has this component along `axis`, which points away from the cable."""
    return component / min(dot(q_cable, axis), -_MIN_ALONG)


@kernel
def psi_direction(q_cable: Vec3, q_cable_d: Vec3) -> float:
    """Psi_q = 1 - q_d . q in 0 ... 2, (3-8), as |q - q_d|^2 / 2, which stays accurate near zero."""
    difference = sub(q_cable, q_cable_d)
    return 0.5 * dot(difference, difference)


@kernel
def direction_error(q_cable: Vec3, q_cable_d: Vec3) -> Vec3:
    """e_q = hat(q)^2 q_d = q x (q x q_d), (3-10)."""
    return cross(q_cable, cross(q_cable, q_cable_d))


@kernel
def direction_rate_error(q_cable: Vec3, q_cable_dot: Vec3, q_cable_d: Vec3, q_cable_d_dot: Vec3) -> Vec3:
    """e_qdot = qdot - (q_d x qdot_d) x q, (3-11)."""
    return sub(q_cable_dot, cross(cross(q_cable_d, q_cable_d_dot), q_cable))


@kernel
def unit_derivatives(v: Vec3, v_dot: Vec3, v_ddot: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """u = v/|v| with its first and second time derivatives.

    From n = |v|: n' = u.v', u' = (v' - n' u)/n, n'' = u'.v' + u.v'', u'' = (v'' - n'' u - 2 n' u')/n.
    """
    n = norm(v)
    u = scale(1.0 / n, v)
    n_dot = dot(u, v_dot)
    u_dot = scale(1.0 / n, axpy(-n_dot, u, v_dot))
    n_ddot = dot(u_dot, v_dot) + dot(u, v_ddot)
    u_ddot = scale(1.0 / n, axpy(-2.0 * n_dot, u_dot, axpy(-n_ddot, u, v_ddot)))
    return u, u_dot, u_ddot


@kernel
def advance(q_cable: Vec3, q_cable_dot: Vec3, dt: float) -> Vec3:
    """q after dt seconds along q_dot, pulled back to the sphere: second-order accurate in the angle."""
    q = add(q_cable, scale(dt, q_cable_dot))
    return scale(1.0 / sqrt(dot(q, q)), q)
