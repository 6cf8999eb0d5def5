"""The estimate when the load is released: the load is estimated separately, and the cable carries nothing."""

from __future__ import annotations

from autopilot.estimation.records import TRACKER, EstimatorState, EstimatorTuning, History
from autopilot.estimation.tautness import moved, slacken
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import with_field

# A load that hung is known to a few millimetres and centimetres per second; a falling load is soon seen.
PLACE_STD, SPEED_STD = 0.02, 0.2  # m, m/s


@kernel
def parted(state: EstimatorState, history: History, tuning: EstimatorTuning) -> EstimatorState:
    """The estimate with a separate load; unchanged where the cable is slack already.

    A load that no tracker follows is assumed to lie on the ground below the place of its release.
    """
    load = state.load
    if load.taut == 0.0:
        return state
    load = slacken(load, history, PLACE_STD * PLACE_STD, SPEED_STD * SPEED_STD)
    if load.source != TRACKER:
        load = moved(load, (load.x_load[0], load.x_load[1], tuning.load_height))
    return with_field(state, "load", load)
