"""Estimator transition at load release: the load is by itself, and no cable ends in it."""

from __future__ import annotations

from autopilot.estimation.records import TRACKER, EstimatorState, EstimatorTuning, History
from autopilot.estimation.tautness import moved, slacken
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import with_field

# The error of a load that hung is a few millimetres and centimetres a second; a falling one is soon seen.
PLACE_STD, SPEED_STD = 0.02, 0.2  # m, m/s


@kernel
def parted(state: EstimatorState, history: History, tuning: EstimatorTuning) -> EstimatorState:
    """The estimate with the load by itself; the same where it is by itself already.

    A load that no tracker follows is taken to lie on the ground, under where it was let go.
    """
    load = state.load
    if load.taut == 0.0:
        return state
    load = slacken(load, history, PLACE_STD * PLACE_STD, SPEED_STD * SPEED_STD)
    if load.source != TRACKER:
        load = moved(load, (load.x_load[0], load.x_load[1], tuning.load_height))
    return with_field(state, "load", load)
