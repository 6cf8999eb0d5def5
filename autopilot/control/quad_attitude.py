"""Vehicle attitude: the moment that makes R follow R_c, (3-1)-(3-25), and the frame R_c itself,
(3-27)-(3-29).

| symbol       | code name    | frame | unit    | equation       |
|--------------|--------------|-------|---------|----------------|
| R            | R            | B->I  |         | (2-1)          |
| R_d, R_c     | R_c          | C->I  |         | (3-27)         |
| Omega        | omega_body   | B     | rad/s   | (2-34)         |
| Omega_c      | Omega_c      | C     | rad/s   | (3-28)         |
| Omega_c'     | Omega_c_dot  | C     | rad/s^2 | (3-18)         |
| e_R          | e_R          | B     |         | (3-3)          |
| e_Omega      | e_Omega      | B     | rad/s   | (3-6)          |
| Psi_R        | psi_R        |       |         | (3-1)          |
| J            | J (diagonal) | B     | kg m^2  | (2-35)         |
| k_R, k_Omega | k_R, k_Omega | B     | N m, N m s | (3-20)      |
| epsilon      | epsilon      |       |         | (3-21)         |
| M            | M            | B     | N m     | (3-21), (3-36) |
| b_1d         | b1_d         | I     |         | (3-29)         |

Two forms of the feed-forward moment are common. This file uses that of the thesis,

    Omega x J Omega - J (hat(Omega) R^T R_c Omega_c - R^T R_c Omega_c')

It cancels the dynamics, so that J e_Omega' = -k_R e_R - k_Omega e_Omega exactly, also far from the target.
The other, (R^T R_c Omega_c) x J (R^T R_c Omega_c) + J R^T R_c Omega_c', is not used anywhere in Plumbline.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    Mat3,
    Vec3,
    add,
    apply,
    apply_transposed,
    axpy,
    column,
    cross,
    dot,
    from_columns,
    mul_transposed,
    norm,
    scale,
    sub,
    times,
    trace,
)
from autopilot.geometry.s2 import unit_derivatives
from autopilot.geometry.so3 import vee

# sine of the least angle between heading and thrust axis for which (3-29) is used
_MIN_SINE = 1e-3


class AttitudeCommand(NamedTuple):
    """A commanded attitude with its body rate and acceleration, both in the commanded frame."""

    R_c: Mat3
    Omega_c: Vec3  # rad/s
    Omega_c_dot: Vec3  # rad/s^2


class AttitudeResult(NamedTuple):
    """The moment and the errors that it corrects, all in the body frame."""

    moment: Vec3  # N m
    e_R: Vec3
    e_Omega: Vec3  # rad/s
    psi_R: float


@kernel
def attitude_moment(
    R: Mat3, omega_body: Vec3, command: AttitudeCommand, k_R: Vec3, k_Omega: Vec3, epsilon: float, J: Vec3
) -> AttitudeResult:
    """M of (3-21), (3-36). The gains are diagonals; e_R is that of (3-3) even if the entries of k_R
    differ."""
    relative = mul_transposed(command.R_c, R)  # R_c^T R takes body to commanded frame
    e_R = vee(relative)
    psi_R = 0.5 * (3.0 - trace(relative))
    Omega_c_body = apply_transposed(relative, command.Omega_c)
    Omega_c_dot_body = apply_transposed(relative, command.Omega_c_dot)
    e_Omega = sub(omega_body, Omega_c_body)

    feedback = add(
        scale(-1.0 / (epsilon * epsilon), times(k_R, e_R)),
        scale(-1.0 / epsilon, times(k_Omega, e_Omega)),
    )
    gyroscopic = cross(omega_body, times(J, omega_body))
    transport = times(J, sub(cross(omega_body, Omega_c_body), Omega_c_dot_body))
    moment = sub(add(feedback, gyroscopic), transport)
    return AttitudeResult(moment, e_R, e_Omega, psi_R)


@kernel
def heading_axis(b3_c: Vec3, b1_d: Vec3) -> Vec3:
    """b_1c of (3-29): the horizontal heading b1_d projected on the plane normal to the unit vector b3_c,
    normalised.

    (3-29) is undefined where b3_c is parallel to b1_d, at a pitch of 90 deg. Within 0.06 deg of that, its
    limit for a pure pitch is used: the nose straight down, or straight up.
    """
    normal = cross(b3_c, b1_d)
    n = norm(normal)
    if n < _MIN_SINE:
        forward: Vec3 = (0.0, 0.0, -dot(b3_c, b1_d))
        normal = cross(b3_c, forward)
        n = norm(normal)
    return scale(-1.0 / n, cross(b3_c, normal))


@kernel
def attitude_from_axes(
    b3: Vec3, b3_dot: Vec3, b3_ddot: Vec3, b1: Vec3, b1_dot: Vec3, b1_ddot: Vec3
) -> AttitudeCommand:
    """R_c (3-27) with Omega_c (3-28) and Omega_c' (3-18), from a moving thrust direction and heading.

    Arguments: two vectors in the world frame, of any length, with two derivatives each. The third column of
    R_c is b3 normalised, the first is b1 without its part along b3, normalised (3-29); derivatives are
    exact.
    """
    c3, c3_dot, c3_ddot = unit_derivatives(b3, b3_dot, b3_ddot)
    # the part of b1 across c3, and its derivatives
    s = dot(c3, b1)
    s_dot = dot(c3_dot, b1) + dot(c3, b1_dot)
    p = axpy(-s, c3, b1)
    p_dot = axpy(-s_dot, c3, axpy(-s, c3_dot, b1_dot))
    # the part of p'' along c3 is left out, because only the part of c1'' along c2 is used
    p_ddot = axpy(-2.0 * s_dot, c3_dot, axpy(-s, c3_ddot, b1_ddot))
    c1, c1_dot, c1_ddot = unit_derivatives(p, p_dot, p_ddot)
    c2 = cross(c3, c1)
    c2_dot = add(cross(c3_dot, c1), cross(c3, c1_dot))
    # the skew R_c^T R_c' has the entries c_i . c_j': Omega_c = (-c2 . c3', c1 . c3', c2 . c1')
    Omega_c = (-dot(c2, c3_dot), dot(c1, c3_dot), dot(c2, c1_dot))
    Omega_c_dot = (
        -dot(c2, c3_ddot) - dot(c2_dot, c3_dot),
        dot(c1, c3_ddot) + dot(c1_dot, c3_dot),
        dot(c2, c1_ddot) + dot(c2_dot, c1_dot),
    )
    return AttitudeCommand(from_columns(c1, c2, c3), Omega_c, Omega_c_dot)


@kernel
def attitude_from_rates(R_c: Mat3, R_c_dot: Mat3, R_c_ddot: Mat3) -> AttitudeCommand:
    """R_c with Omega_c = vee(R_c^T R_c') (3-28) and Omega_c' = vee(R_c^T R_c'') (3-18).

    R_c' (1/s) and R_c'' (1/s^2) are derivatives of the elements and may be estimates: the symmetric part of
    the products is dropped. For exact derivatives it is zero in the first, hat(Omega_c)^2 in the second.
    """
    return AttitudeCommand(R_c, vee(mul_transposed(R_c, R_c_dot)), vee(mul_transposed(R_c, R_c_ddot)))


@kernel
def column_rates(R: Mat3, omega_body: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """Rates of the columns of R: R' = R hat(Omega), so b_i' = W x b_i with W = R Omega."""
    W = apply(R, omega_body)
    return cross(W, column(R, 0)), cross(W, column(R, 1)), cross(W, column(R, 2))
