"""Correction by a load tracker: position of the load, hence direction, rate and length of a taut cable."""

from __future__ import annotations

from autopilot.estimation.correction import (
    Past,
    enter_direction,
    enter_position,
    enter_velocity,
    heard,
    inject,
    load_at,
    look_back,
    with_load,
)
from autopilot.estimation.covariance import absorb, begin, enter, gather, scalar, within_gate
from autopilot.estimation.measurements.pose import (
    KNOCK_STD,
    KNOCK_WHEN,
    REFUSED_BY_KNOCK,
    REJECTIONS_BEFORE_RESET,
    knock,
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

SLACK_FROM = 0.8  # share of the cable length below which a short distance is an outlier, not a slack cable
REFUSED_BELOW = 0.98  # share below which readings that the pendulum does not explain show a slack cable
SLACK_READINGS = 3.0  # readings in a row that must show a short distance
# After REFUSED_LONG rejections in a row, a distance below this share of the estimated length also shows a
# slack cable: a vehicle that holds still above a load on the ground leaves the cable millimetres loose, and
# the readings of quiet trackers are rejected.
REFUSED_LONG, REFUSED_LONG_BELOW = 12.0, 0.995
REACH = 1.5  # cable lengths from the vehicle: no restart from a reading of the load farther away


@kernel
def update2(
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
def placed(load: LoadEstimate, x_load: Vec3, v_load: Vec3, cov: Covariance2, age_s: float) -> LoadEstimate:
    """A tracked load where its separate filter places it; the direction follows with the next prediction."""
    return LoadEstimate(
        x_load,
        v_load,
        load.q_cable,
        load.q_cable_dot,
        load.across,
        load.length,
        cov,
        load.taut,
        load.tension,
        load.pull,
        load.pulled_s,
        load.held_s,
        age_s,
        0.0,
        TRACKER,
    )


@kernel
def start_load(
    state: EstimatorState, history: History, reading: LoadReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The load started at the reading, with a slack cable; the next prediction decides whether it is taut."""
    measured = reading.velocity_std >= 0.0
    age = reading.age_s
    was = state.load.v_load if state.load.source == TRACKER else (0.0, 0.0, 0.0)
    v_load = reading.v_load if measured else was
    position_var = reading.position_std * reading.position_std
    rate_var = reading.velocity_std * reading.velocity_std if measured else 1.0
    cov = (position_var + age * age * rate_var, age * rate_var, rate_var)
    load = slacken(state.load, history, position_var, rate_var)
    x_load = axpy(age, v_load, reading.x_load)
    return with_load(state, placed(load, x_load, v_load, cov, age), state.resets + 1.0)


@kernel
def knocked(load: LoadEstimate, history: History) -> LoadEstimate:
    """The load, less certain because its velocity may have jumped."""
    since, variance = load.age_s, KNOCK_STD * KNOCK_STD
    if load.taut > 0.0:
        for i in range(2):
            knock(history.covariance, DIRECTION + i, RATE + i, KNOCK_STD / load.length, since)
        return load
    aa, ab, bb = load.covariance
    aa += (1.0 + KNOCK_WHEN * KNOCK_WHEN) * since * since * variance
    cov = (aa, ab + since * variance, bb + variance)
    return placed(load, load.x_load, load.v_load, cov, load.age_s)


@kernel
def refuse_load(
    state: EstimatorState, history: History, reading: LoadReading, tuning: EstimatorTuning
) -> EstimatorState:
    """Count one more rejected reading; after many in a row the load is restarted, but never far beyond its
    cable's end."""
    load = state.load
    distance = norm(sub(reading.x_load, state.vehicle.x_quad))
    if load.rejected + 1.0 >= REJECTIONS_BEFORE_RESET and distance < REACH * tuning.cable_length:
        return start_load(state, history, reading, tuning)
    if load.rejected + 1.0 == REFUSED_BY_KNOCK:
        load = knocked(load, history)
    return with_load(state, load_at(load, load.age_s, load.rejected + 1.0, TRACKER), state.resets)


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
        return refuse_load(state, history, reading, tuning)
    ka, kb, cov = update2(load.covariance, 1.0, -age, position_var)
    x_load = add(load.x_load, scale(ka, innovation))
    v_load = axpy(kb, innovation, load.v_load)
    if reading.velocity_std >= 0.0:
        difference = sub(reading.v_load, v_load)
        ka, kb, cov = update2(cov, 0.0, 1.0, reading.velocity_std * reading.velocity_std)
        x_load = axpy(ka, difference, x_load)
        v_load = axpy(kb, difference, v_load)
    return with_load(state, placed(load, x_load, v_load, cov, age), state.resets)


@kernel
def enter_load_position(history: History, k: int, past: Past, length: float, i: int) -> None:
    """Enter component i of x_Q + L q then."""
    enter_position(history, k, past, i)
    enter_direction(history, k, past, length * past.across[i], length * past.along[i])
    enter(history, k, LENGTH, past.q_cable[i])


@kernel
def enter_load_velocity(history: History, k: int, past: Past, length: float, i: int) -> None:
    """Enter component i of v_Q + L q' then: a turn (a, b) of the direction adds -(q' . turn) q to q'."""
    enter_velocity(history, k, past, i)
    q = past.q_cable
    enter(history, k, RATE, length * past.across[i])
    enter(history, k, RATE + 1, length * past.along[i])
    enter(history, k, DIRECTION, -length * dot(past.across, past.q_cable_dot) * q[i])
    enter(history, k, DIRECTION + 1, -length * dot(past.along, past.q_cable_dot) * q[i])
    enter(history, k, LENGTH, past.q_cable_dot[i])


@kernel
def correct_load(
    state: EstimatorState, history: History, reading: LoadReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after the reading; `history` is corrected along with it.

    The first reading starts the load; many rejected readings in a row restart it, and a few that are nearer
    than the cable is long make a taut cable slack.
    """
    state = heard(state, reading.age_s, TRACKED_SIZE)
    load, n = state.load, state.size
    if load.source != TRACKER:
        return start_load(state, history, reading, tuning)
    if load.taut == 0.0:
        return correct_slack(state, history, reading, tuning)
    past = look_back(state, history, tuning, reading.age_s)
    innovation = sub(reading.x_load, axpy(load.length, past.q_cable, past.x_quad))
    position_var = reading.position_std * reading.position_std
    for i in range(3):
        scalar(history, i, innovation[i], position_var)
        enter_load_position(history, i, past, load.length, i)
    gather(history, 0, 3, n)
    distance = norm(sub(reading.x_load, past.x_quad)) / tuning.cable_length
    short = SLACK_FROM < distance < SLACK_BELOW
    refused = not within_gate(history, LOAD, 3, tuning.gate_sigma)
    if refused or short:
        # closer to the threshold, rejections show that the load is no pendulum any more; the longer they
        # last, the closer
        short = short or SLACK_FROM < distance < REFUSED_BELOW
        if load.rejected >= REFUSED_LONG and load.held_s > LIFTING_S:
            length = load.length / tuning.cable_length
            short = short or SLACK_FROM < distance < REFUSED_LONG_BELOW * length
        if short and load.rejected + 1.0 >= SLACK_READINGS:
            return start_load(state, history, reading, tuning)
        return refuse_load(state, history, reading, tuning)
    begin(history)
    velocity_var = reading.velocity_std * reading.velocity_std
    difference = sub(reading.v_load, axpy(load.length, past.q_cable_dot, past.v_quad))
    count = 6 if reading.velocity_std >= 0.0 else 3
    for i in range(3):
        scalar(history, 3 + i, difference[i], velocity_var)
        enter_load_velocity(history, 3 + i, past, load.length, i)
    gather(history, 3, count, n)
    nis = absorb(history, count, n)
    history.consistency[LOAD, 0] += 1.0
    history.consistency[LOAD, 1] += nis
    state = inject(state, history)
    return with_load(state, load_at(state.load, reading.age_s, 0.0, TRACKER), state.resets)
