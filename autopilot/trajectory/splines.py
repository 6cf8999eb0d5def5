"""Paths as splines: smooth to the eighth derivative, evaluated as polynomials over equal intervals.

A spline of degree 9 over [begin, end] with N equal intervals has N + 9 coefficients for each axis. The first
seven and the last seven follow from position and six derivatives at the two ends, so that the spline joins
the paths before and after it without a jump of a rotor force. The rest are free: an optimisation chooses them
(`autopilot.trajectory.shaping`, `autopilot.trajectory.waypoint_path`).

SciPy's splines and its optimiser are named in full (`scipy.interpolate.make_interp_spline`): SciPy loads them
when they are first used, which takes a quarter of a second, and most missions need neither.

For flight a spline is converted to a table: for each interval the coefficients of (t - t_k)^n, so that
`evaluate_piece` is Horner's rule for all derivatives at the same time.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

import numpy as np
import scipy
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO
from autopilot.trajectory.signals import Jet
from autopilot.trajectory.spline_band import DEGREE, band_of, sums_of

Array = NDArray[np.float64]

ORDERS = 7  # position and six derivatives are matched at the ends

PieceTable = Array
"""A row for each interval: begin, end (s), then 10 coefficients of (t - begin)^n for east, north and up."""

COLUMNS = 2 + 3 * (DEGREE + 1)


class Basis:
    """The B-splines over [begin, end] s in `intervals` equal parts, and how they sum to a path."""

    def __init__(self, begin: float, end: float, intervals: int) -> None:
        self.breaks: Array = np.linspace(begin, end, intervals + 1)
        self.intervals = intervals
        self.count = intervals + DEGREE
        self.free = slice(ORDERS, self.count - ORDERS)
        # times are counted in intervals: knots are then exact integers, each of exactly one piece
        self.spacing = (end - begin) / intervals
        inner = np.arange(intervals + 1, dtype=np.float64)
        self._knots = np.concatenate([np.zeros(DEGREE), inner, np.full(DEGREE, float(intervals))])

    def band(self, times: Array, orders: int) -> tuple[Array, NDArray[np.int64]]:
        """(orders, n, 10): derivatives 0 ... orders - 1 of the B-splines that are not zero at each of n
        times; (n,): the index of the first of these."""
        u = (times - self.breaks[0]) / self.spacing
        first = np.clip(u.astype(np.int64), 0, self.intervals - 1)
        scales = np.array([self.spacing**order for order in range(orders)])
        return band_of(u, first, self._knots, scales), first

    def end_coefficients(self, before: Array, after: Array) -> Array:
        """(count, 3) coefficients: those that follow from the jets (7, 3) at the two ends; the others 0."""
        coefficients = np.zeros((self.count, 3))
        last = self.intervals - 1
        ends = (0.0, 0, before, slice(0, ORDERS)), (last + 1.0, last, after, slice(-ORDERS, None))
        for at, first, jet, part in ends:
            band = band_of(np.array([at]), np.array([first]), self._knots, np.ones(ORDERS))
            rows = band[:, 0, part]
            scaled = jet * self.spacing ** np.arange(ORDERS)[:, None]
            coefficients[part] = np.linalg.solve(rows, scaled)
        return coefficients

    def pieces(self, coefficients: Array, origin: Array) -> PieceTable:
        """The table of the spline with these coefficients (count, 3), moved by `origin` (3,)."""
        first = np.arange(self.intervals)
        band = band_of(first.astype(np.float64), first, self._knots, np.ones(DEGREE + 1))
        derivatives = sums_of(band, first, coefficients)
        table = np.empty((self.intervals, COLUMNS))
        table[:, 0], table[:, 1] = self.breaks[:-1], self.breaks[1:]
        by_power = table[:, 2:].reshape(self.intervals, 3, DEGREE + 1)
        for n in range(DEGREE + 1):
            by_power[:, :, n] = derivatives[n] / (factorial(n) * self.spacing**n)
        by_power[:, :, 0] += origin
        return table


def power_table(breaks: Array, powers: Array) -> PieceTable:
    """The table of n polynomials between n + 1 breaks (s): `powers` (n, m, 3) with m up to 10 are their
    coefficients of (t - begin)^i."""
    table = np.zeros((len(powers), COLUMNS))
    table[:, 0], table[:, 1] = breaks[:-1], breaks[1:]
    by_power = table[:, 2:].reshape(len(powers), 3, DEGREE + 1)
    by_power[:, :, : powers.shape[1]] = powers.transpose(0, 2, 1)
    return table


def interpolating_spline(times: Array, places: Array, zero_at_ends: Sequence[int]) -> PieceTable:
    """The spline of degree 9 through places (n, 3) at increasing times (n,), n >= 2, four of whose
    derivatives are zero at both ends."""
    rest = [(order, np.zeros(3)) for order in zero_at_ends]
    spline = scipy.interpolate.make_interp_spline(times, places, DEGREE, bc_type=(rest, rest))
    breaks = np.unique(spline.t)
    orders = [spline(breaks[:-1], nu=n) / factorial(n) for n in range(DEGREE + 1)]
    return power_table(breaks, np.stack(orders, axis=1))


@kernel
def find_piece(table: PieceTable, t: float) -> int:
    """The row whose interval contains t, -1 if there is none; rows are in order and may leave gaps."""
    low, high = 0, table.shape[0]
    while low < high:
        middle = (low + high) // 2
        if table[middle, 0] <= t:
            low = middle + 1
        else:
            high = middle
    return low - 1 if low > 0 and t < table[low - 1, 1] else -1


@kernel
def evaluate_piece(table: PieceTable, row: int, t: float) -> Jet:
    """Position and derivatives 1 ... 6 of the piece in `row` at time t (s)."""
    u = t - table[row, 0]
    d0, d1, d2, d3, d4, d5, d6 = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
    for n in range(9, -1, -1):
        c = (table[row, 2 + n], table[row, 12 + n], table[row, 22 + n])
        d6 = (d6[0] * u + d5[0], d6[1] * u + d5[1], d6[2] * u + d5[2])
        d5 = (d5[0] * u + d4[0], d5[1] * u + d4[1], d5[2] * u + d4[2])
        d4 = (d4[0] * u + d3[0], d4[1] * u + d3[1], d4[2] * u + d3[2])
        d3 = (d3[0] * u + d2[0], d3[1] * u + d2[1], d3[2] * u + d2[2])
        d2 = (d2[0] * u + d1[0], d2[1] * u + d1[1], d2[2] * u + d1[2])
        d1 = (d1[0] * u + d0[0], d1[1] * u + d0[1], d1[2] * u + d0[2])
        d0 = (d0[0] * u + c[0], d0[1] * u + c[1], d0[2] * u + c[2])
    return (
        d0,
        d1,
        (2.0 * d2[0], 2.0 * d2[1], 2.0 * d2[2]),
        (6.0 * d3[0], 6.0 * d3[1], 6.0 * d3[2]),
        (24.0 * d4[0], 24.0 * d4[1], 24.0 * d4[2]),
        (120.0 * d5[0], 120.0 * d5[1], 120.0 * d5[2]),
        (720.0 * d6[0], 720.0 * d6[1], 720.0 * d6[2]),
    )


@kernel
def evaluate_path(table: PieceTable, t: float) -> Jet:
    """The path at t (s), at rest before its beginning and after its end."""
    row = find_piece(table, t)
    if row >= 0:
        return evaluate_piece(table, row, t)
    if t < table[0, 0]:
        x = (table[0, 2], table[0, 12], table[0, 22])
    else:
        last = table.shape[0] - 1
        x = evaluate_piece(table, last, table[last, 1])[0]
    return x, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
