"""What the legs of a flight ask for, laid out tick by tick for a stretch of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.guidance.legs import Creep, Hold, Leg, Pass, Run, Transfer, asked_jet
from autopilot.trajectory.shaping import evaluate_asked, evaluate_shaped
from autopilot.trajectory.signals import Jet, SignalTable
from autopilot.trajectory.splines import PieceTable
from autopilot.trajectory.transfer import transfer
from autopilot.trajectory.waypoint_path import evaluate_path

Floats = NDArray[np.float64]
COLUMNS = 21  # position and six derivatives


@kernel
def _put(row: Floats, jet: Jet) -> None:
    for i in range(7):
        for j in range(3):
            row[3 * i + j] = jet[i][j]


@kernel
def _transfers(times: Floats, begin: Vec3, end: Vec3, duration: float, out: Floats) -> None:
    for k in range(times.shape[0]):
        _put(out[k], transfer(begin, end, duration, times[k]))


@kernel
def _runs(
    times: Floats,
    anchor: Vec3,
    table: SignalTable,
    pieces: PieceTable,
    duration: float,
    lead: float,
    asked: bool,
    out: Floats,
) -> None:
    for k in range(times.shape[0]):
        if asked:
            _put(out[k], evaluate_asked(table, duration, times[k] - lead))
        else:
            _put(out[k], evaluate_shaped(table, pieces, duration, times[k] - lead))
        for j in range(3):
            out[k, j] = anchor[j] + out[k, j]


@kernel
def _passes(
    times: Floats, table: PieceTable, begin_s: float, offset: Vec3, fade_s: float, out: Floats
) -> None:
    for k in range(times.shape[0]):
        at = begin_s + times[k]
        _put(out[k], evaluate_path(table, at))
        fading = transfer(offset, ZERO, fade_s, at)
        for i in range(7):
            for j in range(3):
                out[k, 3 * i + j] = out[k, 3 * i + j] + fading[i][j]


def jets(leg: Leg, times_s: Floats, asked: bool = False) -> Floats:
    """(n, 21) `leg.jet` (or `asked_jet`) at each of the n times (s into the leg): in machine code for the
    kinds that last."""
    found = np.zeros((len(times_s), COLUMNS))
    # by the very type: a leg of another type may mean something else
    if type(leg) is Transfer:
        _transfers(times_s, leg.begin, leg.end, leg.duration_s, found)
    elif type(leg) is Run:
        path = leg.path
        _runs(times_s, leg.anchor, path.table, path.pieces, path.duration_s, path.lead_s, asked, found)
    elif type(leg) is Pass:
        _passes(times_s, leg.path.table, leg.path.begin_s, leg.offset, leg.fade_s, found)
    elif type(leg) is Hold:
        found[:, :3] = leg.position
    elif type(leg) is Creep:
        for j in range(3):
            found[:, j] = leg.begin[j] + times_s * leg.velocity[j]
        found[:, 3:6] = leg.velocity
    else:
        for k, t in enumerate(times_s.tolist()):
            found[k] = np.ravel(asked_jet(leg, t) if asked else leg.jet(t))
    return found


def jets_ahead(legs: Sequence[Leg], times_s: Floats) -> Floats:
    """(n, 21) setpoints at n times (s into the first leg), which do not decrease, into the legs that follow.

    Only legs that control the same as the first one follow it for this.
    """
    found = np.zeros((len(times_s), COLUMNS))
    chain = [legs[0]]
    for after in legs[1:]:
        if after.control_mode != chain[0].control_mode:
            break
        chain.append(after)
    begin, t = 0, times_s
    for i, leg in enumerate(chain):
        end = len(times_s)
        if i + 1 < len(chain):
            end = begin + int(np.searchsorted(t, leg.duration_s, side="left"))
            found[begin:end] = jets(leg, t[: end - begin])
            t = t[end - begin :] - leg.duration_s
            begin = end
        else:
            found[begin:end] = jets(leg, t)
    return found
