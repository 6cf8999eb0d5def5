"""The estimate when the load is released: the load is estimated separately, and the cable carries nothing."""

from __future__ import annotations

from autopilot.estimation.records import TRACKER, EstimatorState, EstimatorTuning, History
from autopilot.estimation.tautness import slacken
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import with_field

# A suspended load is known to a few millimetres and centimetres per second; a falling load is soon observed.
RELEASE_POSITION_STD, RELEASE_SPEED_STD = 0.02, 0.2  # m, m/s


@kernel
def release_load(state: EstimatorState, history: History, tuning: EstimatorTuning) -> EstimatorState:
    """The estimate with a separate load; unchanged where the cable is slack already.

    A load that no tracker follows is assumed to be on the ground below the place of its release.
    """
    load = state.load
    if load.taut == 0.0:
        return state
    load = slacken(
        load, history, RELEASE_POSITION_STD * RELEASE_POSITION_STD, RELEASE_SPEED_STD * RELEASE_SPEED_STD
    )
    if load.source != TRACKER:
        load = with_field(load, "x_load", (load.x_load[0], load.x_load[1], tuning.load_height))
    return with_field(state, "load", load)
