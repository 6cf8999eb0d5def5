"""What the legs of a flight ask for, laid out tick by tick for a stretch of it."""

from __future__ import annotations

import numpy as np

from autopilot.geometry.kernel import kernel
from autopilot.guidance import Creep, Hold, Leg, Run, Transfer
from gcs.sweep.world import Floats
from missions.signals import SignalTable, evaluate
from missions.transfer import transfer

COLUMNS = 21  # position and six derivatives


@kernel
def _put(row: Floats, jet: tuple[tuple[float, float, float], ...]) -> None:
    for i in range(7):
        for j in range(3):
            row[3 * i + j] = jet[i][j]


@kernel
def _transfers(
    times: Floats,
    begin: tuple[float, float, float],
    end: tuple[float, float, float],
    duration: float,
    out: Floats,
) -> None:
    for k in range(times.shape[0]):
        _put(out[k], transfer(begin, end, duration, times[k]))


@kernel
def _runs(times: Floats, anchor: tuple[float, float, float], table: SignalTable, out: Floats) -> None:
    for k in range(times.shape[0]):
        _put(out[k], evaluate(table, times[k]))
        for j in range(3):
            out[k, j] = anchor[j] + out[k, j]


def jets(leg: Leg, times_s: Floats) -> Floats:
    """(n, 21) `leg.jet` at each of the n times (s into the leg): by machine code for the kinds that last."""
    found = np.zeros((len(times_s), COLUMNS))
    # a subclass may mean something else
    kind = type(leg)
    if kind is Transfer:
        _transfers(times_s, leg.begin, leg.end, leg.duration_s, found)  # type: ignore[union-attr]
    elif kind is Run:
        _runs(times_s, leg.anchor, leg.table, found)  # type: ignore[union-attr]
    elif kind is Hold:
        found[:, :3] = leg.position  # type: ignore[union-attr]
    elif kind is Creep:
        for j in range(3):
            found[:, j] = leg.begin[j] + times_s * leg.velocity[j]  # type: ignore[union-attr]
        found[:, 3:6] = leg.velocity  # type: ignore[union-attr]
    else:
        for k, t in enumerate(times_s.tolist()):
            found[k] = np.ravel(leg.jet(t))
    return found
