"""The inertial unit and the receiver's antenna away from the centre of mass, where the estimator knows of it.

The readings are those of points that move with the body, whose motion is differentiated numerically.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from autopilot.estimation.correction import (
    PastState,
    add_position_jacobian,
    add_velocity_jacobian,
    inject_error,
    past_state,
)
from autopilot.estimation.covariance import start_scalar
from autopilot.estimation.history import store_state, turning_velocity
from autopilot.estimation.measurements.gnss import past_antenna
from autopilot.estimation.records import (
    AIDED_SIZE,
    ATTITUDE,
    PADDED_SIZE,
    QUAT,
    EstimatorState,
    EstimatorTuning,
    History,
    blank_state,
    new_history,
)
from autopilot.geometry.linear import ZERO, Vec3
from tests.doubles.motion import GRAVITY, TICK_S, Motion, Noise, bebop_tuning, four, three, track

Array = NDArray[Any]
ARM: Vec3 = (0.05, -0.04, 0.06)
SILENT = Noise(gyro=0.0, accel=0.0, position=0.0, angle=0.0, gyro_bias=ZERO, accel_bias=ZERO)
STEP_S = 1e-3


class BesideTheCentre(Motion):
    """The same motion, as an inertial unit at ARM measures it."""

    def specific_force(self, t: Array) -> Array:
        before, here, after = (
            self.x_quad(s) + self.attitude(s).apply(ARM) for s in (t - STEP_S, t, t + STEP_S)
        )
        accel = (before - 2.0 * here + after) / STEP_S**2
        return np.asarray(self.attitude(t).inv().apply(accel + np.array([0.0, 0.0, GRAVITY])))


def errors(motion: Motion, position: Vec3) -> tuple[float, float]:
    """RMS error of the vehicle's acceleration (m/s^2) and greatest of its velocity (m/s) after a second, for
    an estimator that assumes its inertial unit at this position."""
    trace = track(motion, 4.0, SILENT, 1, bebop_tuning()._replace(imu_position=position))
    settled = trace.t > 1.0
    # the estimate is the mean over the step before
    accel = motion.x_quad(trace.t - 0.5 * TICK_S, 2)
    accel_error = (trace.of(lambda state: state.vehicle.accel_quad) - accel)[settled]
    velocity_error = (trace.of(lambda state: state.vehicle.v_quad) - motion.x_quad(trace.t, 1))[settled]
    return float(np.sqrt(np.mean(accel_error**2))), float(np.abs(velocity_error).max())


def test_a_known_place_of_the_inertial_unit_leaves_little_of_its_error() -> None:
    """A part of the angular acceleration, which is filtered."""
    unknown, known = errors(BesideTheCentre(4.0), ZERO), errors(BesideTheCentre(4.0), ARM)
    for i in range(2):
        assert known[i] < 0.04 * unknown[i]


def moving(motion: Motion, end_s: float) -> tuple[EstimatorState, History]:
    """A state at `end_s`, and the ring of those before, which are the true ones."""
    state, history = blank_state()._replace(size=AIDED_SIZE, memory_s=0.2), new_history()
    for k in range(round(end_s / TICK_S) + 1):
        t = k * TICK_S
        vehicle = state.vehicle._replace(
            x_quad=three(motion.x_quad(t)),
            v_quad=three(motion.x_quad(t, 1)),
            quat_wxyz=four(motion.attitude(t).as_quat(scalar_first=True)[0]),
            accel_quad=three(motion.x_quad(t, 2)),
        )
        state = state._replace(time_s=t, vehicle=vehicle, head=k)
        store_state(state, history)
    return state, history


TUNING = bebop_tuning()._replace(antenna_position=ARM)


def seen(state: EstimatorState, history: History, age: float, tuning: EstimatorTuning = TUNING) -> PastState:
    return past_antenna(past_state(state, history, tuning, age), state, history, tuning)


@pytest.mark.parametrize("age", [0.0, 0.1, 0.121])
def test_a_fix_is_compared_with_the_antenna_at_the_time_of_measurement(age: float) -> None:
    """The velocity is that of a whole step about this time, and so may be half a step old."""
    motion, end_s = Motion(3.0), 1.2
    past = seen(*moving(motion, end_s), age)
    before, here, after = (
        motion.x_quad(s) + motion.attitude(s).apply(ARM)[0]
        for s in end_s - age + STEP_S * np.array([-1, 0, 1])
    )
    assert past.x_quad == pytest.approx(here, abs=1e-5)  # the ring is interpolated linearly
    assert past.v_quad == pytest.approx((after - before) / (2.0 * STEP_S), abs=1e-3)
    assert np.linalg.norm(np.subtract(past.v_quad, motion.x_quad(end_s - age, 1))) > 0.02


def test_an_error_of_the_attitude_moves_the_antenna_as_the_jacobian_says() -> None:
    """Compared with the state corrected by this error."""
    size, age = 1e-6, 0.1
    centred = TUNING._replace(antenna_position=ZERO)
    for axis in range(3):
        shifts, rows = [], []
        for error in (0.0, size):
            state, history = moving(Motion(3.0), 1.2)
            history.error[0, ATTITUDE + axis] = error
            state = inject_error(state, history)
            there, centre = seen(state, history, age), seen(state, history, age, centred)
            shifts.append(np.subtract((there.x_quad, there.v_quad), (centre.x_quad, centre.v_quad)))
            rows = [jacobian(history, there, axis) - jacobian(history, centre, axis)]
        assert (shifts[1] - shifts[0]) / size == pytest.approx(rows[-1], abs=1e-4)
        assert np.abs(rows[-1]).max() > 0.03


def jacobian(history: History, past: PastState, axis: int) -> Array:
    """(2, 3): how position and velocity change with an error of the attitude about a world axis."""
    found = np.zeros((2, 3))
    for kind, add in enumerate((add_position_jacobian, add_velocity_jacobian)):
        for i in range(3):
            start_scalar(history, i, 0.0, 1.0)
            add(history, i, past, i)
            dense = np.zeros(PADDED_SIZE)
            for entry in range(1, history.columns[i, 0] + 1):
                dense[history.columns[i, entry]] += history.jacobian[i, entry]
            found[kind, i] = dense[ATTITUDE + axis]
    return found


def test_without_a_past_nothing_is_known_to_turn() -> None:
    history = new_history()
    store_state(blank_state(), history)
    assert turning_velocity(0, history.ring, 0.0, ARM) == ZERO
    history.ring[0, QUAT] = 1.0
    assert turning_velocity(0, history.ring, -1.0, ARM) == ZERO


def test_an_antenna_at_the_centre_changes_no_bit() -> None:
    state, history = moving(Motion(3.0), 1.2)
    centred = TUNING._replace(antenna_position=ZERO)
    assert seen(state, history, 0.1, centred) == past_state(state, history, centred, 0.1)
