"""How far a receiver is trusted whose solution floats before it is fixed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autopilot.estimation.measurements.gnss import correct_gnss
from autopilot.estimation.records import (
    GNSS,
    POSITION,
    RECEIVER,
    RTK_FIXED,
    RTK_FLOAT,
    SIZE,
    EstimatorState,
    GnssReading,
    History,
    blank_state,
    new_history,
)
from autopilot.geometry.linear import ZERO
from tests.doubles.motion import bebop_tuning

FLOAT_STD, FIXED_STD = 0.15, 0.01
TUNING = bebop_tuning()
SLOW_SHARE = math.sqrt(1.0 - TUNING.rtk_white**2)


def started(stated: float) -> tuple[EstimatorState, History]:
    """A vehicle at home whose first fix stated this deviation, m, and was off by 0.2 m."""
    history = new_history()
    history.covariance[:SIZE, :SIZE] = 1e-6 * np.eye(SIZE)
    slow = SLOW_SHARE * stated
    for i in range(3):
        history.covariance[POSITION + i, POSITION + i] = slow * slow
        history.covariance[GNSS + i, GNSS + i] = slow * slow
    state = blank_state()
    vehicle = state.vehicle._replace(source=RECEIVER, age_s=0.1)
    sensor_errors = state.sensor_errors._replace(
        horizontal_slow_std=slow, vertical_slow_std=slow, gnss=(0.2, 0.0, 0.0)
    )
    return state._replace(vehicle=vehicle, sensor_errors=sensor_errors, size=SIZE), history


def corrected(state: EstimatorState, history: History, stated: float, rtk: float) -> EstimatorState:
    fix = GnssReading(0.0, (0.05, 0.0, 0.0), ZERO, stated, stated, rtk)
    return correct_gnss(state, history, fix, TUNING, 0.0)


def test_what_it_floated_by_is_over_once_it_is_fixed() -> None:
    state, history = started(FLOAT_STD)
    state = corrected(state, history, FIXED_STD, RTK_FIXED)
    assert math.sqrt(history.covariance[GNSS, GNSS]) < SLOW_SHARE * FIXED_STD * 1.001
    assert abs(state.sensor_errors.gnss[0]) < SLOW_SHARE * FIXED_STD
    # the place is that of the fix, which was 0.2 m off before
    assert state.vehicle.x_quad[0] == pytest.approx(0.05, abs=FIXED_STD)


def test_while_it_floats_the_place_is_hardly_moved() -> None:
    state, history = started(FIXED_STD)
    before = state.sensor_errors
    state = corrected(state, history, FLOAT_STD, RTK_FLOAT)
    assert (state.sensor_errors.horizontal_slow_std, state.sensor_errors.vertical_slow_std) == (
        before.horizontal_slow_std,
        before.vertical_slow_std,
    )
    assert abs(state.vehicle.x_quad[0]) < 1e-4
    state, history = started(FIXED_STD)
    assert corrected(state, history, FLOAT_STD, RTK_FIXED).vehicle.x_quad[0] < -1e-4
