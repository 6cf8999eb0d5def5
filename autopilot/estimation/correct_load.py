"""Correction by a load tracker: position of the load, hence direction of the cable, and their rates."""

from __future__ import annotations

from autopilot.estimation.correct_pose import REJECTIONS_BEFORE_RESET, gate
from autopilot.estimation.history import look_back, renew, shift
from autopilot.estimation.records import (
    Q_CABLE,
    X_LOAD,
    X_QUAD,
    Covariance2,
    EstimatorState,
    EstimatorTuning,
    History,
    LoadEstimate,
    LoadReading,
)
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import add, axpy, norm, scale, sub
from autopilot.geometry.s2 import normalise, tangent


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
def refuse_load(estimate: LoadEstimate) -> LoadEstimate:
    """The load with one more reading refused."""
    return LoadEstimate(
        estimate.x_load,
        estimate.v_load,
        estimate.q_cable,
        estimate.q_cable_dot,
        estimate.covariance,
        estimate.cable_covariance,
        estimate.taut,
        estimate.tension,
        estimate.age_s,
        estimate.rejected + 1.0,
    )


@kernel
def with_load(state: EstimatorState, load: LoadEstimate, resets: float) -> EstimatorState:
    """The state with its load replaced."""
    return EstimatorState(state.time_s, state.vehicle, load, state.last_imu, resets, state.head)


@kernel
def correct_load(
    state: EstimatorState, history: History, reading: LoadReading, tuning: EstimatorTuning
) -> EstimatorState:
    """The state after the reading; `history` is corrected along with it.

    The first reading starts the load; readings refused many times in a row start it anew.
    """
    load, vehicle = state.load, state.vehicle
    since = state.time_s - reading.age_s
    at = look_back(state.head, history, since, X_QUAD)
    separation = sub(reading.x_load, (at[0], at[1], at[2]))
    # on the ground the vehicle may stand beside the load: keep the direction's noise finite
    distance = max(norm(separation), 0.1 * tuning.cable_length)
    direction = normalise(separation)
    position_var = reading.position_std * reading.position_std
    velocity_var = reading.velocity_std * reading.velocity_std
    measured = reading.velocity_std >= 0.0

    at = look_back(state.head, history, since, X_LOAD)
    innovation = sub(reading.x_load, (at[0], at[1], at[2]))
    starting = load.age_s == float("inf")
    age = reading.age_s
    aa, ab, bb = load.covariance
    past_var = aa - 2.0 * age * ab + age * age * bb
    if not starting and not gate(innovation, past_var + position_var, tuning.gate_sigma):
        if load.rejected + 1.0 < REJECTIONS_BEFORE_RESET:
            return with_load(state, refuse_load(load), state.resets)
        starting = True
    if starting:
        v_load = reading.v_load if measured else (0.0, 0.0, 0.0)
        rate_var = velocity_var if measured else 1.0
        turn_var = rate_var / (distance * distance)
        direction_var = position_var / (distance * distance)
        started = LoadEstimate(
            reading.x_load,
            v_load,
            direction,
            tangent(direction, scale(1.0 / distance, sub(v_load, vehicle.v_quad))),
            (position_var + age * age * rate_var, age * rate_var, rate_var),
            (direction_var + age * age * turn_var, age * turn_var, turn_var),
            load.taut,
            0.0,
            reading.age_s,
            0.0,
        )
        renew(history, X_LOAD, reading.x_load)
        renew(history, Q_CABLE, direction)
        return with_load(state, started, state.resets + 1.0)

    ka, kb, cov_load = update2(load.covariance, 1.0, -age, position_var)
    moved, faster = scale(ka, innovation), scale(kb, innovation)
    x_load = add(load.x_load, moved)
    v_load = axpy(kb, innovation, load.v_load)

    at = look_back(state.head, history, since, Q_CABLE)
    past_q = normalise((at[0], at[1], at[2]))
    off = tangent(past_q, direction)
    direction_var = (position_var + vehicle.covariance[0]) / (distance * distance)
    ka, kb, cov_cable = update2(load.cable_covariance, 1.0, -age, direction_var)
    turned, turning = scale(ka, off), scale(kb, off)
    q_cable = normalise(add(load.q_cable, turned))
    q_cable_dot = tangent(q_cable, axpy(kb, off, load.q_cable_dot))
    if measured:
        difference = sub(reading.v_load, v_load)
        ka, kb, cov_load = update2(cov_load, 0.0, 1.0, velocity_var)
        moved, faster = axpy(ka, difference, moved), axpy(kb, difference, faster)
        x_load = axpy(ka, difference, x_load)
        v_load = axpy(kb, difference, v_load)
        rate = tangent(q_cable, scale(1.0 / distance, sub(reading.v_load, vehicle.v_quad)))
        off = sub(rate, q_cable_dot)
        rate_var = (velocity_var + vehicle.covariance[3]) / (distance * distance)
        ka, kb, cov_cable = update2(cov_cable, 0.0, 1.0, rate_var)
        turned, turning = axpy(ka, off, turned), axpy(kb, off, turning)
        q_cable = normalise(axpy(ka, off, q_cable))
        q_cable_dot = tangent(q_cable, axpy(kb, off, q_cable_dot))
    shift(state.head, history, since, X_LOAD, moved, faster)
    shift(state.head, history, since, Q_CABLE, turned, turning)
    corrected = LoadEstimate(
        x_load,
        v_load,
        q_cable,
        q_cable_dot,
        cov_load,
        cov_cable,
        load.taut,
        load.tension,
        reading.age_s,
        0.0,
    )
    return with_load(state, corrected, state.resets)
