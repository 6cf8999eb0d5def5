"""Sequential convex programming over a spline: the nearest path, or the smoothest, that the vehicle can fly.

The path and all its derivatives are linear in the coefficients c of a spline
(`autopilot.trajectory.splines`); the demand of the path (`autopilot.trajectory.rotor_demand`) is a smooth and
nearly linear function of them. Each round linearises the demand along the present path, solves the quadratic
programme

    minimise    sum of |x - x_asked|^2 / d^2 + |x^(6)|^2 / p^2  +  rho * excess
    subject to  bounds on F + tau F', tension and tilt, each at each sample, softened by an excess >= 0

for the change of the coefficients, and shortens this step until the true cost falls. There are four samples
to an interval. Solver: Clarabel, an interior point method, single-threaded and thus reproducible.
"""

from __future__ import annotations

from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from autopilot.trajectory.peaks import Body
from autopilot.trajectory.rotor_demand import (
    COS_TILT,
    FIRST_ROTOR,
    TENSION,
    Bounds,
    commanded,
    demand,
    slopes,
)
from autopilot.trajectory.splines import DEGREE, Array, Basis

SAMPLES = 4  # to an interval
_BAND = DEGREE + 1
_ROUNDS = 12
_EXCESS_PRICE = 2e4  # of one newton for one second; a distance of d costs 1 per second
_ROW_PRICE = 1e5  # of one metre
_HALVINGS = 7
_SETTLED = 1e-3  # relative decrease of the cost below which the rounds end
_COS_SCALE, _TENSION_SCALE = 2.0, 1.0  # convert an excess of cosine and tension to newtons of a rotor
_NEAR_ENOUGH_N = 0.05  # largest excess with which the rounds may begin
_SMOOTHER, _SMOOTHER_TRIES = 30.0, 8
_AWAY_N = 0.6  # a round leaves out bounds that are at least this far from the demand
_ACCURACY = 1e-7  # of the solver; the cost is of order one


class Rows(NamedTuple):
    """Linear constraints on the path itself: low <= direction . x^(order) (time) <= high; equalities if low =
    high."""

    time: Array  # (m,)
    order: NDArray[np.int64]  # (m,)
    direction: Array  # (m, 3)
    low: Array  # (m,)
    high: Array  # (m,)


NO_ROWS = Rows(np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros(0))


class Goal(NamedTuple):
    """Weights per second: `near` of |x - target|^2 at the samples, `smooth` (order, weight) of
    |x^(order)|^2."""

    target: Array  # (n, 3)
    near: float
    smooth: tuple[tuple[int, float], ...]


class Solution(NamedTuple):
    """Coefficients (count, 3); the greatest excess over a bound in N; whether the solver succeeded."""

    coefficients: Array
    excess_n: float
    solved: bool


class Problem:
    """A spline with fixed ends, a goal and bounds."""

    def __init__(
        self, basis: Basis, fixed: Array, body: Body, bounds: Bounds, goal: Goal, rows: Rows
    ) -> None:
        self.basis, self.fixed, self.body, self.bounds = basis, fixed, body, bounds
        self.goal, self.rows = goal, rows
        self.times: Array = sample_times(basis)
        self.spacing = float(self.times[1] - self.times[0])
        self.values, self.first = basis.band(self.times, 8)
        lo, hi = basis.free.start, basis.free.stop
        self.lo, self.size = lo, hi - lo
        self._columns = self.first[:, None] + np.arange(_BAND) - lo
        self._inside = (self._columns >= 0) & (self._columns < self.size)
        self._linear = [self._matrix(self.values[order]) for order in range(8)]
        self._hessian = self._cost_matrix()
        self._extra, self._extra_fixed = self._row_matrix()

    def _matrix(self, values: Array) -> sparse.csr_matrix:
        """(n, size) matrix of one derivative by the free coefficients of one axis."""
        rows = np.repeat(np.arange(len(values)), _BAND).reshape(self._columns.shape)
        keep = self._inside
        entries = (values[keep], (rows[keep], self._columns[keep]))
        return sparse.csr_matrix(entries, shape=(len(values), self.size))

    def _cost_matrix(self) -> sparse.csc_matrix:
        h = self.spacing
        found = self.goal.near * h * (self._linear[0].T @ self._linear[0])
        self._near = sparse.csc_matrix(found)
        for order, weight in self.goal.smooth:
            found = found + weight * h * (self._linear[order].T @ self._linear[order])
        return sparse.csc_matrix(found)

    def _row_matrix(self) -> tuple[sparse.csr_matrix, Array]:
        """The linear constraints: matrix (m, 3 size), and the contribution (m,) of the fixed coefficients."""
        rows = self.rows
        if not len(rows.time):
            return sparse.csr_matrix((0, 3 * self.size)), np.zeros(0)
        values, first = self.basis.band(rows.time, 7)
        weights = values[rows.order, np.arange(len(rows.time))]
        columns = first[:, None] + np.arange(_BAND)
        data, where, at = [], [], []
        constant = np.zeros(len(rows.time))
        for i in range(len(rows.time)):
            for axis in range(3):
                if rows.direction[i, axis] == 0.0:
                    continue
                w = weights[i] * rows.direction[i, axis]
                constant[i] += w @ self.fixed[columns[i], axis]
                inside = (columns[i] >= self.lo) & (columns[i] < self.lo + self.size)
                data += list(w[inside])
                where += [i] * int(inside.sum())
                at += list(columns[i][inside] - self.lo + axis * self.size)
        return sparse.csr_matrix((data, (where, at)), shape=(len(rows.time), 3 * self.size)), constant

    # ---- the path of given coefficients

    def jets(self, coefficients: Array) -> Array:
        """(8, n, 3) at the samples: the path and seven derivatives."""
        return band_jets(self.values, self.first, coefficients)

    def _cost(self, jets: Array) -> float:
        away = jets[0] - self.goal.target
        total = self.goal.near * float(np.sum(away * away))
        for order, weight in self.goal.smooth:
            total += weight * float(np.sum(jets[order] * jets[order]))
        return 0.5 * total * self.spacing

    def _over(self, jets: Array) -> Array:
        """(n,) the greatest excess at each sample, N."""
        return excess(demand(jets, self.body), self.spacing, self.bounds)

    def _merit(self, free: Array, jets: Array, bounded: bool) -> float:
        """The cost plus the price of all excess over the bounds and the linear constraints."""
        total = self._cost(jets)
        if bounded:
            total += _EXCESS_PRICE * self.spacing * float(np.sum(self._over(jets)))
        if len(self.rows.time):
            here = self._extra_fixed + self._extra @ free.T.ravel()
            broken = np.maximum(here - self.rows.high, self.rows.low - here)
            total += _ROW_PRICE * float(np.sum(np.maximum(broken, 0.0)))
        return total

    # ---- one round

    def solve(self, bounded: bool = True) -> Solution:
        """The coefficients with the least cost; without `bounded` the bounds are ignored."""
        free = self._beginning() if bounded else self._unbounded(1.0)
        jets = self.jets(self._all(free))
        merit = self._merit(free, jets, bounded)
        for _ in range(_ROUNDS):
            step = self._quadratic(free, jets if bounded else None)
            if step is None:
                return Solution(self._all(free), np.inf, False)
            better, share = False, 1.0
            for _ in range(_HALVINGS):
                tried = free + share * (step - free)
                tried_jets = self.jets(self._all(tried))
                tried_merit = self._merit(tried, tried_jets, bounded)
                if tried_merit < merit:
                    better = True
                    break
                share *= 0.5
            if not better:
                break
            fallen = merit - tried_merit
            free, jets, merit = tried, tried_jets, tried_merit
            if share == 1.0 and fallen < _SETTLED * max(merit, 0.1):
                break
        worst = float(self._over(jets).max()) if bounded else 0.0
        return Solution(self._all(free), worst, True)

    def _gradient(self, jets: Array) -> Array:
        """(size, 3) gradient of the cost by the free coefficients."""
        found = self.goal.near * (self._linear[0].T @ (jets[0] - self.goal.target))
        for order, weight in self.goal.smooth:
            found = found + weight * (self._linear[order].T @ jets[order])
        return np.asarray(self.spacing * found)

    def _unbounded(self, smoother: float) -> Array:
        """(size, 3) free coefficients of least cost without bounds; smoothness counts `smoother` times."""
        near, rest = self._near, self.jets(self.fixed)
        smooth = self._hessian - near
        gradient = self._gradient(rest)
        pull = self.goal.near * self.spacing * (self._linear[0].T @ (rest[0] - self.goal.target))
        factor = splu(sparse.csc_matrix(near + smoother * smooth))
        return np.asarray(-factor.solve(pull + smoother * (gradient - pull)))

    def _beginning(self) -> Array:
        """The free coefficients to begin with: of the least smoothed path that is about within the bounds.

        Far outside the bounds the demand is far from linear: the thrust may turn over.
        """
        smoother = 1.0
        free = self._unbounded(smoother)
        for _ in range(_SMOOTHER_TRIES):
            if float(self._over(self.jets(self._all(free))).max()) <= _NEAR_ENOUGH_N:
                break
            smoother *= _SMOOTHER
            free = self._unbounded(smoother)
        return free

    def _all(self, free: Array) -> Array:
        found = self.fixed.copy()
        found[self.basis.free] = free
        return found

    def _quadratic(self, free: Array, jets: Array | None) -> Array | None:
        """The free coefficients that solve the programme linearised along `jets`; None if the solver fails.

        The unknowns are changes from `free`: in the path itself they would affect only the last digits.
        """
        n, size = len(self.times), self.size
        gradient = self._gradient(self.jets(self._all(free)))
        excesses = 0 if jets is None else n
        hessian = sparse.block_diag(
            [self._hessian] * 3 + [sparse.csc_matrix((excesses, excesses))], format="csc"
        )
        linear = np.concatenate([gradient.T.ravel(), np.full(excesses, _EXCESS_PRICE * self.spacing)])
        blocks: list[sparse.csr_matrix] = []
        limits: list[Array] = []
        equal = self.rows.low == self.rows.high
        here = self._extra_fixed + self._extra @ free.T.ravel()
        rows = sparse.hstack([self._extra, sparse.csr_matrix((len(equal), excesses))], format="csr")
        if equal.any():
            blocks.append(rows[equal])
            limits.append((self.rows.high - here)[equal])
        for sign, bound in ((1.0, self.rows.high), (-1.0, -self.rows.low)):
            keep = ~equal & np.isfinite(bound)
            if keep.any():
                blocks.append(sign * rows[keep])
                limits.append((bound - sign * here)[keep])
        if jets is not None:
            matrix, limit = self._linearised(jets)
            blocks.append(matrix)
            limits.append(limit)
        variables = 3 * size + excesses
        constraints = sparse.vstack(blocks, format="csc") if blocks else sparse.csc_matrix((0, variables))
        right = np.concatenate(limits) if limits else np.zeros(0)
        zeros = int(equal.sum())
        cones = [clarabel.ZeroConeT(zeros)] if zeros else []
        if len(right) > zeros:
            cones.append(clarabel.NonnegativeConeT(len(right) - zeros))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = _ACCURACY
        # scaled to units in which the curvature of the cost is about one
        unit = np.concatenate(
            [np.full(3 * size, 1.0 / np.sqrt(np.median(self._hessian.diagonal()))), np.ones(excesses)]
        )
        units = sparse.diags(unit)
        solver = clarabel.DefaultSolver(
            sparse.triu(units @ hessian @ units, format="csc"),
            unit * linear,
            sparse.csc_matrix(constraints @ units),
            right,
            cones,
            settings,
        )
        solution = solver.solve()
        if solution.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
            return None
        changed: Array = free + (unit * np.asarray(solution.x))[: 3 * size].reshape(3, size).T
        return changed

    def _linearised(self, jets: Array) -> tuple[sparse.csr_matrix, Array]:
        """Bounds on the demand along `jets`, as rows over (coefficients, excesses)."""
        n, size, bounds = len(self.times), self.size, self.bounds
        found, slope = demand(jets, self.body), slopes(jets, self.body)
        # (n, outputs, 3, 10): derivatives by the coefficients of the band
        by_band = np.einsum("irod,oik->irdk", slope, self.values[:7])

        def matrix(output: int) -> sparse.csr_matrix:
            keep = self._inside
            lines = np.repeat(np.arange(n), _BAND).reshape(n, _BAND)
            parts = [
                sparse.csr_matrix(
                    (by_band[:, output, axis][keep], (lines[keep], self._columns[keep])), shape=(n, size)
                )
                for axis in range(3)
            ]
            return sparse.hstack(parts, format="csr")

        lag = _lag_matrix(n, self.spacing, bounds.rotor_tau)
        excess_of = -sparse.eye(n, format="csr")
        blocks: list[sparse.csr_matrix] = []
        limits: list[Array] = []

        def bound(rows: sparse.csr_matrix, value: Array, low: float, high: float, scale: float) -> None:
            for sign, room in ((1.0, high - value), (-1.0, value - low)):
                keep = room < _AWAY_N
                if keep.any():
                    blocks.append(sparse.hstack([sign * rows[keep], scale * excess_of[keep]], format="csr"))
                    limits.append(room[keep])

        for rotor in range(FIRST_ROTOR, found.shape[1]):
            bound(lag @ matrix(rotor), lag @ found[:, rotor], bounds.rotor_low, bounds.rotor_high, 1.0)
        bound(matrix(TENSION), found[:, TENSION], bounds.tension_low, np.inf, 1.0 / _TENSION_SCALE)
        bound(matrix(COS_TILT), found[:, COS_TILT], bounds.cos_tilt, np.inf, 1.0 / _COS_SCALE)
        blocks.append(sparse.hstack([sparse.csr_matrix((n, 3 * size)), excess_of], format="csr"))
        limits.append(np.zeros(n))
        return sparse.vstack(blocks, format="csr"), np.concatenate(limits)


def sample_times(basis: Basis) -> Array:
    """Equally spaced times (s) over the spline, both ends included."""
    return np.linspace(basis.breaks[0], basis.breaks[-1], SAMPLES * basis.intervals + 1)


def band_jets(values: Array, first: NDArray[np.int64], coefficients: Array) -> Array:
    """(orders, n, 3) of the spline with `coefficients` (count, 3)."""
    near = coefficients[first[:, None] + np.arange(_BAND)]
    return np.asarray(np.einsum("oik,ikd->oid", values, near))


def excess(found: Array, spacing: float, bounds: Bounds) -> Array:
    """(n,) excess of the demand (n, outputs) of equally spaced samples over the bounds, in N of a rotor;
    >= 0."""
    asked = commanded(found, spacing, bounds.rotor_tau)
    over = np.maximum(asked.max(axis=1) - bounds.rotor_high, bounds.rotor_low - asked.min(axis=1))
    over = np.maximum(over, _TENSION_SCALE * (bounds.tension_low - found[:, TENSION]))
    over = np.maximum(over, _COS_SCALE * (bounds.cos_tilt - found[:, COS_TILT]))
    return np.asarray(np.maximum(over, 0.0))


def _lag_matrix(n: int, spacing: float, tau: float) -> sparse.csr_matrix:
    """(n, n) matrix of v + tau v', with the differences of `numpy.gradient`."""
    half = 0.5 / spacing
    upper, lower, middle = np.full(n - 1, half), np.full(n - 1, -half), np.zeros(n)
    upper[0], middle[0] = 2.0 * half, -2.0 * half
    lower[-1], middle[-1] = -2.0 * half, 2.0 * half
    return sparse.csr_matrix(sparse.eye(n) + tau * sparse.diags([lower, middle, upper], [-1, 0, 1]))
