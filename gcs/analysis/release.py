"""Whether the load is on the cable, derived from positions: no message carries it, so old logs work too."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gcs.analysis.tracks import LoadTrack

RELEASE_MARGIN_M = (
    0.02  # a slack cable is shorter than when it was taut; more than noise and single precision
)


def cable_length(parameters: Mapping[str, float]) -> float:
    """Length (m) of the cable by the parameters of a log: the true one, or else the assumed one; infinite if
    neither is known."""
    return parameters.get("SIM_CABLE_LEN", parameters.get("VEH_CABLE_LEN", math.inf))


def attached(load: LoadTrack, cable_m: float) -> NDArray[np.bool_]:
    """(n,) True unless the load has left the cable.

    The load has left the cable if the cable is not taut but its ends are farther apart than when it was last
    taut: then from the last time it was taut until it is taut again. Before the cable was taut for the first
    time, `cable_m` counts as that distance.
    """
    taut = np.flatnonzero(load.taut == 1)
    # index into `taut`; -1 before the first, which is also the last place of the following two
    last = np.searchsorted(taut, np.arange(len(load.time_s)), side="right") - 1
    length_m = np.append(load.distance_m[taut], cable_m)[last]
    slack = load.taut != 1
    too_far = slack & (load.distance_m > length_m + RELEASE_MARGIN_M)
    released = np.zeros(len(taut) + 1, dtype=np.bool_)
    released[last[too_far]] = True
    return np.asarray(~(slack & released[last]))
