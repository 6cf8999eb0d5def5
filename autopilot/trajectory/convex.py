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

from math import acos, cos, radians
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
    TURN,
    Bounds,
    demand,
    demand_derivatives,
    rotor_commands,
)
from autopilot.trajectory.spline_band import BAND, sums_of
from autopilot.trajectory.splines import Array, Basis

SAMPLES = 4  # to an interval
TOLERANCE = 0.035  # ranges of a rotor by which a path may exceed its bounds between the samples
_ROUNDS = 12
_EXCESS_WEIGHT = 3e4  # of a rotor's range for one second; a distance of d costs 1 per second
_CONSTRAINT_WEIGHT = 1e5  # of one metre
_HALVINGS = 7
_CONVERGENCE = 1e-3  # relative decrease of the cost below which the rounds end
# an excess of the cosine, or of the squared rate, counts as much as so many ranges of a rotor, ...
_COS_RANGES, _TURN_RANGES = 1.5, 0.015
# ... or that of the cosine as more, so that `TOLERANCE` is no more than this excess of the tilt (rad), or
# than this share of its limit: near zero the cosine hardly changes with the tilt
_TILT_EXCESS, _TILT_SHARE = radians(1.9), 0.3
_START_EXCESS = 0.035  # ranges of a rotor: largest excess with which the rounds may begin
_SMOOTHING_FACTOR, _SMOOTHING_TRIES = 30.0, 8
_HOPELESS_EXCESS = 10.0  # times the range of a rotor: no round leads back from there
_INACTIVE = 0.45  # ranges of a rotor: a round leaves out bounds that are at least this far from the demand
_NO_SOLUTION = (
    clarabel.SolverStatus.PrimalInfeasible,
    clarabel.SolverStatus.AlmostPrimalInfeasible,
    clarabel.SolverStatus.DualInfeasible,
    clarabel.SolverStatus.AlmostDualInfeasible,
)
_ACCURACY = 1e-7  # of the solver; the cost is of order one
# of the solver's matrices, far below the least curvature of the cost (1e-7 in its units): the default of 1e-8
# needs three times as many iterations, and ends at a greater cost
_REGULARISATION = 1e-10


class LinearConstraints(NamedTuple):
    """Linear constraints on the path itself: low <= direction . x^(order) (time) <= high; equalities if low =
    high."""

    time: Array  # (m,)
    order: NDArray[np.int64]  # (m,)
    direction: Array  # (m, 3)
    low: Array  # (m,)
    high: Array  # (m,)


NO_CONSTRAINTS = LinearConstraints(
    np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros(0)
)


class Objective(NamedTuple):
    """Weights per second: `tracking_weight` of |x - target|^2 at the samples, `smoothness_weights` (order,
    weight) of |x^(order)|^2."""

    target: Array  # (n, 3)
    tracking_weight: float
    smoothness_weights: tuple[tuple[int, float], ...]


class _LimitedRows(NamedTuple):
    rows: sparse.csr_matrix  # (m, 3 size)
    limits: Array  # (m,)


class _BoundRows(NamedTuple):
    """Bounds on the demand: row . coefficients - excess[sample] <= margin."""

    rows: sparse.csr_matrix  # (m, 3 size)
    samples: NDArray[np.int64]  # (m,)
    margins: Array  # (m,)


class Problem:
    """A spline with fixed ends, a goal and bounds."""

    def __init__(
        self,
        basis: Basis,
        fixed: Array,
        body: Body,
        bounds: Bounds,
        objective: Objective,
        constraints: LinearConstraints,
    ) -> None:
        self.basis, self.fixed, self.body, self.bounds = basis, fixed, body, bounds
        self.objective, self.constraints = objective, constraints
        self.times: Array = sample_times(basis)
        self.spacing = float(self.times[1] - self.times[0])
        self.values, self.first = basis.band(self.times, 8)
        lo, hi = basis.free.start, basis.free.stop
        self.lo, self.size = lo, hi - lo
        self._columns = self.first[:, None] + np.arange(BAND) - lo
        self._is_free = (self._columns >= 0) & (self._columns < self.size)
        self._derivative_matrices = [self._matrix(self.values[order]) for order in range(8)]
        self._hessian = self._cost_matrix()
        self._constraint_matrix, self._constraint_constant = self._constraint_rows()
        # in units of this length the curvature of the cost is about one
        self._unit = 1.0 / float(np.sqrt(np.median(self._hessian.diagonal())))
        scaled = self._unit * self._hessian * self._unit
        no_cost = sparse.csc_matrix((len(self.times), len(self.times)))  # of the second order, of an excess
        self._scaled_hessian = sparse.triu(sparse.block_diag([scaled] * 3 + [no_cost]), format="csc")
        # the pattern of a matrix whose rows are derivatives at the samples, by the coefficients of all axes
        self._is_free_of_axes = np.repeat(self._is_free[:, None], 3, axis=1)
        columns = self._columns[:, None] + self.size * np.arange(3)[:, None]
        self._indices = columns[self._is_free_of_axes]
        self._row_starts = np.concatenate([[0], np.cumsum(3 * self._is_free.sum(axis=1))])
        self._excess_cost = _EXCESS_WEIGHT / bounds.rotor_range * self.spacing  # of 1 N at a sample
        self._lag = _lag_matrix(len(self.times), self.spacing, bounds.rotor_tau)

    def _matrix(self, values: Array) -> sparse.csr_matrix:
        """(n, size) matrix of one derivative by the free coefficients of one axis."""
        rows = np.repeat(np.arange(len(values)), BAND).reshape(self._columns.shape)
        keep = self._is_free
        entries = (values[keep], (rows[keep], self._columns[keep]))
        return sparse.csr_matrix(entries, shape=(len(values), self.size))

    def _cost_matrix(self) -> sparse.csc_matrix:
        h = self.spacing
        hessian = (
            self.objective.tracking_weight
            * h
            * (self._derivative_matrices[0].T @ self._derivative_matrices[0])
        )
        self._tracking_hessian = sparse.csc_matrix(hessian)
        for order, weight in self.objective.smoothness_weights:
            hessian = hessian + weight * h * (
                self._derivative_matrices[order].T @ self._derivative_matrices[order]
            )
        return sparse.csc_matrix(hessian)

    def _constraint_rows(self) -> tuple[sparse.csr_matrix, Array]:
        """The linear constraints: matrix (m, 3 size), and the contribution (m,) of the fixed coefficients."""
        constraints = self.constraints
        if not len(constraints.time):
            return sparse.csr_matrix((0, 3 * self.size)), np.zeros(0)
        values, first = self.basis.band(constraints.time, 7)
        weights = values[constraints.order, np.arange(len(constraints.time))]
        columns = first[:, None] + np.arange(BAND)
        data, row_indices, column_indices = [], [], []
        constant = np.zeros(len(constraints.time))
        for i in range(len(constraints.time)):
            for axis in range(3):
                if constraints.direction[i, axis] == 0.0:
                    continue
                w = weights[i] * constraints.direction[i, axis]
                constant[i] += w @ self.fixed[columns[i], axis]
                inside = (columns[i] >= self.lo) & (columns[i] < self.lo + self.size)
                data += list(w[inside])
                row_indices += [i] * int(inside.sum())
                column_indices += list(columns[i][inside] - self.lo + axis * self.size)
        return sparse.csr_matrix(
            (data, (row_indices, column_indices)), shape=(len(constraints.time), 3 * self.size)
        ), constant

    # ---- the path of given coefficients

    def jets(self, coefficients: Array) -> Array:
        """(8, n, 3) at the samples: the path and seven derivatives."""
        return sums_of(self.values, self.first, coefficients)

    def _cost(self, jets: Array) -> float:
        deviation = jets[0] - self.objective.target
        total = self.objective.tracking_weight * float(np.sum(deviation * deviation))
        for order, weight in self.objective.smoothness_weights:
            total += weight * float(np.sum(jets[order] * jets[order]))
        return 0.5 * total * self.spacing

    def _excess(self, jets: Array) -> Array:
        """(n,) the greatest excess at each sample, N."""
        return excess(demand(jets, self.body), self.spacing, self.bounds)

    def _merit(self, free: Array, jets: Array) -> float:
        """The cost plus the price of all excess over the bounds and the linear constraints."""
        total = self._cost(jets) + self._excess_cost * float(np.sum(self._excess(jets)))
        if len(self.constraints.time):
            here = self._constraint_constant + self._constraint_matrix @ free.T.ravel()
            violation = np.maximum(here - self.constraints.high, self.constraints.low - here)
            total += _CONSTRAINT_WEIGHT * float(np.sum(np.maximum(violation, 0.0)))
        return total

    # ---- one round

    def solve(self) -> Array | None:
        """The coefficients (count, 3) with the least cost; None if there are none within the constraints.

        If even the smoothest path is far beyond the bounds, it is returned.
        """
        free = self._initial_guess()
        jets = self.jets(self._all_coefficients(free))
        if self._excess(jets).max() > _HOPELESS_EXCESS * self.bounds.rotor_range:
            return self._all_coefficients(free)
        merit = self._merit(free, jets)
        for i in range(_ROUNDS):
            step = self._solve_subproblem(free, jets)
            if step is None:
                if i == 0:
                    return None
                break
            better, share = False, 1.0
            for _ in range(_HALVINGS):
                candidate = free + share * (step - free)
                candidate_jets = self.jets(self._all_coefficients(candidate))
                candidate_merit = self._merit(candidate, candidate_jets)
                if candidate_merit < merit:
                    better = True
                    break
                share *= 0.5
            if not better:
                break
            decrease = merit - candidate_merit
            free, jets, merit = candidate, candidate_jets, candidate_merit
            if decrease < _CONVERGENCE * max(merit, 0.1):
                break
        return self._all_coefficients(free)

    def _gradient(self, jets: Array) -> Array:
        """(size, 3) gradient of the cost by the free coefficients."""
        gradient = self.objective.tracking_weight * (
            self._derivative_matrices[0].T @ (jets[0] - self.objective.target)
        )
        for order, weight in self.objective.smoothness_weights:
            gradient = gradient + weight * (self._derivative_matrices[order].T @ jets[order])
        return np.asarray(self.spacing * gradient)

    def _unbounded(self, smoothing: float) -> Array:
        """(size, 3) free coefficients of least cost without bounds; smoothness counts `smoothing` times."""
        tracking, fixed_jets = self._tracking_hessian, self.jets(self.fixed)
        smooth = self._hessian - tracking
        gradient = self._gradient(fixed_jets)
        tracking_gradient = (
            self.objective.tracking_weight
            * self.spacing
            * (self._derivative_matrices[0].T @ (fixed_jets[0] - self.objective.target))
        )
        factor = splu(sparse.csc_matrix(tracking + smoothing * smooth))
        return np.asarray(-factor.solve(tracking_gradient + smoothing * (gradient - tracking_gradient)))

    def _initial_guess(self) -> Array:
        """The free coefficients to begin with: of the least smoothed path that is about within the bounds.

        Far outside the bounds the demand is far from linear: the thrust may turn over.
        """
        smoothing = 1.0
        free = self._unbounded(smoothing)
        max_excess_n = _START_EXCESS * self.bounds.rotor_range
        for _ in range(_SMOOTHING_TRIES):
            if float(self._excess(self.jets(self._all_coefficients(free))).max()) <= max_excess_n:
                break
            smoothing *= _SMOOTHING_FACTOR
            free = self._unbounded(smoothing)
        return free

    def _all_coefficients(self, free: Array) -> Array:
        coefficients = self.fixed.copy()
        coefficients[self.basis.free] = free
        return coefficients

    def _solve_subproblem(self, free: Array, jets: Array) -> Array | None:
        """The free coefficients that solve the programme linearised along `jets`; None if there are none.

        The unknowns are changes from `free`: in the path itself they would affect only the last digits. Where
        the solver cannot become as accurate as asked, which rounding alone may decide, its last iterate is as
        good: a step is taken only as far as the merit improves.
        """
        n, size = len(self.times), self.size
        gradient = self._gradient(self.jets(self._all_coefficients(free)))
        equal, below = self._constraints_on_change(free)
        bounds = self._linearised_bounds(jets)
        rows = self._unit * sparse.vstack([equal.rows, below.rows, bounds.rows], format="csc")
        first_bound = len(equal.limits) + len(below.limits)
        excesses = sparse.csc_matrix(
            (-np.ones(len(bounds.margins)), (first_bound + np.arange(len(bounds.margins)), bounds.samples)),
            shape=(rows.shape[0], n),
        )
        right = np.concatenate([equal.limits, below.limits, bounds.margins])
        cones = [clarabel.ZeroConeT(len(equal.limits))] if len(equal.limits) else []
        cones.append(clarabel.NonnegativeConeT(len(right) - len(equal.limits)))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = _ACCURACY
        settings.static_regularization_constant = _REGULARISATION
        solver = clarabel.DefaultSolver(
            self._scaled_hessian,
            np.concatenate([self._unit * gradient.T.ravel(), np.full(n, self._excess_cost)]),
            sparse.hstack([rows, excesses], format="csc"),
            right,
            cones,
            settings,
        )
        solution = solver.solve()
        change: Array = (self._unit * np.asarray(solution.x)[: 3 * size]).reshape(3, size).T
        if solution.status in _NO_SOLUTION or not np.isfinite(change).all():
            return None
        return free + change

    def _constraints_on_change(self, free: Array) -> tuple[_LimitedRows, _LimitedRows]:
        """The linear constraints on a change from the coefficients `free`: equalities, and upper limits."""
        constraints, matrix = self.constraints, self._constraint_matrix
        here = self._constraint_constant + matrix @ free.T.ravel()
        equal = constraints.low == constraints.high
        has_high, has_low = (~equal & np.isfinite(limit) for limit in (constraints.high, constraints.low))
        below = sparse.vstack([matrix[has_high], -matrix[has_low]], format="csr")
        limits = np.concatenate([(constraints.high - here)[has_high], (here - constraints.low)[has_low]])
        return _LimitedRows(matrix[equal], (constraints.high - here)[equal]), _LimitedRows(below, limits)

    def _linearised_bounds(self, jets: Array) -> _BoundRows:
        """Bounds on the demand along `jets`, and on the excesses, which are not negative."""
        n, bounds = len(self.times), self.bounds
        path_demand, slope = demand(jets, self.body), demand_derivatives(jets, self.body)
        # (n, outputs, 3, 10): derivatives by the coefficients of the band
        by_band = np.einsum("irod,oik->irdk", slope, self.values[:7])
        blocks: list[sparse.csr_matrix] = []
        samples: list[NDArray[np.int64]] = []
        margins: list[Array] = []

        def matrix(output: int) -> sparse.csr_matrix:
            values = by_band[:, output][self._is_free_of_axes]
            return sparse.csr_matrix((values, self._indices, self._row_starts), shape=(n, 3 * self.size))

        inactive_n = _INACTIVE * bounds.rotor_range

        def bound(rows: sparse.csr_matrix, value: Array, low: float, high: float) -> None:
            for sign, margin in ((1.0, high - value), (-1.0, value - low)):
                keep = np.flatnonzero(margin < inactive_n)
                blocks.append(sign * rows[keep])
                samples.append(keep)
                margins.append(margin[keep])

        for rotor in range(FIRST_ROTOR, path_demand.shape[1]):
            command = self._lag @ path_demand[:, rotor]
            bound(self._lag @ matrix(rotor), command, bounds.rotor_low, bounds.rotor_high)
        bound(matrix(TENSION), path_demand[:, TENSION], bounds.tension_low, np.inf)
        # these in newtons of a rotor
        cos_n, turn_n = _newtons(bounds)
        cos_tilt, turn = cos_n * path_demand[:, COS_TILT], turn_n * path_demand[:, TURN]
        bound(cos_n * matrix(COS_TILT), cos_tilt, cos_n * bounds.cos_tilt, np.inf)
        bound(turn_n * matrix(TURN), turn, -np.inf, turn_n * bounds.turn_rate**2)
        bound(sparse.csr_matrix((n, 3 * self.size)), np.zeros(n), -np.inf, 0.0)
        return _BoundRows(
            sparse.vstack(blocks, format="csr"),
            np.concatenate(samples),
            np.concatenate(margins),
        )


def sample_times(basis: Basis) -> Array:
    """Equally spaced times (s) over the spline, both ends included."""
    return np.linspace(basis.breaks[0], basis.breaks[-1], SAMPLES * basis.intervals + 1)


def excess(path_demand: Array, spacing: float | Array, bounds: Bounds) -> Array:
    """(n,) excess of the demand (n, outputs) over the bounds, in N of a rotor; >= 0. The samples are
    `spacing` s apart, or at these n times (s)."""
    commands = rotor_commands(path_demand, spacing, bounds.rotor_tau)
    over = np.maximum(commands.max(axis=1) - bounds.rotor_high, bounds.rotor_low - commands.min(axis=1))
    over = np.maximum(over, bounds.tension_low - path_demand[:, TENSION])
    cos_n, turn_n = _newtons(bounds)
    over = np.maximum(over, cos_n * (bounds.cos_tilt - path_demand[:, COS_TILT]))
    over = np.maximum(over, turn_n * (path_demand[:, TURN] - bounds.turn_rate**2))
    return np.asarray(np.maximum(over, 0.0))


def _newtons(bounds: Bounds) -> tuple[float, float]:
    """The newtons of a rotor as which an excess of the cosine counts, and of the squared rate."""
    limit = acos(max(bounds.cos_tilt, -1.0))
    beyond = bounds.cos_tilt - cos(limit + min(_TILT_EXCESS, _TILT_SHARE * limit))
    return max(_COS_RANGES, TOLERANCE / beyond) * bounds.rotor_range, _TURN_RANGES * bounds.rotor_range


def _lag_matrix(n: int, spacing: float, tau: float) -> sparse.csr_matrix:
    """(n, n) matrix of v + tau v', with the differences of `numpy.gradient`."""
    half = 0.5 / spacing
    upper, lower, middle = np.full(n - 1, half), np.full(n - 1, -half), np.zeros(n)
    upper[0], middle[0] = 2.0 * half, -2.0 * half
    lower[-1], middle[-1] = -2.0 * half, 2.0 * half
    return sparse.csr_matrix(sparse.eye(n) + tau * sparse.diags([lower, middle, upper], [-1, 0, 1]))
