"""Correction by a cable that comes taut: the load is on the ground, the vehicle one cable length above it.

A plain receiver and a barometer know the height to decimetres; here the height is measured once, and the
climb rate, which is zero. A load that no sensor has ever observed does not move sideways either, as long as
it lies on the ground: else the wind on the vehicle, which pulls at the cable, would seem to carry it away.
"""

from __future__ import annotations

from autopilot.estimation.correction import inject_error, past_state, with_sensor_errors
from autopilot.estimation.covariance import (
    compute_gain_rows,
    fuse_scalars,
    normalised_innovation_squared,
    start_correction,
    start_scalar,
)
from autopilot.estimation.measurements.load import add_load_position_jacobian, add_load_velocity_jacobian
from autopilot.estimation.records import (
    CAMERA,
    RATE,
    RECEIVER,
    VELOCITY,
    EstimatorState,
    EstimatorTuning,
    History,
    LoadEstimate,
)
from autopilot.estimation.tautness import (
    HELD_SIGMAS,
    PULL_SLACK,
    cable_is_unloaded,
    has_risen,
    is_never_observed,
    load_height_var,
    load_vertical_var,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import with_field

GROUND_LOAD_HEIGHT_STD = 0.02  # m, of the height of a load that a snap may lift by millimetres
GROUND_LOAD_SPEED_STD = 0.05  # m/s, of its velocity
# time in which measurements of the velocity of a load on the ground count as one: samples are not independent
GROUND_LOAD_CORRELATION_S = 0.3
# cosine of the slant up to which a cable measures the height: one that strong wind pulls aside hardly shows
# it, and where its load lies is not known well enough
MIN_UPRIGHT = 0.9


@kernel
def _may_rest(load: LoadEstimate, history: History) -> bool:
    """Whether a load on a taut cable may rest on the ground, by its estimated height and climb rate: it may
    hang long before anything else shows it."""
    if has_risen(load, history):
        return False
    noise_var = GROUND_LOAD_SPEED_STD * GROUND_LOAD_SPEED_STD
    variance = load_vertical_var(load, history, VELOCITY + 2, RATE, 0.0, noise_var)
    return load.v_load[2] * load.v_load[2] <= HELD_SIGMAS * HELD_SIGMAS * variance


@kernel
def correct_tautening(
    state: EstimatorState, history: History, before: LoadEstimate, tuning: EstimatorTuning, dt: float
) -> EstimatorState:
    """The state after a prediction over dt seconds; `before` is the load before this prediction.

    An upright cable that comes taut measures height and climb rate of a receiver's vehicle, unless the load
    must have been lifted before. The climb rate is also measured while the cable pulls and the load is still
    on the ground, and so is the level velocity of a load that no sensor has ever observed. The laws receive
    the correction of the height at once: they are about to lift the load off this ground.
    """
    load = state.load
    measures_climb, measures_level = state.vehicle.source == RECEIVER, is_never_observed(load)
    if load.source != CAMERA or load.taut == 0.0 or not (measures_climb or measures_level):
        return state
    came_taut = before.taut == 0.0
    is_pulling = load.pull > PULL_SLACK * tuning.load_mass * tuning.gravity
    if not came_taut and not (
        is_pulling and cable_is_unloaded(load, history, state.memory_s, state.missing_pull)
    ):
        return state
    if measures_climb and (load.q_cable[2] > -MIN_UPRIGHT or not _may_rest(load, history)):
        return state
    n, pending_correction = state.size, state.sensor_errors.pending_correction
    past = past_state(state, history, tuning, 0.0)
    start_correction(history)
    count = 0
    speed_var = (
        GROUND_LOAD_SPEED_STD
        * GROUND_LOAD_SPEED_STD
        * (1.0 if came_taut else max(1.0, GROUND_LOAD_CORRELATION_S / dt))
    )
    # the height of the place where the load lies is known as well as that of the vehicle was when it was laid
    # there; the vehicle's error is partly the same, so that the correction leaves the error of the place
    laid_var = load.laid_height_var + GROUND_LOAD_HEIGHT_STD * GROUND_LOAD_HEIGHT_STD
    height_var = load_height_var(load, history)
    if came_taut and measures_climb and height_var > laid_var:
        start_scalar(
            history,
            0,
            before.x_load[2] - load.x_load[2],
            laid_var * height_var / (height_var - laid_var),
        )
        add_load_position_jacobian(history, 0, past, load.length, 2)
        compute_gain_rows(history, 0, 1, n)
        if not normalised_innovation_squared(history, 1) <= HELD_SIGMAS * HELD_SIGMAS:
            return state
        count = 1
    first = count
    for axis in range(3):
        if measures_climb if axis == 2 else measures_level:
            speed = past.v_quad[axis] + load.length * past.q_cable_dot[axis]
            start_scalar(history, count, -speed, speed_var)
            add_load_velocity_jacobian(history, count, past, load.length, axis)
            count += 1
    compute_gain_rows(history, first, count, n)
    fuse_scalars(history, count, n)
    state = inject_error(state, history)
    corrected = state.sensor_errors.pending_correction
    kept = (corrected[0], corrected[1], pending_correction[2])
    return with_sensor_errors(state, with_field(state.sensor_errors, "pending_correction", kept))
