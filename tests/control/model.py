"""An independent NumPy model of the vehicle with its load, written from (2-30)-(2-35) with arrays; it shares
no function with the laws or the geometry package.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from autopilot.control.records import State, Vehicle


def vec(a: Any) -> tuple[float, float, float]:
    return (float(a[0]), float(a[1]), float(a[2]))


def mat(A: Any) -> tuple[tuple[float, float, float], ...]:
    return (vec(A[0]), vec(A[1]), vec(A[2]))


def cross(a: Any, b: Any) -> np.ndarray:
    """The product of two vectors of three numbers: that of NumPy takes ten times as long."""
    (a0, a1, a2), (b0, b1, b2) = a, b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def hat(v: Any) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rodrigues(v: Any) -> np.ndarray:
    """exp(hat(v)) for any v."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    K = hat(np.asarray(v) / angle)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def unit(v: Any) -> np.ndarray:
    return np.asarray(v) / np.linalg.norm(v)


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    """Uniform on SO(3): QR of a Gaussian matrix with the signs of the diagonal taken out."""
    Q, T = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(T))
    return Q if np.linalg.det(Q) > 0 else -Q


def rates(y: np.ndarray, f: float, M: Any, vehicle: Vehicle) -> np.ndarray:
    """dy/dt by (2-30)-(2-35); y = x_L, v_L, q, omega, R row by row, Omega (24 numbers)."""
    q, w, R, W = y[6:9], y[9:12], y[12:21].reshape(3, 3), y[21:24]
    m_Q, L, J = vehicle.quad_mass, vehicle.cable_length, np.array(vehicle.inertia)
    force = f * R[:, 2]
    q_dot = cross(w, q)
    total = m_Q + vehicle.load_mass
    a = (q @ force - m_Q * L * (q_dot @ q_dot)) * q / total - np.array([0.0, 0.0, vehicle.gravity])
    w_dot = -cross(q, force) / (m_Q * L)
    W_dot = (np.asarray(M) - cross(W, J * W)) / J
    return np.concatenate([y[3:6], a, q_dot, w_dot, (R @ hat(W)).ravel(), W_dot])


def rk4(y: np.ndarray, f: float, M: Any, vehicle: Vehicle, dt: float) -> np.ndarray:
    """One step with the inputs held, q and R pulled back to their manifolds."""
    k1 = rates(y, f, M, vehicle)
    k2 = rates(y + 0.5 * dt * k1, f, M, vehicle)
    k3 = rates(y + 0.5 * dt * k2, f, M, vehicle)
    k4 = rates(y + dt * k3, f, M, vehicle)
    y = y + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    y[6:9] = unit(y[6:9])
    U, _, Vt = np.linalg.svd(y[12:21].reshape(3, 3))
    y[12:21] = (U @ Vt).ravel()
    return y


def pack(x: Any, v: Any, q: Any, w: Any, R: Any, W: Any) -> np.ndarray:
    return np.concatenate([np.asarray(p, dtype=float).ravel() for p in (x, v, q, w, R, W)])


def state_of(y: np.ndarray, vehicle: Vehicle) -> State:
    """The record that the laws take."""
    q_dot = cross(y[9:12], y[6:9])
    L = vehicle.cable_length
    return State(
        vec(y[0:3]),
        vec(y[3:6]),
        vec(y[6:9]),
        vec(q_dot),
        vec(y[0:3] - L * y[6:9]),
        vec(y[3:6] - L * q_dot),
        mat(y[12:21].reshape(3, 3)),
        vec(y[21:24]),
    )
