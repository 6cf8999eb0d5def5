"""Readings of the barometer that fail the gate, as after a jump of the pressure."""

from __future__ import annotations

import pytest

from autopilot.estimation.filter import MAX_FIX_AGE_S, NO_FIX, knows_height
from autopilot.estimation.measurements.barometer import RESTART_S, correct_barometer
from autopilot.estimation.records import (
    ACROSS,
    Q_CABLE,
    QUAT,
    RECEIVER,
    SIZE,
    EstimatorState,
    History,
    blank_state,
    new_history,
)
from tests.doubles.motion import bebop_tuning

TUNING = bebop_tuning()
HEIGHT_M, JUMP_M = 10.0, 50.0


def flying(barometer_age_s: float) -> tuple[EstimatorState, History]:
    """At a known height, without a fix of the receiver."""
    history, blank = new_history(), blank_state()
    for i in range(SIZE):
        history.covariance[i, i] = 1e-4
    state = blank._replace(
        size=SIZE,
        time_s=10.0,
        vehicle=blank.vehicle._replace(source=RECEIVER, age_s=5.0, x_quad=(0.0, 0.0, HEIGHT_M)),
        sensor_errors=blank.sensor_errors._replace(barometer_age=barometer_age_s),
        uncertainty=blank.uncertainty._replace(tilt=0.01, vertical=0.5),
    )
    row = history.ring[state.head]
    row[0], row[1:4] = state.time_s, state.vehicle.x_quad
    row[QUAT : QUAT + 4], row[Q_CABLE : Q_CABLE + 3] = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -1.0)
    row[ACROSS : ACROSS + 3] = (1.0, 0.0, 0.0)
    return state, history


def test_a_reading_that_fails_the_gate_is_not_one_of_the_height() -> None:
    before, history = flying(2.0 * MAX_FIX_AGE_S)
    state = correct_barometer(before, history, HEIGHT_M + JUMP_M, 0.0, TUNING)
    assert state.vehicle.x_quad[2] == HEIGHT_M
    assert not knows_height(state, NO_FIX)
    assert knows_height(correct_barometer(before, history, HEIGHT_M, 0.0, TUNING), NO_FIX)


@pytest.mark.parametrize("age_s", [1.01 * RESTART_S, float("inf")])
def test_after_a_jump_that_lasts_its_zero_is_found_anew(age_s: float) -> None:
    state, history = flying(age_s)
    state = correct_barometer(state, history, HEIGHT_M + JUMP_M, 0.0, TUNING)
    assert state.vehicle.x_quad[2] == pytest.approx(HEIGHT_M, abs=1e-3)
    assert state.sensor_errors.barometer == pytest.approx(JUMP_M, abs=1e-3)
    assert knows_height(state, NO_FIX)
