"""The errors with which a cable begins that comes taut, compared with those of what measured its load."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from autopilot.estimation.records import (
    ATTITUDE,
    CAMERA,
    DIRECTION,
    MOUNTING,
    POSITION,
    RATE,
    SIZE,
    TRACKER,
    VELOCITY,
    blank_state,
    new_history,
)
from autopilot.estimation.tautness import LIFT_OFF_SPEED_STD, tauten
from autopilot.geometry.linear import Vec3, apply, apply_transposed, cross
from autopilot.geometry.so3 import exp, quat_exp, rotation_from_quat
from tests.doubles.motion import bebop_tuning

Array = NDArray[np.float64]
LENGTH = 0.7
Q: Vec3 = (0.36, 0.48, -0.8)
ACROSS: Vec3 = (0.8, -0.6, 0.0)
AXES = np.array([ACROSS, cross(Q, ACROSS)])
VEHICLE = blank_state().vehicle._replace(quat_wxyz=quat_exp((0.3, -0.2, 1.1)))
LOAD = blank_state().load._replace(q_cable=Q, across=ACROSS, age_s=0.1)


def tautened(source: float, covariance: tuple[float, float, float]) -> tuple[Array, Array]:
    """The covariance before and after the cable of such a load comes taut."""
    history = new_history()
    root = np.random.default_rng(3).normal(size=(SIZE, SIZE)) * 0.01
    history.covariance[:SIZE, :SIZE] = root @ root.T
    before = history.covariance.copy()
    load = LOAD._replace(source=source, covariance=covariance)
    tauten(load, VEHICLE, history, bebop_tuning(), LENGTH)
    return before, history.covariance


def rows(P: Array, *first_and_count: tuple[int, int]) -> Any:
    """The covariance of these parts of the error."""
    at = np.concatenate([np.arange(first, first + count) for first, count in first_and_count])
    return P[np.ix_(at, at)]


def seen_from_camera(errors: Array) -> Array:
    """The direction that a camera reading means if attitude and mounting are wrong by this much."""
    R = rotation_from_quat(VEHICLE.quat_wxyz)
    turn, mounting = exp(tuple(errors[:3])), exp((-errors[3], -errors[4], 0.0))
    return np.array(apply(turn, apply(R, apply(mounting, apply_transposed(R, Q)))))


def test_a_direction_that_a_camera_saw_has_the_error_of_attitude_and_mounting() -> None:
    step = 1e-6
    J = np.array([AXES @ (seen_from_camera(step * e) - np.array(Q)) / step for e in np.eye(5)]).T
    left = 0.004  # m^2, of the load's position, besides
    before, _ = tautened(CAMERA, (0.0, 0.0, 0.0))
    expected = J @ rows(before, (ATTITUDE, 3), (MOUNTING, 2)) @ J.T
    shared = 0.5 * LENGTH**2 * np.trace(expected)
    _, after = tautened(CAMERA, (shared + left, 0.0, 0.0))
    assert rows(after, (DIRECTION, 2)) == pytest.approx(expected + np.eye(2) * left / LENGTH**2, rel=1e-4)
    with_attitude = J[:, :3] @ rows(before, (ATTITUDE, 3)) + J[:, 3:] @ before[MOUNTING : MOUNTING + 2, 6:9]
    assert after[DIRECTION : DIRECTION + 2, ATTITUDE : ATTITUDE + 3] == pytest.approx(with_attitude, rel=1e-4)
    assert np.linalg.eigvalsh(after[:SIZE, :SIZE]).min() > -1e-12


@pytest.mark.parametrize(("source", "lift_off_std"), [(TRACKER, 0.0), (CAMERA, LIFT_OFF_SPEED_STD)])
def test_the_rate_has_the_error_of_both_velocities(source: float, lift_off_std: float) -> None:
    before, after = tautened(source, (0.0, 0.0, 0.002))
    expected = AXES @ rows(before, (VELOCITY, 3)) @ AXES.T + np.eye(2) * (0.002 + lift_off_std**2)
    assert rows(after, (RATE, 2)) == pytest.approx(expected / LENGTH**2, rel=1e-9)


def test_a_tracked_direction_has_the_error_of_both_positions() -> None:
    before, after = tautened(TRACKER, (0.001, 0.0, 0.0))
    expected = AXES @ rows(before, (POSITION, 3)) @ AXES.T + np.eye(2) * 0.001
    assert rows(after, (DIRECTION, 2)) == pytest.approx(expected / LENGTH**2, rel=1e-9)
