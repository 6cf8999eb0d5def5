"""Whether the load is on the cable, derived from positions: no message carries it, so old logs work too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcs.analysis.tracks import LoadTrack

RELEASE_MARGIN_M = (
    0.02  # a slack cable is shorter than when it was taut; more than noise and single precision
)


def attached(load: LoadTrack) -> NDArray[np.bool_]:
    """(n,) True unless the load has left the cable.

    The load has left the cable if the cable is not taut but its ends are farther apart than when it was last
    taut: then from the last time it was taut until it is taut again. Before the cable was taut for the first
    time, the load counts as attached.
    """
    n = len(load.time_s)
    taut = np.flatnonzero(load.taut == 1)
    if not len(taut):
        return np.ones(n, dtype=np.bool_)
    last = np.searchsorted(taut, np.arange(n), side="right") - 1  # index into `taut`, -1 before the first
    length_m = load.distance_m[taut[np.maximum(last, 0)]]
    slack = (load.taut != 1) & (last >= 0)
    too_far = slack & (load.distance_m > length_m + RELEASE_MARGIN_M)
    released = np.zeros(len(taut) + 1, dtype=np.bool_)
    released[last[too_far]] = True
    return np.asarray(~(slack & released[last]))
