"""Axes of world and body, and the vector algebra under them, against NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from autopilot.geometry import frames, linear
from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat, rotation_from_quat

ROUNDING = 1e-14  # a few rounded operations on numbers of size 1
NED_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_FLU = np.diag([1.0, -1.0, -1.0])

many = settings(max_examples=200, deadline=None, derandomize=True)
reals = st.floats(-10.0, 10.0)
vectors = st.tuples(reals, reals, reals)
matrices = st.tuples(vectors, vectors, vectors)
seeds = st.integers(0, 2**32 - 1)


def quat(seed: int) -> Quat:
    x, y, z, w = (float(v) for v in Rotation.random(rng=np.random.default_rng(seed)).as_quat())
    return (w, x, y, z)


def close(a: Any, b: Any, tolerance: float = 100.0 * ROUNDING) -> bool:
    return bool(np.max(np.abs(np.subtract(a, b))) <= tolerance)


def test_the_axes_by_name() -> None:
    east, north, up = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    assert frames.ned_from_enu(north) == (1.0, 0.0, 0.0)
    assert frames.ned_from_enu(east) == (0.0, 1.0, 0.0)
    assert frames.ned_from_enu(up) == (0.0, 0.0, -1.0)
    forward, left = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    assert frames.frd_from_flu(forward) == (1.0, 0.0, 0.0)
    assert frames.frd_from_flu(left) == (0.0, -1.0, 0.0)
    assert frames.frd_from_flu(up) == (0.0, 0.0, -1.0)


@given(vectors)
@many
def test_vectors_there_and_back(v: Vec3) -> None:
    assert frames.ned_from_enu(v) == tuple(NED_ENU @ v)
    assert frames.frd_from_flu(v) == tuple(FRD_FLU @ v)
    assert frames.enu_from_ned(frames.ned_from_enu(v)) == v
    assert frames.ned_from_enu(frames.enu_from_ned(v)) == v
    assert frames.flu_from_frd(frames.frd_from_flu(v)) == v
    assert frames.frd_from_flu(frames.flu_from_frd(v)) == v


def test_no_change_of_axes_is_a_reflection() -> None:
    """Both are proper: angular rates and moments change as vectors do."""
    assert np.linalg.det(NED_ENU) == pytest.approx(1.0)
    assert np.linalg.det(FRD_FLU) == pytest.approx(1.0)


@given(seeds)
@many
def test_attitudes_against_matrices(seed: int) -> None:
    q = quat(seed)
    out = frames.quat_ned_frd_from_enu_flu(q)
    assert out[0] >= 0.0
    assert close(rotation_from_quat(out), NED_ENU @ np.array(rotation_from_quat(q)) @ FRD_FLU)
    back = frames.quat_enu_flu_from_ned_frd(out)
    assert close(rotation_from_quat(back), rotation_from_quat(q))


@given(seeds, vectors)
@many
def test_a_body_vector_goes_the_same_way_by_either_road(seed: int, v_body: Vec3) -> None:
    q = quat(seed)
    by_enu = frames.ned_from_enu(linear.apply(rotation_from_quat(q), v_body))
    by_ned = linear.apply(
        rotation_from_quat(frames.quat_ned_frd_from_enu_flu(q)), frames.frd_from_flu(v_body)
    )
    assert close(by_enu, by_ned)


def test_attitudes_by_name() -> None:
    half = 0.5**0.5
    # level and nose north: east-north-up yaw is 90 degrees, NED yaw is 0
    assert close(frames.quat_ned_frd_from_enu_flu((half, 0.0, 0.0, half)), (1.0, 0.0, 0.0, 0.0))
    # level and nose east: NED yaw is 90 degrees
    assert close(frames.quat_ned_frd_from_enu_flu((1.0, 0.0, 0.0, 0.0)), (half, 0.0, 0.0, half))


@given(vectors, vectors, vectors, reals)
@many
def test_vector_algebra(a: Vec3, b: Vec3, c: Vec3, s: float) -> None:
    x, y, z = np.array(a), np.array(b), np.array(c)
    size = 1e3  # products of two numbers up to 10, three of them added
    assert close(linear.add(a, b), x + y)
    assert close(linear.add3(a, b, c), x + y + z)
    assert close(linear.sub(a, b), x - y)
    assert close(linear.neg(a), -x)
    assert close(linear.scale(s, a), s * x)
    assert close(linear.axpy(s, a, b), s * x + y)
    assert close(linear.times(a, b), x * y)
    assert close(linear.cross(a, b), np.cross(x, y), ROUNDING * size)
    assert linear.dot(a, b) == pytest.approx(float(x @ y), abs=ROUNDING * size)
    assert linear.norm(a) == pytest.approx(float(np.linalg.norm(x)), abs=ROUNDING * size)


@given(matrices, matrices, vectors, reals)
@many
def test_matrix_algebra(A: Any, B: Any, v: Vec3, s: float) -> None:
    X, Y, y = np.array(A), np.array(B), np.array(v)
    size = 1e3
    assert close(linear.transpose(A), X.T, 0.0)
    assert close([linear.column(A, j) for j in range(3)], X.T, 0.0)
    assert close(linear.from_columns(*A), X.T, 0.0)
    assert close(linear.apply(A, v), X @ y, ROUNDING * size)
    assert close(linear.apply_transposed(A, v), X.T @ y, ROUNDING * size)
    assert close(linear.mul(A, B), X @ Y, ROUNDING * size)
    assert close(linear.mul_transposed(A, B), X.T @ Y, ROUNDING * size)
    assert linear.trace(A) == pytest.approx(float(np.trace(X)), abs=ROUNDING * size)
