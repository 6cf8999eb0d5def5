"""Correction by a load tracker: position of the load, hence direction, rate and length of a taut cable."""

from __future__ import annotations

from autopilot.estimation.correction import (
    PastState,
    add_direction_jacobian,
    add_position_jacobian,
    add_velocity_jacobian,
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
from autopilot.estimation.measurements.pose import (
    IMPACT_SPEED_STD,
    IMPACT_TIME_SHARE,
    REJECTIONS_BEFORE_IMPACT,
    REJECTIONS_BEFORE_RESET,
    add_impact_uncertainty,
)
from autopilot.estimation.records import (
    DIRECTION,
    LENGTH,
    LOAD,
    RATE,
    TRACKED_SIZE,
    TRACKER,
    Covariance2,
    EstimatorState,
    EstimatorTuning,
    History,
    LoadEstimate,
    LoadReading,
)
from autopilot.estimation.tautness import LIFTING_S, SLACK_BELOW, slacken
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, add, axpy, dot, norm, scale, sub
from autopilot.geometry.packed import with_field

OUTLIER_BELOW = 0.8  # share of the cable length below which a short distance is an outlier, not a slack cable
REJECTED_BELOW = 0.98  # share below which readings that the pendulum does not explain show a slack cable
SLACK_READINGS = 3.0  # readings in a row that must show a short distance
# After MANY_REJECTIONS rejections in a row, a distance below this share of the estimated length also shows a
# slack cable: a vehicle that holds still above a load on the ground leaves the cable millimetres loose, and
# the readings of quiet trackers are rejected.
MANY_REJECTIONS, MANY_REJECTIONS_BELOW = 12.0, 0.995
RESTART_DISTANCE = 1.5  # cable lengths from the vehicle: no restart from a reading of the load farther away


@kernel
def update_covariance2(
    cov: Covariance2, h_value: float, h_rate: float, variance: float
) -> tuple[float, float, Covariance2]:
    """Gains of a scalar measurement of h_value value + h_rate rate, and the covariance after it."""
    aa, ab, bb = cov
    ha = aa * h_value + ab * h_rate
    hb = ab * h_value + bb * h_rate
    s = 1.0 / (h_value * ha + h_rate * hb + variance)
    ka, kb = s * ha, s * hb
    return ka, kb, (aa - ka * ha, ab - ka * hb, bb - kb * hb)


@kernel
def with_tracked_motion(
    load: LoadEstimate, x_load: Vec3, v_load: Vec3, cov: Covariance2, age_s: float
) -> LoadEstimate:
    """A tracked load where its separate filter places it; the direction follows with the next prediction."""
    load = with_field(with_field(load, "x_load", x_load), "v_load", v_load)
    return load_with_status(with_field(load, "covariance", cov), age_s, 0.0, TRACKER)


@kernel
def start_load(state: EstimatorState, history: History, reading: LoadReading) -> EstimatorState:
    """The load started at the reading, with a slack cable; the next prediction decides whether it is taut."""
    measured = reading.velocity_std >= 0.0
    age = reading.age_s
    last_v_load = state.load.v_load if state.load.source == TRACKER else (0.0, 0.0, 0.0)
    v_load = reading.v_load if measured else last_v_load
    position_var = reading.position_std * reading.position_std
    rate_var = reading.velocity_std * reading.velocity_std if measured else 1.0
    cov = (position_var + age * age * rate_var, age * rate_var, rate_var)
    load = slacken(state.load, history, position_var, rate_var)
    x_load = axpy(age, v_load, reading.x_load)
    return with_load(state, with_tracked_motion(load, x_load, v_load, cov, age), state.resets + 1.0)


@kernel
def with_impact_uncertainty(load: LoadEstimate, history: History) -> LoadEstimate:
    """The load, less certain because its velocity may have jumped."""
    age_s, variance = load.age_s, IMPACT_SPEED_STD * IMPACT_SPEED_STD
    if load.taut > 0.0:
        for i in range(2):
            add_impact_uncertainty(
                history.covariance, DIRECTION + i, RATE + i, IMPACT_SPEED_STD / load.length, age_s
            )
        return load
    aa, ab, bb = load.covariance
    aa += (1.0 + IMPACT_TIME_SHARE * IMPACT_TIME_SHARE) * age_s * age_s * variance
    cov = (aa, ab + age_s * variance, bb + variance)
    return with_tracked_motion(load, load.x_load, load.v_load, cov, load.age_s)


@kernel
def reject_load(
    state: EstimatorState, history: History, reading: LoadReading, tuning: EstimatorTuning
) -> EstimatorState:
    """Count one more rejected reading; after many in a row the load is restarted, but never far beyond its
    cable's end."""
    load = state.load
    distance = norm(sub(reading.x_load, state.vehicle.x_quad))
    if load.rejected + 1.0 >= REJECTIONS_BEFORE_RESET and distance < RESTART_DISTANCE * tuning.cable_length:
        return start_load(state, history, reading)
    if load.rejected + 1.0 == REJECTIONS_BEFORE_IMPACT:
        load = with_impact_uncertainty(load, history)
    return with_load(state, load_with_status(load, load.age_s, load.rejected + 1.0, TRACKER), state.resets)


@kernel
def correct_slack(
    state: EstimatorState, history: History, reading: LoadReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The separate filter of a load on a slack cable: the same on each axis; a past reading is compared with
    position - age velocity of now."""
    load, age = state.load, reading.age_s
    position_var = reading.position_std * reading.position_std
    innovation = sub(reading.x_load, axpy(-age, load.v_load, load.x_load))
    aa, ab, bb = load.covariance
    past_var = aa - 2.0 * age * ab + age * age * bb
    limit = 3.0 * tuning.gate_sigma * tuning.gate_sigma * (past_var + position_var)
    if not dot(innovation, innovation) <= limit:
        return reject_load(state, history, reading, tuning)
    ka, kb, cov = update_covariance2(load.covariance, 1.0, -age, position_var)
    x_load = add(load.x_load, scale(ka, innovation))
    v_load = axpy(kb, innovation, load.v_load)
    if reading.velocity_std >= 0.0:
        difference = sub(reading.v_load, v_load)
        ka, kb, cov = update_covariance2(cov, 0.0, 1.0, reading.velocity_std * reading.velocity_std)
        x_load = axpy(ka, difference, x_load)
        v_load = axpy(kb, difference, v_load)
    return with_load(state, with_tracked_motion(load, x_load, v_load, cov, age), state.resets)


@kernel
def add_load_position_jacobian(history: History, k: int, past: PastState, length: float, i: int) -> None:
    """Enter component i of x_Q + L q then."""
    add_position_jacobian(history, k, past, i)
    add_direction_jacobian(history, k, past, length * past.across[i], length * past.along[i])
    add_jacobian_entry(history, k, LENGTH, past.q_cable[i])


@kernel
def add_load_velocity_jacobian(history: History, k: int, past: PastState, length: float, i: int) -> None:
    """Enter component i of v_Q + L q' then: a turn (a, b) of the direction adds -(q' . turn) q to q'."""
    add_velocity_jacobian(history, k, past, i)
    q = past.q_cable
    add_jacobian_entry(history, k, RATE, length * past.across[i])
    add_jacobian_entry(history, k, RATE + 1, length * past.along[i])
    add_jacobian_entry(history, k, DIRECTION, -length * dot(past.across, past.q_cable_dot) * q[i])
    add_jacobian_entry(history, k, DIRECTION + 1, -length * dot(past.along, past.q_cable_dot) * q[i])
    add_jacobian_entry(history, k, LENGTH, past.q_cable_dot[i])


@kernel
def correct_load(
    state: EstimatorState, history: History, reading: LoadReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after the reading; `history` is corrected along with it.

    The first reading starts the load; many rejected readings in a row restart it, and a few that are nearer
    than the cable is long make a taut cable slack.
    """
    state = with_capacity(state, reading.age_s, TRACKED_SIZE)
    load, n = state.load, state.size
    if load.source != TRACKER:
        return start_load(state, history, reading)
    if load.taut == 0.0:
        return correct_slack(state, history, reading, tuning)
    past = past_state(state, history, tuning, reading.age_s)
    innovation = sub(reading.x_load, axpy(load.length, past.q_cable, past.x_quad))
    position_var = reading.position_std * reading.position_std
    for i in range(3):
        start_scalar(history, i, innovation[i], position_var)
        add_load_position_jacobian(history, i, past, load.length, i)
    compute_gain_rows(history, 0, 3, n)
    cable_length = load.length_share * tuning.cable_length
    distance = norm(sub(reading.x_load, past.x_quad)) / cable_length
    short = OUTLIER_BELOW < distance < SLACK_BELOW
    rejected = not within_gate(history, LOAD, 3, tuning.gate_sigma)
    if rejected or short:
        # closer to the threshold, rejections show that the load is no pendulum any more; the longer they
        # last, the closer
        short = short or OUTLIER_BELOW < distance < REJECTED_BELOW
        if load.rejected >= MANY_REJECTIONS and load.tautness_age_s > LIFTING_S:
            length = load.length / cable_length
            short = short or OUTLIER_BELOW < distance < MANY_REJECTIONS_BELOW * length
        if short and load.rejected + 1.0 >= SLACK_READINGS:
            return start_load(state, history, reading)
        return reject_load(state, history, reading, tuning)
    start_correction(history)
    velocity_var = reading.velocity_std * reading.velocity_std
    difference = sub(reading.v_load, axpy(load.length, past.q_cable_dot, past.v_quad))
    count = 6 if reading.velocity_std >= 0.0 else 3
    for i in range(3):
        start_scalar(history, 3 + i, difference[i], velocity_var)
        add_load_velocity_jacobian(history, 3 + i, past, load.length, i)
    compute_gain_rows(history, 3, count, n)
    nis = fuse_scalars(history, count, n)
    history.consistency[LOAD, 0] += 1.0
    history.consistency[LOAD, 1] += nis
    state = inject_error(state, history)
    return with_load(state, load_with_status(state.load, reading.age_s, 0.0, TRACKER), state.resets)
