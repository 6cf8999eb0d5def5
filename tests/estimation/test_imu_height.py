"""The height of the inertial unit above its assumed place, learned from made-up motion."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.estimation.imu_height import (
    GREATEST_HEIGHT,
    MEAN_TIME_S,
    MEMORY_S,
    learned_imu_height,
)
from autopilot.estimation.records import ImuHeight, blank_state
from autopilot.geometry.linear import Vec3, add, apply, axpy, cross, scale, times
from autopilot.geometry.rigid_body import arm_accel
from autopilot.geometry.so3 import quat_exp, rotation_from_quat
from tests.doubles.motion import bebop_tuning

TUNING, DT = bebop_tuning(), 0.004
UNKNOWN = blank_state().imu_height
PULL_N, ROTATION_HZ = 0.7, 3.0


def learned(
    height: float,
    duration_s: float = 6.0,
    above_load: float = 1.0,
    taut: float = 1.0,
    cable_length: float = TUNING.cable_length,
    known: ImuHeight = UNKNOWN,
    accel_noise: float = 0.05,
    push_std: float = 0.0,
    turning_std: float = 3.0,
    thrust: float = TUNING.quad_mass * TUNING.gravity,
) -> ImuHeight:
    """After `duration_s`, by a unit at `height` (m), whose reading is compensated with what is learned.

    The vehicle oscillates about two axes of its body, with accelerations of `turning_std` (rad/s^2), and is
    pushed by wind and a gust (`push_std`, m/s^2) that lasts for about 0.5 s. At first it stands, and has
    `known` from a flight before.
    """
    noise = np.random.default_rng(7)
    push, tuning = np.zeros(2), TUNING._replace(cable_length=cable_length)
    load = blank_state().load._replace(taut=taut, q_cable=(0.3, -0.1, -np.sqrt(0.9)))
    frequency, J = 2.0 * np.pi * ROTATION_HZ, TUNING.inertia
    for k in range(round(duration_s / DT)):
        phase = frequency * k * DT
        turning: Vec3 = (turning_std * np.sin(phase), turning_std * np.cos(0.7 * phase), 0.0)
        W: Vec3 = (-turning[0] / frequency, 0.4, 0.9)
        moment = add(times(J, turning), cross(W, times(J, W)))
        quat = quat_exp((0.2, -0.1, 1.0))
        vehicle = blank_state().vehicle._replace(
            omega_body=W, quat_wxyz=quat, x_quad=add(load.x_load, (0.0, 0.0, above_load if k else 0.0))
        )
        push = push * (1.0 - DT / 0.5) + push_std * np.sqrt(2.0 * DT / 0.5) * noise.standard_normal(2)
        arm: Vec3 = (0.0, 0.0, height - known.height)
        accel = np.add(arm_accel(W, turning, arm), accel_noise * noise.standard_normal(3))
        accel[:2] += np.array((0.5, 0.3)) + push
        force = apply(rotation_from_quat(quat), scale(TUNING.quad_mass, tuple(accel)))
        if taut > 0.0:
            force = axpy(PULL_N, load.q_cable, force)
        known = learned_imu_height(known, force, PULL_N, load, vehicle, thrust, moment, tuning, DT)
    return known


@pytest.mark.parametrize("taut", [0.0, 1.0])
@pytest.mark.parametrize("height", [-0.1, -0.03, 0.03, 0.1])
def test_a_height_is_learned_from_below(height: float, taut: float) -> None:
    """Of it, what is certain."""
    share = learned(height, taut=taut).height / height
    assert 0.7 < share < 1.0


@pytest.mark.parametrize("height", [0.0, 0.006, -0.006])
def test_a_height_that_matters_little_is_none(height: float) -> None:
    """Although it is known."""
    known = learned(height, accel_noise=0.01)
    assert known.height == 0.0
    assert known.correlation / known.square == pytest.approx(height, abs=5e-4)


@pytest.mark.parametrize("duration_s", [0.1, 0.5, 2.0, 8.0])
@pytest.mark.parametrize("push_std", [0.0, 2.0])
def test_noise_and_gusts_are_no_height(duration_s: float, push_std: float) -> None:
    """After any time."""
    for turning_std in (0.02, 3.0):
        known = learned(0.0, duration_s, accel_noise=0.5, push_std=push_std, turning_std=turning_std)
        assert known.height == 0.0


def test_a_height_is_learned_in_gusts() -> None:
    """In which it takes longer."""
    assert -0.05 < learned(-0.05, push_std=0.2).height < -0.02


def test_what_would_be_a_disaster_is_learned_within_a_second() -> None:
    """By the rotation that it brings about."""
    assert learned(-0.1, 0.7, turning_std=10.0).height < -0.05


WHERE_NOTHING_IS_LEARNED = pytest.mark.parametrize(
    "there",
    [
        pytest.param({"above_load": 0.1}, id="on the ground"),  # it holds the vehicle, whatever the rotors do
        pytest.param({"thrust": 0.0}, id="in the hand"),
        pytest.param({"cable_length": np.inf}, id="without a load"),
    ],
)


@WHERE_NOTHING_IS_LEARNED
def test_nothing_is_learned(there: dict[str, float]) -> None:
    known = learned(-0.05, **there)
    assert known.height == 0.0
    assert known.square < 1e-20


@WHERE_NOTHING_IS_LEARNED
def test_nothing_is_forgotten(there: dict[str, float]) -> None:
    """Not even in five memories of the fit."""
    before = learned(-0.05)
    assert learned(-0.05, 5.0 * MEMORY_S, known=before, **there)[:4] == before[:4]


def test_a_push_that_has_long_been_there_is_no_rotation() -> None:
    """The means begin with it, not at zero."""
    known = learned(0.0, 0.2 * MEAN_TIME_S, accel_noise=0.0)
    assert np.hypot(*known.mean_lateral) == pytest.approx(np.hypot(0.5, 0.3), rel=0.2)
    assert abs(known.correlation) < 1e-9


def test_the_height_has_a_limit() -> None:
    """Nobody mounts it farther away."""
    assert learned(-1.0).height == -GREATEST_HEIGHT
