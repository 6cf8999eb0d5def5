"""Correction by a barometer, which measures height plus an offset that drifts."""

from __future__ import annotations

from autopilot.estimation.correction import (
    add_position_jacobian,
    inject_error,
    past_state,
    with_capacity,
    with_sensor_errors,
)
from autopilot.estimation.covariance import (
    add_jacobian_entry,
    compute_gain_rows,
    fuse_scalars,
    start_correction,
    start_scalar,
    within_gate,
)
from autopilot.estimation.records import (
    BAROMETER,
    PRESSURE,
    RECEIVER,
    SIZE,
    EstimatorState,
    EstimatorTuning,
    History,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.packed import with_field

UNKNOWN_OFFSET_STD = 100.0  # m: the first reading defines the zero
RESTART_S = 10.0  # without a reading that passes the gate


@kernel
def correct_barometer(
    state: EstimatorState, history: History, height: float, age: float, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after a reading of the height (m), which is used only with a satellite receiver.

    The first one, and the first after none passed the gate for `RESTART_S`, tells the barometer's zero.
    """
    if state.vehicle.source != RECEIVER:
        return state
    state = with_capacity(state, age, SIZE)
    n, a = state.size, state.sensor_errors
    P = history.covariance
    zero = if_above(a.barometer_age, RESTART_S, height - state.vehicle.x_quad[2], a.barometer)
    P[BAROMETER, BAROMETER] = if_above(
        a.barometer_age, RESTART_S, UNKNOWN_OFFSET_STD * UNKNOWN_OFFSET_STD, P[BAROMETER, BAROMETER]
    )
    state = with_sensor_errors(state, with_field(a, "barometer", zero))
    past = past_state(state, history, tuning, age)
    innovation = height - past.x_quad[2] - state.sensor_errors.barometer
    start_scalar(history, 0, innovation, tuning.barometer_std * tuning.barometer_std)
    add_position_jacobian(history, 0, past, 2)
    add_jacobian_entry(history, 0, BAROMETER, 1.0)
    compute_gain_rows(history, 0, 1, n)
    if not within_gate(history, PRESSURE, 1, tuning.gate_sigma):
        return state
    start_correction(history)
    nis = fuse_scalars(history, 1, n)
    history.consistency[PRESSURE, 0] += 1.0
    history.consistency[PRESSURE, 1] += nis
    state = with_sensor_errors(state, with_field(state.sensor_errors, "barometer_age", age))
    return inject_error(state, history)
