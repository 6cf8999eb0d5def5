"""A rigid body's rotation against the change of its angular momentum, as the world sees it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.geometry.linear import Vec3
from autopilot.geometry.rigid_body import angular_accel

STEP_S = 1e-4
DIFFERENCE = 1e-6  # central difference of second order, of rotations by up to 5 rad/s


@pytest.mark.parametrize("seed", range(20))
def test_angular_momentum_changes_by_the_moment(seed: int) -> None:
    """d/dt (R J Omega) = R M, in the world, at R = I."""
    rng = np.random.default_rng(seed)
    omega, moment = rng.normal(size=(2, 3))
    inertia = rng.uniform(0.5, 2.0, 3)

    def vec(values: np.ndarray) -> Vec3:
        return (float(values[0]), float(values[1]), float(values[2]))

    omega_dot = np.array(angular_accel(vec(omega), vec(moment), vec(inertia)))

    def momentum(t: float) -> np.ndarray:
        rotation = Rotation.from_rotvec(t * omega)
        return np.asarray(rotation.apply(inertia * (omega + t * omega_dot)))

    change = (momentum(STEP_S) - momentum(-STEP_S)) / (2.0 * STEP_S)
    assert change == pytest.approx(moment, abs=DIFFERENCE)
