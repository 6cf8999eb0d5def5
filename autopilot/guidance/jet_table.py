"""The setpoints of the legs of a flight, computed in advance, tick by tick, for a stretch of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.guidance.legs import (
    Creep,
    Hold,
    Leg,
    PathResume,
    PathStretch,
    Reel,
    SignalRun,
    Transfer,
    requested_jet,
)
from autopilot.trajectory.load_path import PathTables
from autopilot.trajectory.reeling import reel, straight_way
from autopilot.trajectory.shaping import evaluate_requested, evaluate_shaped
from autopilot.trajectory.signals import Jet
from autopilot.trajectory.splines import PieceTable, evaluate_path
from autopilot.trajectory.transfer import transfer

Floats = NDArray[np.float64]
COLUMNS = 21  # position and six derivatives


@kernel
def _put(row: Floats, jet: Jet) -> None:
    for i in range(7):
        for j in range(3):
            row[3 * i + j] = jet[i][j]


@kernel
def _straight_ways(
    times: Floats, begin: Vec3, end: Vec3, duration: float, ramp_s: float, out: Floats
) -> None:
    for k in range(times.shape[0]):
        _put(out[k], straight_way(begin, end, duration, ramp_s, times[k]))


@kernel
def _runs(
    times: Floats,
    tables: PathTables,
    pieces: PieceTable,
    duration: float,
    lead: float,
    anchor: Vec3,
    requested: bool,
    out: Floats,
) -> None:
    for k in range(times.shape[0]):
        if requested:
            _put(out[k], evaluate_requested(tables, duration, times[k] - lead))
        else:
            _put(out[k], evaluate_shaped(tables, pieces, duration, times[k] - lead))
        for j in range(3):
            out[k, j] = anchor[j] + out[k, j]


@kernel
def _reels(times: Floats, begin: Vec3, speed: float, ramp_s: float, cruise_s: float, out: Floats) -> None:
    for k in range(times.shape[0]):
        _put(out[k], reel(begin, speed, ramp_s, cruise_s, times[k]))


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


def jets(leg: Leg, times_s: Floats, requested: bool = False) -> Floats:
    """(n, 21) `leg.jet` (or `requested_jet`) at each of the n times (s into the leg), in machine code for the
    kinds of legs that last long."""
    found = np.zeros((len(times_s), COLUMNS))
    # by the exact type: a leg of a subclass may mean something else
    if type(leg) is SignalRun:
        path = leg.path
        as_requested = requested or flies_requested_path(leg)
        _runs(
            times_s, path.tables, path.pieces, path.duration_s, path.lead_s, leg.anchor, as_requested, found
        )
    elif type(leg) is Transfer:
        _straight_ways(times_s, leg.begin, leg.end, leg.pace.duration_s, leg.pace.ramp_s, found)
    elif type(leg) is PathStretch:
        _passes(times_s, leg.path.table, leg.path.begin_s, leg.offset, leg.fade_s, found)
    elif type(leg) is Reel:
        _reels(times_s, leg.begin, leg.speed, leg.ramp_s, leg.cruise_s, found)
    elif type(leg) is Hold:
        found[:, :3] = leg.position
    elif type(leg) is Creep:
        for j in range(3):
            found[:, j] = leg.begin[j] + times_s * leg.velocity[j]
        found[:, 3:6] = leg.velocity
    else:
        for k, t in enumerate(times_s.tolist()):
            found[k] = np.ravel(requested_jet(leg, t) if requested else leg.jet(t))
    return found


def flies_requested_path(leg: Leg) -> bool:
    """Whether the setpoints of a leg are those of the path that was requested: of all legs except signals
    that were shaped."""
    run = leg.run if isinstance(leg, PathResume) else leg
    return not isinstance(run, SignalRun) or len(run.path.pieces) == 0


def jets_ahead(legs: Sequence[Leg], times_s: Floats) -> Floats:
    """(n, 21) setpoints at n times (s into the first leg), which do not decrease, into the legs that follow.

    Only following legs with the control mode of the first one are used.
    """
    chain = [legs[0]]
    for after in legs[1:]:
        if after.control_mode != chain[0].control_mode:
            break
        chain.append(after)
    parts, t = [], times_s
    for leg in chain[:-1]:
        own = int(np.searchsorted(t, leg.duration_s, side="left"))
        parts.append(jets(leg, t[:own]))
        t = t[own:] - leg.duration_s
        if not len(t):
            break
    else:
        parts.append(jets(chain[-1], t))
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
