"""Correction by a cable that comes taut: the load lies, so the vehicle is one cable length above the ground.

A plain receiver and a barometer know the height to decimetres; here the height is measured once, and the
climb rate, which is zero.
"""

from __future__ import annotations

from autopilot.estimation.correction import inject, look_back, with_aids
from autopilot.estimation.covariance import absorb, begin, farness, gather, scalar
from autopilot.estimation.measurements.load import enter_load_position, enter_load_velocity
from autopilot.estimation.records import (
    CAMERA,
    RECEIVER,
    AidEstimate,
    EstimatorState,
    EstimatorTuning,
    History,
    LoadEstimate,
)
from autopilot.estimation.tautness import PULL_SLACK, loosely_tied
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3

LYING_STD = 0.02  # m, of the height of a load that a snap may lift by millimetres
RESTING_STD = 0.05  # m/s, of its climb
RESTING_S = 0.3  # in which measurements of a lying load's climb count as one: samples are not independent


@kernel
def _owing(a: AidEstimate, debt: Vec3) -> AidEstimate:
    return AidEstimate(
        a.mounting,
        a.heading,
        a.barometer,
        a.gnss,
        a.horizontal_slow,
        a.vertical_slow,
        a.reversion,
        debt,
        a.field,
        a.magnetic_age,
        a.barometer_age,
        a.rejected,
    )


@kernel
def correct_tautened(
    state: EstimatorState, history: History, before: LoadEstimate, tuning: EstimatorTuning, dt: float
) -> EstimatorState:
    """The state after a prediction over dt seconds; `before` is the load before this prediction.

    A cable that comes taut measures height and climb rate; the climb rate is also measured while the cable
    pulls and the load still lies. The laws receive the correction of the height at once: they are about to
    lift the load off this ground.
    """
    load = state.load
    if state.vehicle.source != RECEIVER or load.source != CAMERA or load.taut == 0.0:
        return state
    tied = before.taut == 0.0
    pulls = load.pull > PULL_SLACK * tuning.load_mass * tuning.gravity
    if not tied and not (pulls and loosely_tied(load, state.memory_s, state.unfelt)):
        return state
    n, debt = state.size, state.aids.debt
    past = look_back(state, history, tuning, 0.0)
    begin(history)
    count = 0
    climb_var = RESTING_STD * RESTING_STD * (1.0 if tied else max(1.0, RESTING_S / dt))
    if tied:
        scalar(history, 0, before.x_load[2] - load.x_load[2], LYING_STD * LYING_STD)
        enter_load_position(history, 0, past, load.length, 2)
        gather(history, 0, 1, n)
        if not farness(history, 1) <= tuning.gate_sigma * tuning.gate_sigma:
            return state
        count = 1
    climb = past.v_quad[2] + load.length * past.q_cable_dot[2]
    scalar(history, count, -climb, climb_var)
    enter_load_velocity(history, count, past, load.length, 2)
    gather(history, count, count + 1, n)
    absorb(history, count + 1, n)
    state = inject(state, history)
    owed = state.aids.debt
    return with_aids(state, _owing(state.aids, (owed[0], owed[1], debt[2])))
