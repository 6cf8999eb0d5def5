"""Minimum-snap flight of the load through waypoints: from rest, past each in turn without a stop, to rest.

The path is a spline (`autopilot.trajectory.splines`) that passes each waypoint exactly and minimises

    integral of |x''''|^2 + tau^4 |x^(6)|^2

x'''' is the snap of the load; x^(6) determines how the vehicle turns, and tau is the time over which that
matters: with the snap alone the path would leave rest with a jump of the moment. The times at the waypoints
are those of the least integral for a given total time (`optimal_time_shares`); for many waypoints those of a
ride along the straight lines between them (`ride_time_shares`). The total follows from the form that was
requested:

* at a given speed: as short as the peak speed and peak acceleration allow,
* time-optimal: as short as the bounds on rotors, cable and tilt allow.

In either form the bounds hold along the whole path, drag of the vehicle included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import ceil, dist, sqrt

import numpy as np
import scipy
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.trajectory.convex import band_jets, excess
from autopilot.trajectory.peaks import Body
from autopilot.trajectory.rotor_demand import Bounds, demand
from autopilot.trajectory.signals import Jet
from autopilot.trajectory.splines import DEGREE, ORDERS, Array, Basis, PieceTable, evaluate_piece, find_piece
from autopilot.trajectory.transfer import PEAK_SPEED, transfer_duration

Indices = NDArray[np.int64]

ROTATION_TIME_S = 0.25  # tau
MIN_WAYPOINT_DISTANCE_M = 0.05  # waypoints closer to each other than this are flown from rest to rest
MAX_POINTS = 40  # of one path
_PER_SEGMENT = 8  # intervals to the shortest segment
_MAX_INTERVALS = 400
_SAMPLES = 4  # to an interval, of the integral
_FINE_S = 0.01
# 50 to an interval: a flight of hours needs no more memory than one of minutes
_MAX_FINE_SAMPLES = 20_000
_TIME_SHARE_ITERATIONS = 6
# most segments for which times are optimised; beyond it the shares of a ride apply
_MAX_OPTIMISED_SEGMENTS = 8
_SCALING_ROUNDS = 8
_LENGTHENING = 1.15
_RIDE_ACCEL_SHARE = 2.0 / 3.0  # of the peak acceleration, for speeding up; the rest is left for turns
_RIDE_SAMPLES = 400  # of speeding up
# way while speeding up, as a share of cruise speed times the time of speeding up: the integral of the s of
# `autopilot.trajectory.transfer`, whose slope is 12012 u^6 (1 - u)^6
_RAMP = (12012.0 * Polynomial([0.0, 1.0]) ** 6 * Polynomial([1.0, -1.0]) ** 6).integ(2)
_BAND = DEGREE + 1


@dataclass(frozen=True, slots=True)
class PathSegment:
    """A stretch of a path through waypoints, from `begin_s` to `end_s` on its clock; m, ENU from home."""

    table: PieceTable
    begin_s: float
    end_s: float
    start: Vec3  # where the whole path begins


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


@kernel
def _fill(table: PieceTable, times: Array, out: Array) -> None:
    for i in range(times.shape[0]):
        jet = evaluate_path(table, times[i])
        for order in range(7):
            for axis in range(3):
                out[order, i, axis] = jet[order][axis]


def sample_path(table: PieceTable, times: Array) -> Array:
    """(7, n, 3) jets along the path."""
    out = np.empty((7, times.size, 3))
    _fill(table, times, out)
    return out


class _Grid:
    """The spline of a path of `total_s` seconds in `intervals` parts, and the integral as a quadratic form of
    its coefficients, whatever points the path passes."""

    def __init__(self, total_s: float, intervals: int) -> None:
        self.basis = basis = Basis(0.0, total_s, intervals)
        times = np.linspace(0.0, total_s, _SAMPLES * intervals + 1)
        values, first = basis.band(times, 7)
        self.spacing = spacing = float(times[1])
        four, six = (self.matrix(values[order], first) for order in (4, 6))
        self.snap, self.turn = four, six
        self.hessian = spacing * (four.T @ four + ROTATION_TIME_S**4 * (six.T @ six))
        free = slice(basis.free.start, basis.free.stop)
        hessian = self.hessian[free, free]
        # the scale keeps the two kinds of rows comparable in size for pivoting
        self.scale = float(np.median(hessian.diagonal()))
        self.scaled_hessian = hessian / self.scale

    def matrix(self, values: Array, first: Indices) -> sparse.csr_matrix:
        """(n, count) matrix of one derivative at n times by the coefficients of one axis."""
        n = len(values)
        columns = first[:, None] + np.arange(_BAND)
        rows = np.repeat(np.arange(n), _BAND).reshape(n, _BAND)
        return sparse.csr_matrix(
            (values.ravel(), (rows.ravel(), columns.ravel())), shape=(n, self.basis.count)
        )


# the times at the points are searched with the same total: nearly all paths that are compared have one grid
_grid = lru_cache(maxsize=4)(_Grid)


class MinimumSnap:
    """The smoothest path from rest at the first point, past others at their times, to rest at the last."""

    def __init__(self, points: Array, times: Array) -> None:
        segments = np.diff(times)
        count = ceil(_PER_SEGMENT * times[-1] / segments.min())
        # `_PER_SEGMENT` intervals to the shortest segment, but within the limits on their number
        grid = _grid(float(times[-1]), int(np.clip(count, 2 * ORDERS, _MAX_INTERVALS)))
        self.basis = basis = grid.basis
        self.origin: Array = points[0]
        ends = np.zeros((2, ORDERS, 3))
        ends[1, 0] = points[-1] - self.origin
        fixed = basis.end_coefficients(ends[0], ends[1])
        values, first = basis.band(times[1:-1], 1)
        passing = grid.matrix(values[0], first)
        free = slice(basis.free.start, basis.free.stop)
        A = passing[:, free]
        n = A.shape[1]
        system = sparse.bmat([[grid.scaled_hessian, A.T], [A, None]], format="csc")
        right_side = np.vstack(
            [
                -(grid.hessian @ fixed)[free] / grid.scale,
                (points[1:-1] - self.origin) - passing @ fixed,
            ]
        )
        self.coefficients: Array = fixed.copy()
        factor = splu(system)
        solved = factor.solve(right_side)
        # one step of refinement with the residual: the least integral is small compared with its terms
        solved += factor.solve(right_side - system @ solved)
        self.coefficients[free] = solved[:n]
        snap, turn = grid.snap @ self.coefficients, grid.turn @ self.coefficients
        self.cost = grid.spacing * float(np.sum(snap * snap) + ROTATION_TIME_S**4 * np.sum(turn * turn))

    def jets(self) -> tuple[Array, Array]:
        """Times (n,) and jets (7, n, 3) along the path, relative to its first point."""
        total_s = float(self.basis.breaks[-1])
        times = np.linspace(0.0, total_s, int(np.clip(total_s / _FINE_S, 50, _MAX_FINE_SAMPLES)) + 1)
        values, first = self.basis.band(times, 7)
        return times, band_jets(values, first, self.coefficients)

    def table(self) -> PieceTable:
        """The path as a table, as it is flown."""
        return self.basis.pieces(self.coefficients, self.origin)


def approximate_time_shares(points: Array) -> Array:
    """Share of the total time for each segment, about as transfers at speed 1 and acceleration 1 would take
    them without the stops in between."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    times = np.sqrt(lengths) if len(lengths) == 1 else lengths.copy()
    if len(lengths) > 1:
        mean = float(lengths.mean())
        times[0] += 0.7 * mean
        times[-1] += 0.7 * mean
    return np.asarray(times / times.sum())


def optimal_time_shares(points: Array, total_s: float) -> Array:
    """The share of `total_s` seconds for each segment that minimises the integral."""
    begin = np.log(approximate_time_shares(points))
    if len(begin) == 1:
        return np.exp(begin)

    def shares(x: Array) -> Array:
        scaled = np.exp(x - x.max())
        return np.asarray(scaled / scaled.sum())

    def cost(x: Array) -> float:
        return float(np.log(MinimumSnap(points, _point_times(shares(x), total_s)).cost))

    bounds = [(value - 0.7, value + 0.7) for value in begin]
    result = scipy.optimize.minimize(
        cost,
        begin,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": _TIME_SHARE_ITERATIONS, "eps": 1e-3},
    )
    return shares(result.x)


def ride(length: float, speed: float, accel: float) -> tuple[float, float, float]:
    """A ride over `length` m: its greatest speed (m/s), in how many seconds it is reached, and the time (s)
    of the ride."""
    ramp_accel = _RIDE_ACCEL_SHARE * accel
    cruise = min(speed, sqrt(length * ramp_accel / PEAK_SPEED))
    ramp_s = PEAK_SPEED * cruise / ramp_accel
    return cruise, ramp_s, ramp_s + length / cruise


def ride_time_shares(points: Array, speed: float, accel: float) -> Array:
    """The share of the total time for each segment on a ride along the straight lines between the points, at
    up to `speed` (m/s) and `accel` (m/s^2): however close the points are, only the ends of the ride are slow.

    The speed rises along the s of `autopilot.trajectory.transfer`, stays, and falls as it rose.
    """
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    length = float(travelled[-1])
    cruise, ramp_s, total_s = ride(length, speed, accel)
    u = np.linspace(0.0, 1.0, _RIDE_SAMPLES + 1)
    ramp_m = cruise * ramp_s * _RAMP(u)
    times = np.concatenate([ramp_s * u, total_s - ramp_s * u[::-1]])
    at_points = np.interp(travelled, np.concatenate([ramp_m, length - ramp_m[::-1]]), times)
    return np.asarray(np.diff(at_points) / total_s)


def _point_times(shares: Array, total_s: float) -> Array:
    """Times at the points, in whole microseconds, so that stretches join exactly on the vehicle's clock."""
    times = np.concatenate([[0.0], np.cumsum(shares)]) * total_s
    return np.asarray(np.round(times * 1e6) * 1e-6)


def plan_waypoint_path(
    points: Sequence[Vec3],
    speed: float,
    accel: float,
    body: Body,
    bounds: Bounds,
    time_optimal: bool,
) -> tuple[MinimumSnap, Array]:
    """The path through the points and the times at them.

    `speed` (m/s) and `accel` (m/s^2) are peaks; if `time_optimal`, only the bounds apply.
    """
    waypoints = np.array(points)
    length = float(sum(dist(a, b) for a, b in pairwise(points)))
    total_s = transfer_duration(length, speed, accel)
    if len(points) - 1 > _MAX_OPTIMISED_SEGMENTS:
        shares = ride_time_shares(waypoints, speed, accel)
    else:
        shares = optimal_time_shares(waypoints, total_s)

    def evaluate(seconds: float) -> tuple[MinimumSnap, Array, float]:
        """The same for `seconds` in total, and how many times as long it should take (up to 1: no longer)."""
        times = _point_times(shares, seconds)
        path = MinimumSnap(waypoints, times)
        fine, jets = path.jets()
        over = float(excess(demand(jets, body), float(fine[1]), bounds).max())
        too_fast = float(np.linalg.norm(jets[1], axis=1).max()) / speed
        too_hard = float(np.sqrt(np.linalg.norm(jets[2], axis=1).max() / accel))
        min_factor = 0.0 if time_optimal else max(too_fast, too_hard)
        return path, times, max(min_factor, 1.0 + over if over > 0.0 else 0.0)

    path, times, factor = evaluate(total_s)
    if not time_optimal:
        # peaks scale with time almost exactly: two rounds are accurate to one part in a thousand
        for _ in range(2):
            total_s *= min(factor, 2.0)
            path, times, factor = evaluate(total_s)
    for _ in range(4 * _SCALING_ROUNDS):
        if factor <= 1.0 + 1e-3:
            break
        total_s *= _LENGTHENING if factor > 1.05 else 1.01
        path, times, factor = evaluate(total_s)
    if time_optimal:
        low, high = 0.0, total_s
        best = path, times
        for _ in range(_SCALING_ROUNDS):
            middle = 0.5 * (low + high) if low > 0.0 else 0.7 * high
            path, times, factor = evaluate(middle)
            if factor <= 1.0 + 1e-3:
                best, high = (path, times), middle
            else:
                low = middle
        path, times = best
    return path, times
