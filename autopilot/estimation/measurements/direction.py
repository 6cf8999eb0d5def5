"""Correction by the direction to the load as a camera or an encoder sees it, in body axes.

With m = exp(c) R^T q, where c is the mounting error about the body's forward and left axes, R exp(-c) m
differs from the direction q by its own error, by attitude x q and by (R c) x q. While the cable is slack, the
load lies on the ground, where the line of sight meets the load's height.
"""

from __future__ import annotations

from autopilot.estimation.correction import (
    Past,
    enter_attitude,
    enter_direction,
    heard,
    inject,
    load_at,
    look_back,
    with_load,
)
from autopilot.estimation.covariance import absorb, begin, enter, gather, scalar, within_gate
from autopilot.estimation.records import (
    CAMERA,
    DIRECTION,
    MOUNTING,
    NOBODY,
    POSITION,
    SIGHT,
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
from autopilot.geometry.so3 import exp, rotation_from_quat

REJECTIONS_BEFORE_RESET = 10.0
LEAST_SLOPE = 0.3  # of a line of sight that is to meet the ground
LEAST_HEIGHT = 0.1  # m above the load, for the same


@kernel
def put(load: LoadEstimate, x_load: Vec3, position_var: float, age_s: float) -> LoadEstimate:
    """A lying load moved to `x_load`."""
    return LoadEstimate(
        x_load,
        load.v_load,
        load.q_cable,
        load.q_cable_dot,
        load.across,
        load.length,
        (position_var, 0.0, 0.0),
        load.taut,
        load.tension,
        load.pull,
        load.pulled_s,
        load.held_s,
        age_s,
        0.0,
        CAMERA,
    )


@kernel
def see_lying(
    state: EstimatorState,
    history: History,
    past: Past,
    sight: Vec3,
    reading: DirectionReading,
    tuning: EstimatorTuning,
) -> EstimatorState:
    """The lying load moved towards where the line of sight meets its height."""
    load, P = state.load, history.covariance
    height = past.x_quad[2] - load.x_load[2]
    if not (height > LEAST_HEIGHT and -sight[2] > LEAST_SLOPE):
        return state
    far = height / -sight[2]
    seen = (past.x_quad[0] + far * sight[0], past.x_quad[1] + far * sight[1])
    tilt = state.doubt.tilt
    down = sight[2] * sight[2]
    slow = far * far * (tilt * tilt + tuning.mounting_std * tuning.mounting_std) / down
    # an error of the height moves this point sideways
    slow += P[POSITION + 2, POSITION + 2] * (1.0 - down) / down
    own = far * reading.direction_std / sight[2]
    variance = own * own + slow
    var = load.covariance[0]
    off = (seen[0] - load.x_load[0], seen[1] - load.x_load[1])
    limit = 2.0 * tuning.gate_sigma * tuning.gate_sigma * (var + variance)
    if not off[0] * off[0] + off[1] * off[1] <= limit:
        if load.rejected + 1.0 < REJECTIONS_BEFORE_RESET:
            return with_load(state, load_at(load, load.age_s, load.rejected + 1.0, load.source), state.resets)
        var = 1.0
    k = var / (var + variance)
    x_load = (load.x_load[0] + k * off[0], load.x_load[1] + k * off[1], load.x_load[2])
    # slow errors are the same in all sights and do not average out
    return with_load(state, put(load, x_load, max((1.0 - k) * var, slow), reading.age_s), state.resets)


@kernel
def correct_direction(
    state: EstimatorState, history: History, reading: DirectionReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after the reading; `history` is corrected along with it.

    Ignored where a tracker sees the load.
    """
    load = state.load
    if state.vehicle.source == NOBODY or load.source == TRACKER:
        return state
    state = heard(state, reading.age_s, SIZE)
    n = state.size
    past = look_back(state, history, tuning, reading.age_s)
    R = rotation_from_quat(past.quat_wxyz)
    c = state.aids.mounting
    sight = apply(R, apply(exp((-c[0], -c[1], 0.0)), reading.direction_body))
    if load.taut == 0.0:
        return see_lying(state, history, past, sight, reading, tuning)
    q = past.q_cable
    off = sub(sight, q)
    # the stated deviation includes the mounting
    stated = reading.direction_std * reading.direction_std
    variance = max(stated - tuning.mounting_std * tuning.mounting_std, 0.25 * stated)
    innovation = (dot(past.across, off), dot(past.along, off))
    for i in range(2):
        scalar(history, i, innovation[i], variance)
        enter_sight(history, i, past, R)
    gather(history, 0, 2, n)
    if not (within_gate(history, SIGHT, 2, tuning.gate_sigma) and dot(sight, q) > 0.0):
        if load.rejected + 1.0 < REJECTIONS_BEFORE_RESET:
            return with_load(state, load_at(load, load.age_s, load.rejected + 1.0, load.source), state.resets)
        widen(history)
        gather(history, 0, 2, n)
        state = with_load(state, load, state.resets + 1.0)
    begin(history)
    nis = absorb(history, 2, n)
    history.consistency[SIGHT, 0] += 1.0
    history.consistency[SIGHT, 1] += nis
    state = inject(state, history)
    return with_load(state, load_at(state.load, reading.age_s, 0.0, CAMERA), state.resets)


@kernel
def widen(history: History) -> None:
    """Make direction and rate of the cable unknown, so that the sights decide them."""
    P = history.covariance
    for i in range(DIRECTION, DIRECTION + 4):
        P[i, i] += 1.0


@kernel
def enter_sight(history: History, i: int, past: Past, R: tuple[Vec3, Vec3, Vec3]) -> None:
    """Enter component i of the seen direction in the cable's axes, as scalar i."""
    axis = past.across if i == 0 else past.along
    turn = cross(past.q_cable, axis)
    enter_attitude(history, i, past, scale(-1.0, turn))
    enter_direction(history, i, past, 1.0 if i == 0 else 0.0, 0.0 if i == 0 else 1.0)
    mounted = apply_transposed(R, turn)
    enter(history, i, MOUNTING, mounted[0])
    enter(history, i, MOUNTING + 1, mounted[1])
