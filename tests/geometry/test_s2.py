"""The sphere: errors (3-8)-(3-11) and derivatives of a normalised vector."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from autopilot.geometry import s2
from autopilot.geometry.linear import Vec3

ROUNDING = 1e-13  # some dozen rounded operations on numbers up to a few units
# fourth-order central differences of step 1e-3: truncation 1e-12 times a sixth derivative of some hundreds,
# rounding 1e-16 / 1e-6 in the second derivative
DIFFERENCE = 1e-7
STEP = 1e-3

many = settings(max_examples=200, deadline=None, derandomize=True)
reals = st.floats(-2.0, 2.0)
vectors = st.tuples(reals, reals, reals)
seeds = st.integers(0, 2**32 - 1)


def vec(a: Any) -> Vec3:
    return (float(a[0]), float(a[1]), float(a[2]))


def unit(seed: int) -> NDArray[np.float64]:
    out: NDArray[np.float64] = Rotation.random(rng=np.random.default_rng(seed)).apply([0.0, 0.0, 1.0])
    return out


def close(a: Any, b: Any, tolerance: float = ROUNDING) -> bool:
    return bool(np.max(np.abs(np.subtract(a, b))) <= tolerance)


@given(vectors)
@many
def test_normalise(v: Vec3) -> None:
    assume(np.linalg.norm(v) > 1e-3)
    assert close(s2.normalise(v), np.array(v) / np.linalg.norm(v))


@given(seeds, vectors)
@many
def test_the_tangent_part(seed: int, v: Vec3) -> None:
    q = unit(seed)
    part = s2.tangent(vec(q), v)
    assert close(part, (np.eye(3) - np.outer(q, q)) @ v)
    assert np.dot(part, q) == pytest.approx(0.0, abs=ROUNDING)
    assert close(s2.tangent(vec(q), part), part)


@given(seeds, seeds)
@many
def test_the_direction_errors_are_those_of_the_formulas(a: int, b: int) -> None:
    q, q_d = unit(a), unit(b)
    hat = np.cross(np.eye(3), q)
    assert close(hat @ q_d, np.cross(q, q_d))
    assert s2.psi_direction(vec(q), vec(q_d)) == pytest.approx(1.0 - np.dot(q, q_d), abs=ROUNDING)
    assert close(s2.direction_error(vec(q), vec(q_d)), hat @ hat @ q_d)


@given(seeds, seeds, seeds)
@many
def test_errors_do_not_depend_on_the_frame(a: int, b: int, c: int) -> None:
    R = Rotation.random(rng=np.random.default_rng(c))
    q, q_d = unit(a), unit(b)
    turned = s2.direction_error(vec(R.apply(q)), vec(R.apply(q_d)))
    assert close(turned, R.apply(s2.direction_error(vec(q), vec(q_d))))


@given(seeds, seeds, vectors)
@many
def test_the_error_is_the_gradient_of_the_error_function(a: int, b: int, omega: Vec3) -> None:
    """d Psi_q / dt = e_q . q_dot for a fixed q_d: the property that (3-10) is designed for."""
    q, q_d = unit(a), unit(b)

    def psi(t: float) -> float:
        moved = Rotation.from_rotvec(np.multiply(t, omega)).apply(q)
        return s2.psi_direction(vec(moved), vec(q_d))

    slope = (psi(-2 * STEP) - 8 * psi(-STEP) + 8 * psi(STEP) - psi(2 * STEP)) / (12 * STEP)
    q_dot = np.cross(omega, q)
    assert float(np.dot(s2.direction_error(vec(q), vec(q_d)), q_dot)) == pytest.approx(slope, abs=DIFFERENCE)


def test_a_tiny_error_keeps_its_digits() -> None:
    angle = 1e-9
    q = (float(np.sin(angle)), 0.0, -float(np.cos(angle)))
    assert s2.psi_direction(q, (0.0, 0.0, -1.0)) == pytest.approx(0.5 * angle * angle, rel=1e-6)


@given(seeds, vectors)
@many
def test_the_rate_error_vanishes_where_both_move_alike(seed: int, omega: Vec3) -> None:
    q = unit(seed)
    q_dot = np.cross(omega, q)
    assert close(s2.direction_rate_error(vec(q), vec(q_dot), vec(q), vec(q_dot)), np.zeros(3))


@given(seeds, seeds, vectors, vectors)
@many
def test_the_rate_error_is_the_formula(a: int, b: int, omega: Vec3, omega_d: Vec3) -> None:
    q, q_d = unit(a), unit(b)
    q_dot, q_d_dot = np.cross(omega, q), np.cross(omega_d, q_d)
    e = s2.direction_rate_error(vec(q), vec(q_dot), vec(q_d), vec(q_d_dot))
    assert close(e, q_dot - np.cross(np.cross(q_d, q_d_dot), q))
    assert np.dot(e, q) == pytest.approx(0.0, abs=ROUNDING)


@given(vectors, vectors, vectors)
@many
def test_derivatives_of_a_normalised_vector(v: Vec3, v_dot: Vec3, v_ddot: Vec3) -> None:
    assume(np.linalg.norm(v) > 1.0)  # far from the zero vector the differences are exact enough

    def at(t: float) -> NDArray[np.float64]:
        path = np.array(v) + t * np.array(v_dot) + 0.5 * t * t * np.array(v_ddot)
        out: NDArray[np.float64] = path / np.linalg.norm(path)
        return out

    h = STEP
    first = (at(-2 * h) - 8 * at(-h) + 8 * at(h) - at(2 * h)) / (12 * h)
    second = (-at(-2 * h) + 16 * at(-h) - 30 * at(0.0) + 16 * at(h) - at(2 * h)) / (12 * h * h)
    u, u_dot, u_ddot = s2.unit_derivatives(v, v_dot, v_ddot)
    assert close(u, at(0.0))
    assert close(u_dot, first, DIFFERENCE)
    assert close(u_ddot, second, DIFFERENCE)
    # u.u = 1 differentiated once and twice
    assert np.dot(u, u_dot) == pytest.approx(0.0, abs=ROUNDING)
    assert np.dot(u, u_ddot) + np.dot(u_dot, u_dot) == pytest.approx(0.0, abs=10 * ROUNDING)


@given(vectors, vectors)
@many
def test_the_first_derivative_by_a_complex_step(v: Vec3, v_dot: Vec3) -> None:
    """Without the cancellation of a difference: exact to rounding."""
    assume(np.linalg.norm(v) > 0.1)
    path = np.array(v) + 1e-30j * np.array(v_dot)
    u = path / np.sqrt(np.sum(path * path))
    _, u_dot, _ = s2.unit_derivatives(v, v_dot, (0.0, 0.0, 0.0))
    assert close(u_dot, u.imag / 1e-30, 100 * ROUNDING)


@given(seeds, vectors, st.floats(0.0, 0.02))
@many
def test_advance_stays_on_the_sphere_and_follows_the_great_circle(seed: int, omega: Vec3, dt: float) -> None:
    q = unit(seed)
    axis = np.cross(q, np.cross(omega, q))
    q_dot = np.cross(axis, q)
    moved = s2.advance(vec(q), vec(q_dot), dt)
    assert np.linalg.norm(moved) == pytest.approx(1.0, abs=ROUNDING)
    angle = dt * float(np.linalg.norm(axis))
    # atan(a) = a - a^3/3 + ...: the angle falls short by no more than its third power
    assert close(moved, Rotation.from_rotvec(dt * axis).apply(q), angle**3 + ROUNDING)
