"""States and conserved quantities for the proofs of the plant, written independently of the plant's own
code."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from sitl.plant.by_value import initial_state
from sitl.plant.records import PlantState, Truth
from sitl.vehicles.truth import load_truth

Array = NDArray[np.float64]
CALM = (0.0, 0.0, 0.0)
OFF = (0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="session")
def bebop() -> Truth:
    return load_truth("bebop")


@pytest.fixture(scope="session")
def thesis() -> Truth:
    return load_truth("thesis")


@pytest.fixture(scope="session")
def aloft() -> Callable[..., PlantState]:
    """Taut, high up, level, rotors at rest: `aloft(truth, q, q_dot, v_load=..., height=...)`."""

    def build(
        truth: Truth,
        q: tuple[float, float, float] = (0.0, 0.0, -1.0),
        q_dot: tuple[float, float, float] = CALM,
        v_load: tuple[float, float, float] = CALM,
        height: float = 100.0,
        **fields: object,
    ) -> PlantState:
        direction = np.array(q) / np.linalg.norm(q)
        rate = np.array(q_dot) - direction * (direction @ np.array(q_dot))
        x_load = np.array([0.0, 0.0, height])
        held = np.array(truth.attachment)
        beside = np.cross(np.array(fields.get("omega_body", CALM)), held)
        state = initial_state(truth)._replace(
            x_load=tuple(map(float, x_load)),
            v_load=v_load,
            q_cable=tuple(map(float, direction)),
            q_cable_dot=tuple(map(float, rate)),
            x_quad=tuple(map(float, x_load - truth.cable_length * direction - held)),
            v_quad=tuple(map(float, np.array(v_load) - truth.cable_length * rate - beside)),
            taut=1.0,
            vehicle_on_ground=0.0,
            load_on_ground=0.0,
        )
        return state._replace(**fields)

    return build


@pytest.fixture(scope="session")
def energy() -> Callable[[PlantState, Truth], float]:
    """Kinetic and potential energy of vehicle and load, J."""

    def total(state: PlantState, truth: Truth) -> float:
        v_l, v_q, w = (np.array(v) for v in (state.v_load, state.v_quad, state.omega_body))
        kinetic = (
            truth.load_mass * v_l @ v_l + truth.quad_mass * v_q @ v_q + w @ (np.array(truth.inertia) * w)
        )
        height = truth.load_mass * state.x_load[2] + truth.quad_mass * state.x_quad[2]
        return float(0.5 * kinetic + truth.gravity * height)

    return total


@pytest.fixture(scope="session")
def momentum() -> Callable[[PlantState, Truth], Array]:
    """Linear momentum of the pair, N s."""

    def total(state: PlantState, truth: Truth) -> Array:
        return np.array(state.v_load) * truth.load_mass + np.array(state.v_quad) * truth.quad_mass

    return total


@pytest.fixture(scope="session")
def spins() -> Callable[[PlantState, Truth], tuple[Array, Array]]:
    """Angular momentum, world frame, of the pair of points about its centre of mass and of the vehicle."""

    def both(state: PlantState, truth: Truth) -> tuple[Array, Array]:
        reduced = truth.load_mass * truth.quad_mass / (truth.load_mass + truth.quad_mass)
        r = np.array(state.x_load) - np.array(state.x_quad)
        v = np.array(state.v_load) - np.array(state.v_quad)
        R = rotation(state)
        return reduced * np.cross(r, v), R @ (np.array(truth.inertia) * np.array(state.omega_body))

    return both


def rotation(state: PlantState) -> Array:
    """R of the state, by SciPy."""
    w, x, y, z = state.quat_wxyz
    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())


@pytest.fixture(scope="session")
def rotation_of() -> Callable[[PlantState], Array]:
    return rotation
