"""Vectors and rotations for compiled laws and estimators: tuples of floats, as `kernel` takes them.

`turned(A, B)` is A B, `turned_back(A, B)` is A^T B; `rotation` is the matrix of a rotation vector (rad), and
`rotation_vector` its inverse.
"""

from __future__ import annotations

from autopilot.geometry.linear import (
    E1,
    E3,
    IDENTITY,
    ZERO,
    Mat3,
    Vec3,
    add,
    apply,
    apply_transposed,
    axpy,
    column,
    cross,
    dot,
    mul,
    mul_transposed,
    norm,
    scale,
    sub,
    times,
)
from autopilot.geometry.s2 import unit_derivatives
from autopilot.geometry.so3 import exp as rotation
from autopilot.geometry.so3 import log as rotation_vector

turned, turned_back = mul, mul_transposed

__all__ = [
    "E1",
    "E3",
    "IDENTITY",
    "ZERO",
    "Mat3",
    "Vec3",
    "add",
    "apply",
    "apply_transposed",
    "axpy",
    "column",
    "cross",
    "dot",
    "norm",
    "rotation",
    "rotation_vector",
    "scale",
    "sub",
    "times",
    "turned",
    "turned_back",
    "unit_derivatives",
]
