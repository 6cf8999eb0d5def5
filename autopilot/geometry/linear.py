"""Vectors and 3x3 matrices as tuples of floats.

A `Vec3` is `(x, y, z)`, a `Mat3` is three rows. Plain tuples compile to scalars in registers; NumPy arrays of
this size cost an allocation for each operation.
"""

from __future__ import annotations

from math import sqrt

from autopilot.geometry.kernel import kernel

Vec3 = tuple[float, float, float]
Mat3 = tuple[Vec3, Vec3, Vec3]

ZERO: Vec3 = (0.0, 0.0, 0.0)
E1: Vec3 = (1.0, 0.0, 0.0)
E2: Vec3 = (0.0, 1.0, 0.0)
E3: Vec3 = (0.0, 0.0, 1.0)
IDENTITY: Mat3 = (E1, E2, E3)


@kernel
def add(a: Vec3, b: Vec3) -> Vec3:
    """a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def add3(a: Vec3, b: Vec3, c: Vec3) -> Vec3:
    """a + b + c."""
    return (a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2])


@kernel
def sub(a: Vec3, b: Vec3) -> Vec3:
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def neg(a: Vec3) -> Vec3:
    """-a."""
    return (-a[0], -a[1], -a[2])


@kernel
def scale(s: float, a: Vec3) -> Vec3:
    """s a."""
    return (s * a[0], s * a[1], s * a[2])


@kernel
def axpy(s: float, a: Vec3, b: Vec3) -> Vec3:
    """s a + b."""
    return (s * a[0] + b[0], s * a[1] + b[1], s * a[2] + b[2])


@kernel
def times(a: Vec3, b: Vec3) -> Vec3:
    """Element by element: a diagonal matrix, given by its diagonal, applied to b."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@kernel
def dot(a: Vec3, b: Vec3) -> float:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vec3, b: Vec3) -> Vec3:
    """a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def norm(a: Vec3) -> float:
    """|a|."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@kernel
def is_zero(a: Vec3) -> bool:
    """Whether every component is exactly 0."""
    return a[0] == 0.0 and a[1] == 0.0 and a[2] == 0.0


@kernel
def column(A: Mat3, j: int) -> Vec3:
    """Column j of A."""
    return (A[0][j], A[1][j], A[2][j])


@kernel
def from_columns(a: Vec3, b: Vec3, c: Vec3) -> Mat3:
    """The matrix [a b c]."""
    return ((a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2]))


@kernel
def transpose(A: Mat3) -> Mat3:
    """A^T."""
    return (
        (A[0][0], A[1][0], A[2][0]),
        (A[0][1], A[1][1], A[2][1]),
        (A[0][2], A[1][2], A[2][2]),
    )


@kernel
def apply(A: Mat3, v: Vec3) -> Vec3:
    """A v."""
    return (
        A[0][0] * v[0] + A[0][1] * v[1] + A[0][2] * v[2],
        A[1][0] * v[0] + A[1][1] * v[1] + A[1][2] * v[2],
        A[2][0] * v[0] + A[2][1] * v[1] + A[2][2] * v[2],
    )


@kernel
def apply_transposed(A: Mat3, v: Vec3) -> Vec3:
    """A^T v."""
    return (
        A[0][0] * v[0] + A[1][0] * v[1] + A[2][0] * v[2],
        A[0][1] * v[0] + A[1][1] * v[1] + A[2][1] * v[2],
        A[0][2] * v[0] + A[1][2] * v[1] + A[2][2] * v[2],
    )


@kernel
def mul(A: Mat3, B: Mat3) -> Mat3:
    """A B."""
    return transpose(
        (
            apply(A, column(B, 0)),
            apply(A, column(B, 1)),
            apply(A, column(B, 2)),
        )
    )


@kernel
def mul_transposed(A: Mat3, B: Mat3) -> Mat3:
    """A^T B."""
    return transpose(
        (
            apply_transposed(A, column(B, 0)),
            apply_transposed(A, column(B, 1)),
            apply_transposed(A, column(B, 2)),
        )
    )


@kernel
def trace(A: Mat3) -> float:
    """Sum of the diagonal."""
    return A[0][0] + A[1][1] + A[2][2]
