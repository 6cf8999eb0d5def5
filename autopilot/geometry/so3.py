"""The rotation group SO(3): hat and vee (2-8), exponential and logarithm, quaternions, errors (3-1)-(3-6).

A rotation `R` converts body coordinates to world coordinates, `v_world = R v_body`. A quaternion `quat_wxyz`
is `(w, x, y, z)` of unit length and represents the same map.
"""

from __future__ import annotations

from math import acos, atan2, cos, sin, sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import (
    Mat3,
    Vec3,
    cross,
    dot,
    mul_transposed,
    norm,
    scale,
    sub,
    trace,
)

Quat = tuple[float, float, float, float]
IDENTITY_QUAT: Quat = (1.0, 0.0, 0.0, 0.0)
ROTATION_TOLERANCE = 0.01


@kernel
def hat(v: Vec3) -> Mat3:
    """The skew matrix with hat(v) y = v x y, (2-8)."""
    return ((0.0, -v[2], v[1]), (v[2], 0.0, -v[0]), (-v[1], v[0], 0.0))


@kernel
def vee(A: Mat3) -> Vec3:
    """Inverse of `hat`, applied to the skew part of A: the symmetric part is dropped."""
    return (0.5 * (A[2][1] - A[1][2]), 0.5 * (A[0][2] - A[2][0]), 0.5 * (A[1][0] - A[0][1]))


@kernel
def quat_multiply(p: Quat, q: Quat) -> Quat:
    """Hamilton product: the rotation q first, then p."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@kernel
def quat_conjugate(q: Quat) -> Quat:
    """The inverse rotation."""
    return (q[0], -q[1], -q[2], -q[3])


@kernel
def quat_normalise(q: Quat) -> Quat:
    """q / |q|."""
    s = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (s * q[0], s * q[1], s * q[2], s * q[3])


@kernel
def quat_derivative(q: Quat, omega_body: Vec3) -> Quat:
    """dq/dt for a body rate in rad/s, body frame: the quaternion form of (2-34)."""
    wx, wy, wz = omega_body
    return (
        0.5 * (-q[1] * wx - q[2] * wy - q[3] * wz),
        0.5 * (q[0] * wx + q[2] * wz - q[3] * wy),
        0.5 * (q[0] * wy + q[3] * wx - q[1] * wz),
        0.5 * (q[0] * wz + q[1] * wy - q[2] * wx),
    )


@kernel
def rotation_from_quat(q: Quat) -> Mat3:
    """R of a unit quaternion."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@kernel
def quat_from_rotation(R: Mat3) -> Quat:
    """Unit quaternion of R with w >= 0. Shepperd's method: the largest component is the divisor."""
    t = trace(R)
    if t >= R[0][0] and t >= R[1][1] and t >= R[2][2]:
        w = 0.5 * sqrt(1.0 + t)
        s = 0.25 / w
        q = (w, s * (R[2][1] - R[1][2]), s * (R[0][2] - R[2][0]), s * (R[1][0] - R[0][1]))
    elif R[0][0] >= R[1][1] and R[0][0] >= R[2][2]:
        x = 0.5 * sqrt(1.0 + R[0][0] - R[1][1] - R[2][2])
        s = 0.25 / x
        q = (s * (R[2][1] - R[1][2]), x, s * (R[0][1] + R[1][0]), s * (R[0][2] + R[2][0]))
    elif R[1][1] >= R[2][2]:
        y = 0.5 * sqrt(1.0 - R[0][0] + R[1][1] - R[2][2])
        s = 0.25 / y
        q = (s * (R[0][2] - R[2][0]), s * (R[0][1] + R[1][0]), y, s * (R[1][2] + R[2][1]))
    else:
        z = 0.5 * sqrt(1.0 - R[0][0] - R[1][1] + R[2][2])
        s = 0.25 / z
        q = (s * (R[1][0] - R[0][1]), s * (R[0][2] + R[2][0]), s * (R[1][2] + R[2][1]), z)
    if q[0] < 0.0:
        q = (-q[0], -q[1], -q[2], -q[3])
    return quat_normalise(q)


@kernel
def quat_exp(phi: Vec3) -> Quat:
    """Unit quaternion of the rotation vector phi (rad)."""
    angle2 = dot(phi, phi)
    if angle2 < 1e-2:
        # Taylor to the eighth power of the angle: the next term is below 1e-19
        w = 1.0 + angle2 * (-1 / 8 + angle2 * (1 / 384 + angle2 * (-1 / 46080 + angle2 / 10321920)))
        s = 0.5 + angle2 * (-1 / 48 + angle2 * (1 / 3840 + angle2 * (-1 / 645120 + angle2 / 185794560)))
    else:
        angle = sqrt(angle2)
        w = cos(0.5 * angle)
        s = sin(0.5 * angle) / angle
    return (w, s * phi[0], s * phi[1], s * phi[2])


@kernel
def quat_log(q: Quat) -> Vec3:
    """Rotation vector (rad), of length at most pi, of a unit quaternion."""
    if q[0] < 0.0:
        q = (-q[0], -q[1], -q[2], -q[3])
    v = (q[1], q[2], q[3])
    n = norm(v)
    if n < 1e-8:
        return scale(2.0 / q[0], v)
    return scale(2.0 * atan2(n, q[0]) / n, v)


@kernel
def exp(phi: Vec3) -> Mat3:
    """Rotation matrix of the rotation vector phi (rad): Rodrigues' formula."""
    return rotation_from_quat(quat_exp(phi))


@kernel
def log(R: Mat3) -> Vec3:
    """Rotation vector (rad) of R, of length at most pi."""
    return quat_log(quat_from_rotation(R))


@kernel
def psi_attitude(R: Mat3, R_d: Mat3) -> float:
    """Psi_R = tr(I - R_d^T R) / 2 in 0 ... 2, (3-1)."""
    return 0.5 * (3.0 - trace(mul_transposed(R_d, R)))


@kernel
def attitude_error(R: Mat3, R_d: Mat3) -> Vec3:
    """e_R = (R_d^T R - R^T R_d)^vee / 2, (3-3): `vee` takes the skew part."""
    return vee(mul_transposed(R_d, R))


@kernel
def is_rotation(R: Mat3) -> bool:
    """Whether the rows of R have length 1, are at right angles and right-handed, to ROTATION_TOLERANCE."""
    a, b, c = R
    error = max(abs(norm(a) - 1.0), abs(norm(b) - 1.0))
    return error < ROTATION_TOLERANCE and norm(sub(cross(a, b), c)) < ROTATION_TOLERANCE


@kernel
def tilt_angle(R: Mat3) -> float:
    """Angle in rad between the thrust axis and the vertical."""
    return acos(min(1.0, max(-1.0, R[2][2])))
