"""SO(3) against SciPy's Rotation, the laws of a group, and derivatives by differences."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from autopilot.geometry import so3
from autopilot.geometry.linear import IDENTITY, Mat3, Vec3, apply, mul, mul_transposed, transpose

# a few dozen rounded operations on numbers of size 1
ROUNDING = 1e-14
# rotations near half a turn: the axis comes from differences of numbers near 1
HALF_TURN = 1e-7
# central difference of step 1e-6 in float64: 1e-12 of truncation, 1e-10 of rounding
DIFFERENCE = 1e-9
STEP = 1e-6

many = settings(max_examples=200, deadline=None, derandomize=True)
reals = st.floats(-1e3, 1e3)
vectors = st.tuples(reals, reals, reals)
seeds = st.integers(0, 2**32 - 1)


def rotation(seed: int) -> Rotation:
    return Rotation.random(rng=np.random.default_rng(seed))


def wxyz(r: Rotation) -> so3.Quat:
    x, y, z, w = (float(v) for v in r.as_quat())
    return (w, x, y, z)


def mat(r: Rotation) -> Mat3:
    return rows(r.as_matrix())


def rows(A: NDArray[np.float64]) -> Mat3:
    a, b, c = ((float(r[0]), float(r[1]), float(r[2])) for r in A)
    return (a, b, c)


def of(q: so3.Quat) -> Rotation:
    w, x, y, z = q
    return Rotation.from_quat([x, y, z, w])


def near(A: Any, B: Any, tolerance: float = ROUNDING) -> bool:
    return bool(np.max(np.abs(np.subtract(A, B))) <= tolerance)


@given(vectors, vectors)
@many
def test_hat_is_the_cross_product_and_vee_undoes_it(v: Vec3, y: Vec3) -> None:
    size = 1.0 + float(np.linalg.norm(v) * np.linalg.norm(y))
    assert near(apply(so3.hat(v), y), np.cross(v, y), ROUNDING * size)
    assert so3.vee(so3.hat(v)) == v
    assert near(transpose(so3.hat(v)), np.negative(so3.hat(v)), 0.0)


def test_vee_drops_the_symmetric_part() -> None:
    A = ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 10.0))
    skew = 0.5 * (np.array(A) - np.array(A).T)
    assert near(so3.hat(so3.vee(A)), skew)


@given(seeds, seeds, vectors)
@many
def test_a_quaternion_and_its_matrix_are_scipys(a: int, b: int, v: Vec3) -> None:
    p, q = rotation(a), rotation(b)
    assert near(so3.rotation_from_quat(wxyz(p)), p.as_matrix())
    assert near(of(so3.quat_multiply(wxyz(p), wxyz(q))).as_matrix(), (p * q).as_matrix())
    assert near(of(so3.quat_conjugate(wxyz(p))).as_matrix(), p.inv().as_matrix())
    assert near(apply(so3.rotation_from_quat(wxyz(p)), v), p.apply(v), ROUNDING * 1e4)


@given(seeds)
@many
def test_a_matrix_gives_the_quaternion_back(seed: int) -> None:
    r = rotation(seed)
    q = so3.quat_from_rotation(mat(r))
    assert q[0] >= 0.0
    assert abs(np.dot(q, wxyz(r))) == pytest.approx(1.0, abs=ROUNDING)
    assert near(so3.rotation_from_quat(q), r.as_matrix())


@pytest.mark.parametrize(
    "axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.8, 0.0), (0.0, -0.6, 0.8)]
)
@pytest.mark.parametrize("short", [0.0, 1e-9, 1e-4])
def test_half_a_turn(axis: Vec3, short: float) -> None:
    phi = np.multiply(math.pi - short, axis)
    R = mat(Rotation.from_rotvec(phi))
    q = so3.quat_from_rotation(R)
    assert near(so3.rotation_from_quat(q), R)
    back = np.array(so3.log(R))
    # at exactly half a turn both axes are right
    assert min(np.linalg.norm(back - phi), np.linalg.norm(back + phi)) < HALF_TURN
    assert near(so3.exp(so3.log(R)), R)


@given(seeds, seeds, seeds)
@many
def test_laws_of_the_group(a: int, b: int, c: int) -> None:
    A, B, C = (so3.rotation_from_quat(wxyz(rotation(s))) for s in (a, b, c))
    assert near(mul(mul(A, B), C), mul(A, mul(B, C)))
    assert near(mul(A, transpose(A)), IDENTITY)
    assert near(mul_transposed(A, A), IDENTITY)
    assert np.linalg.det(A) == pytest.approx(1.0, abs=ROUNDING)
    p, q = wxyz(rotation(a)), wxyz(rotation(b))
    assert so3.quat_multiply(p, so3.IDENTITY_QUAT) == p
    assert near(so3.quat_multiply(p, so3.quat_conjugate(p)), so3.IDENTITY_QUAT)
    assert np.linalg.norm(so3.quat_multiply(p, q)) == pytest.approx(1.0, abs=ROUNDING)


@given(vectors.map(lambda v: tuple(x * 3.1e-3 / math.sqrt(3.0) for x in v)))
@many
def test_exp_and_log_are_scipys_and_undo_each_other(phi: Vec3) -> None:
    r = Rotation.from_rotvec(phi)
    assert near(so3.exp(phi), r.as_matrix())
    assert near(so3.quat_exp(phi), wxyz(r)) or near(so3.quat_exp(phi), np.negative(wxyz(r)))
    assert near(so3.log(so3.exp(phi)), phi, HALF_TURN)
    assert near(so3.log(so3.exp(phi)), r.as_rotvec(), HALF_TURN)
    assert near(so3.quat_log(so3.quat_exp(phi)), phi)


@given(vectors, st.floats(-14.0, -3.0))
@many
def test_small_angles_keep_their_digits(direction: Vec3, exponent: float) -> None:
    length = float(np.linalg.norm(direction))
    assume(length > 1e-3)
    phi = tuple(x / length * 10.0**exponent for x in direction)
    back = np.array(so3.quat_log(so3.quat_exp(phi)))
    assert np.linalg.norm(back - phi) <= ROUNDING * 10.0**exponent


def test_exp_is_continuous_where_its_series_ends() -> None:
    for angle in (0.999999e-4, 1.000001e-4):
        q = so3.quat_exp((angle, 0.0, 0.0))
        assert near(q, (math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0), 1e-16)


@given(seeds, vectors)
@many
def test_the_quaternion_derivative_is_the_turning_of_the_body(seed: int, rate: Vec3) -> None:
    q = wxyz(rotation(seed))
    omega = tuple(1e-3 * x for x in rate)
    ahead = so3.quat_multiply(q, so3.quat_exp(tuple(STEP * x for x in omega)))  # type: ignore[arg-type]
    behind = so3.quat_multiply(q, so3.quat_exp(tuple(-STEP * x for x in omega)))  # type: ignore[arg-type]
    difference = np.subtract(ahead, behind) / (2.0 * STEP)
    assert near(so3.quat_derivative(q, omega), difference, DIFFERENCE)  # type: ignore[arg-type]


@given(seeds, seeds)
@many
def test_the_attitude_error_function(a: int, b: int) -> None:
    R, R_d = mat(rotation(a)), mat(rotation(b))
    angle = (rotation(b).inv() * rotation(a)).magnitude()
    assert so3.psi_attitude(R, R_d) == pytest.approx(1.0 - math.cos(angle), abs=ROUNDING)
    assert so3.psi_attitude(R, R) == pytest.approx(0.0, abs=ROUNDING)
    assert np.linalg.norm(so3.attitude_error(R, R_d)) == pytest.approx(abs(math.sin(angle)), abs=ROUNDING)


@given(seeds, seeds, vectors)
@many
def test_the_attitude_error_is_the_gradient_of_the_error_function(a: int, b: int, direction: Vec3) -> None:
    """d Psi_R / dt = e_R . Omega for a fixed R_d: the property that (3-3) is designed for."""
    R, R_d = mat(rotation(a)), mat(rotation(b))
    omega = tuple(1e-3 * x for x in direction)
    turned = [
        so3.psi_attitude(mul(R, so3.exp(tuple(s * STEP * x for x in omega))), R_d)  # type: ignore[arg-type]
        for s in (1.0, -1.0)
    ]
    slope = (turned[0] - turned[1]) / (2.0 * STEP)
    assert float(np.dot(so3.attitude_error(R, R_d), omega)) == pytest.approx(slope, abs=DIFFERENCE)


@given(seeds)
@many
def test_the_tilt_is_the_angle_of_the_third_axis(seed: int) -> None:
    R = rotation(seed).as_matrix()
    angle = math.atan2(math.hypot(R[0, 2], R[1, 2]), R[2, 2])
    # acos loses half the digits near 0 and 180 degrees
    assert so3.tilt_angle(rows(R)) == pytest.approx(angle, abs=1e-7)


def test_the_tilt_of_an_upright_body_is_no_nan() -> None:
    assert so3.tilt_angle(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0 + 1e-15))) == 0.0


NO_ROTATIONS: dict[str, NDArray[np.float64]] = {
    "longer": np.diag([1.0, 1.02, 1.0]),
    "sheared": np.array([[1.0, 0.0, 0.02], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    "mirrored": np.diag([1.0, 1.0, -1.0]),
    "zero": np.zeros((3, 3)),
    "no number": np.diag([1.0, 1.0, math.nan]),
}


@given(seeds)
@many
def test_a_rotation_is_one_to_a_hundredth(seed: int) -> None:
    R = rotation(seed).as_matrix()
    assert so3.is_rotation(rows(R))
    assert so3.is_rotation(rows(R * 1.004))


@pytest.mark.parametrize("kind", NO_ROTATIONS)
def test_what_is_no_rotation(kind: str) -> None:
    assert not so3.is_rotation(rows(NO_ROTATIONS[kind] @ rotation(0).as_matrix()))
