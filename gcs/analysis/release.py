"""Whether the load is on the cable, from where the two are: nobody sends it, and old logs have it too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcs.analysis.tracks import LoadTrack

BEYOND_M = 0.02  # a slack cable is shorter than when it was taut; more than noise and single precision


def attached(load: LoadTrack) -> NDArray[np.bool_]:
    """(n,) True unless the load has left the cable.

    It has where the ends are farther apart than when the cable was taut last, though it is not taut: then
    from the last time it was taut until it is again. Before the cable was taut for the first time it counts
    as attached.
    """
    n = len(load.time_s)
    taut = np.flatnonzero(load.taut == 1)
    if not len(taut):
        return np.ones(n, dtype=np.bool_)
    last = np.searchsorted(taut, np.arange(n), side="right") - 1  # which of them, -1 before the first
    length_m = load.distance_m[taut[np.maximum(last, 0)]]
    slack = (load.taut != 1) & (last >= 0)
    apart = slack & (load.distance_m > length_m + BEYOND_M)
    lost = np.zeros(len(taut) + 1, dtype=np.bool_)
    lost[last[apart]] = True
    return np.asarray(~(slack & lost[last]))
