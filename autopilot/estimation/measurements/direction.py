"""Correction by the direction to the load as a camera or an encoder sees it, in body axes.

With m = exp(c) R^T q, where c is the mounting error about the body's forward and left axes, R exp(-c) m
differs from the direction q by its own error, by attitude x q and by (R c) x q. While the cable is slack, the
load is on the ground, where the line of sight meets the load's height.
"""

from __future__ import annotations

from autopilot.estimation.correction import (
    PastState,
    add_attitude_jacobian,
    add_direction_jacobian,
    inject_error,
    load_with_status,
    past_state,
    with_capacity,
    with_load,
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
    CAMERA,
    DIRECTION,
    LINE_OF_SIGHT,
    MOUNTING,
    NO_SENSOR,
    POSITION,
    SIZE,
    TRACKER,
    DirectionReading,
    EstimatorState,
    EstimatorTuning,
    History,
    LoadEstimate,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, apply, apply_transposed, cross, dot, scale, sub
from autopilot.geometry.packed import with_field
from autopilot.geometry.so3 import exp, rotation_from_quat

REJECTIONS_BEFORE_RESET = 10.0
MIN_SLOPE = 0.3  # of a line of sight that is to meet the ground
MIN_HEIGHT = 0.1  # m above the load, for the same


@kernel
def with_observed_position(
    load: LoadEstimate, x_load: Vec3, position_var: float, age_s: float
) -> LoadEstimate:
    """A load on the ground moved to `x_load`."""
    load = with_field(with_field(load, "x_load", x_load), "covariance", (position_var, 0.0, 0.0))
    return load_with_status(load, age_s, 0.0, CAMERA)


@kernel
def correct_load_on_ground(
    state: EstimatorState,
    history: History,
    past: PastState,
    line_of_sight: Vec3,
    reading: DirectionReading,
    tuning: EstimatorTuning,
) -> EstimatorState:
    """The load on the ground moved towards where the line of sight meets its height."""
    load, P = state.load, history.covariance
    height = past.x_quad[2] - load.x_load[2]
    if not (height > MIN_HEIGHT and -line_of_sight[2] > MIN_SLOPE):
        return state
    range_m = height / -line_of_sight[2]
    intersection = (past.x_quad[0] + range_m * line_of_sight[0], past.x_quad[1] + range_m * line_of_sight[1])
    tilt = state.uncertainty.tilt
    down2 = line_of_sight[2] * line_of_sight[2]
    slow_var = range_m * range_m * (tilt * tilt + tuning.mounting_std * tuning.mounting_std) / down2
    # an error of the height moves this point sideways
    slow_var += P[POSITION + 2, POSITION + 2] * (1.0 - down2) / down2
    sensor_std = range_m * reading.direction_std / line_of_sight[2]
    variance = sensor_std * sensor_std + slow_var
    var = load.covariance[0]
    innovation = (intersection[0] - load.x_load[0], intersection[1] - load.x_load[1])
    limit = 2.0 * tuning.gate_sigma * tuning.gate_sigma * (var + variance)
    if not innovation[0] * innovation[0] + innovation[1] * innovation[1] <= limit:
        if load.rejected + 1.0 < REJECTIONS_BEFORE_RESET:
            return with_load(
                state, load_with_status(load, load.age_s, load.rejected + 1.0, load.source), state.resets
            )
        var = 1.0
    # slow errors are the same in all readings and do not average out: readings reduce the variance only to
    # theirs, and those from afar move nothing that was seen better from near by
    reducible_var = max(var - slow_var, 0.0)
    k = reducible_var / (reducible_var + variance)
    x_load = (load.x_load[0] + k * innovation[0], load.x_load[1] + k * innovation[1], load.x_load[2])
    return with_load(
        state,
        with_observed_position(load, x_load, var - k * reducible_var, reading.age_s),
        state.resets,
    )


@kernel
def correct_direction(
    state: EstimatorState, history: History, reading: DirectionReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after the reading; `history` is corrected along with it.

    Ignored where a tracker sees the load.
    """
    load = state.load
    if state.vehicle.source == NO_SENSOR or load.source == TRACKER:
        return state
    state = with_capacity(state, reading.age_s, SIZE)
    n = state.size
    past = past_state(state, history, tuning, reading.age_s)
    R = rotation_from_quat(past.quat_wxyz)
    c = state.sensor_errors.mounting
    line_of_sight = apply(R, apply(exp((-c[0], -c[1], 0.0)), reading.direction_body))
    if load.taut == 0.0:
        return correct_load_on_ground(state, history, past, line_of_sight, reading, tuning)
    q = past.q_cable
    difference = sub(line_of_sight, q)
    # the stated deviation includes the mounting
    stated_var = reading.direction_std * reading.direction_std
    variance = max(stated_var - tuning.mounting_std * tuning.mounting_std, 0.25 * stated_var)
    innovation = (dot(past.across, difference), dot(past.along, difference))
    for i in range(2):
        start_scalar(history, i, innovation[i], variance)
        add_line_of_sight_jacobian(history, i, past, R)
    compute_gain_rows(history, 0, 2, n)
    if not (within_gate(history, LINE_OF_SIGHT, 2, tuning.gate_sigma) and dot(line_of_sight, q) > 0.0):
        if load.rejected + 1.0 < REJECTIONS_BEFORE_RESET:
            return with_load(
                state, load_with_status(load, load.age_s, load.rejected + 1.0, load.source), state.resets
            )
        reset_direction_uncertainty(history)
        compute_gain_rows(history, 0, 2, n)
        state = with_load(state, load, state.resets + 1.0)
    start_correction(history)
    nis = fuse_scalars(history, 2, n)
    history.consistency[LINE_OF_SIGHT, 0] += 1.0
    history.consistency[LINE_OF_SIGHT, 1] += nis
    state = inject_error(state, history)
    return with_load(state, load_with_status(state.load, reading.age_s, 0.0, CAMERA), state.resets)


@kernel
def reset_direction_uncertainty(history: History) -> None:
    """Make direction and rate of the cable unknown, so that the readings decide them."""
    P = history.covariance
    for i in range(DIRECTION, DIRECTION + 4):
        P[i, i] += 1.0


@kernel
def add_line_of_sight_jacobian(history: History, i: int, past: PastState, R: tuple[Vec3, Vec3, Vec3]) -> None:
    """Enter component i of the observed direction in the cable's axes, as scalar i."""
    axis = past.across if i == 0 else past.along
    turn = cross(past.q_cable, axis)
    add_attitude_jacobian(history, i, past, scale(-1.0, turn))
    add_direction_jacobian(history, i, past, 1.0 if i == 0 else 0.0, 0.0 if i == 0 else 1.0)
    mounting_share = apply_transposed(R, turn)
    add_jacobian_entry(history, i, MOUNTING, mounting_share[0])
    add_jacobian_entry(history, i, MOUNTING + 1, mounting_share[1])
