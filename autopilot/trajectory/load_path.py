"""The requested path of a step that gives the load's place as a function of time.

Signals are sums of cosines (`autopilot.trajectory.signals`); a trajectory through timed points is a spline of
degree 9 (`autopilot.trajectory.splines`). Both are evaluated exactly, with six derivatives.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from autopilot.geometry.kernel import kernel
from autopilot.trajectory.signals import Jet, SignalTable, evaluate, joints, signal_table
from autopilot.trajectory.splines import (
    COLUMNS,
    PieceTable,
    evaluate_piece,
    find_piece,
    interpolating_spline,
)
from missions.model import ZERO_AT_ENDS, LoadPath, Signals, Sine, Term, Trajectory, TrajectoryPoint

NO_PIECES: PieceTable = np.zeros((0, COLUMNS))


class PathTables(NamedTuple):
    """The requested path: `cosines` of signals, or the `curve` of a trajectory; the other table is empty."""

    cosines: SignalTable
    curve: PieceTable


NO_PATH = PathTables(signal_table(()), NO_PIECES)


def path_tables(step: LoadPath) -> PathTables:
    """The tables of a step for `evaluate_load_path`."""
    if isinstance(step, Signals):
        return PathTables(signal_table(step.terms), NO_PIECES)
    return PathTables(NO_PATH.cosines, _curve(step.points))


@lru_cache(maxsize=16)
def _curve(points: tuple[TrajectoryPoint, ...]) -> PieceTable:
    """The spline through the points. Each start of a mission needs it several times."""
    rows = np.array(points)
    return interpolating_spline(rows[:, 0], rows[:, 1:], ZERO_AT_ENDS)


@kernel
def evaluate_load_path(tables: PathTables, t: float) -> Jet:
    """Position (m, relative to the beginning) and derivatives 1 ... 6 at t (s), of a curve up to its end."""
    if tables.curve.shape[0] == 0:
        return evaluate(tables.cosines, t)
    row = find_piece(tables.curve, t)
    return evaluate_piece(tables.curve, row if row >= 0 else tables.curve.shape[0] - 1, t)


def path_joints(step: LoadPath) -> tuple[float, ...]:
    """Times (s), sorted, within the path at which derivatives may jump."""
    return joints(step.terms) if isinstance(step, Signals) else ()


def slower_step(step: LoadPath, factor: float) -> LoadPath:
    """The same path at 1 / factor of the speed."""
    if not isinstance(step, Signals):
        return Trajectory(tuple(point._replace(t_s=factor * point.t_s) for point in step.points))

    def sine(s: Sine) -> Sine:
        return Sine(factor * s.period_s, s.phase_rad, factor * s.start_s)

    def term(t: Term) -> Term:
        return Term(
            t.axis,
            t.amplitude_m,
            factor * t.start_s,
            factor * t.rise_s,
            None if t.hold_s is None else factor * t.hold_s,
            factor * t.fall_s,
            tuple(sine(s) for s in t.factors),
            None if t.rise_90_by_s is None else factor * t.rise_90_by_s,
        )

    return Signals(factor * step.duration_s, tuple(term(t) for t in step.terms))
