"""Correction by a barometer, which measures height plus an offset that drifts."""

from __future__ import annotations

from autopilot.estimation.correction import enter_position, heard, inject, look_back, with_aids
from autopilot.estimation.covariance import absorb, begin, enter, gather, scalar, within_gate
from autopilot.estimation.records import (
    BAROMETER,
    PRESSURE,
    RECEIVER,
    SIZE,
    AidEstimate,
    EstimatorState,
    EstimatorTuning,
    History,
)
from autopilot.geometry.kernel import kernel

ANY_OFFSET_STD = 100.0  # m: the first reading defines the zero


@kernel
def correct_barometer(
    state: EstimatorState, history: History, height: float, age: float, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after a reading of the height (m), which is used only with a satellite receiver."""
    if state.vehicle.source != RECEIVER:
        return state
    state = heard(state, age, SIZE)
    n, a = state.size, state.aids
    starting = a.barometer_age == float("inf")
    state = with_aids(
        state,
        AidEstimate(
            a.mounting,
            a.heading,
            height - state.vehicle.x_quad[2] if starting else a.barometer,
            a.gnss,
            a.horizontal_slow,
            a.vertical_slow,
            a.reversion,
            a.debt,
            a.field,
            a.magnetic_age,
            age,
            a.rejected,
        ),
    )
    if starting:
        history.covariance[BAROMETER, BAROMETER] = ANY_OFFSET_STD * ANY_OFFSET_STD
    past = look_back(state, history, tuning, age)
    innovation = height - past.x_quad[2] - state.aids.barometer
    scalar(history, 0, innovation, tuning.barometer_std * tuning.barometer_std)
    enter_position(history, 0, past, 2)
    enter(history, 0, BAROMETER, 1.0)
    gather(history, 0, 1, n)
    if not within_gate(history, PRESSURE, 1, tuning.gate_sigma):
        return state
    begin(history)
    nis = absorb(history, 1, n)
    history.consistency[PRESSURE, 0] += 1.0
    history.consistency[PRESSURE, 1] += nis
    return inject(state, history)
