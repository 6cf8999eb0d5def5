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
    TURN,
    Bounds,
    demand,
    demand_derivatives,
    rotor_commands,
)
from autopilot.trajectory.splines import DEGREE, Array, Basis

SAMPLES = 4  # to an interval
_BAND = DEGREE + 1
_ROUNDS = 12
_EXCESS_WEIGHT = 2e4  # of one newton for one second; a distance of d costs 1 per second
_CONSTRAINT_WEIGHT = 1e5  # of one metre
_HALVINGS = 7
_CONVERGENCE = 1e-3  # relative decrease of the cost below which the rounds end
# convert an excess of cosine, tension and squared rate to newtons of a rotor
_COS_SCALE, _TENSION_SCALE, _TURN_SCALE = 2.0, 1.0, 0.02
_START_EXCESS_N = 0.05  # largest excess with which the rounds may begin
_SMOOTHING_FACTOR, _SMOOTHING_TRIES = 30.0, 8
_INACTIVE_N = 0.6  # a round leaves out bounds that are at least this far from the demand
_NO_SOLUTION = (
    clarabel.SolverStatus.PrimalInfeasible,
    clarabel.SolverStatus.AlmostPrimalInfeasible,
    clarabel.SolverStatus.DualInfeasible,
    clarabel.SolverStatus.AlmostDualInfeasible,
)
_ACCURACY = 1e-7  # of the solver; the cost is of order one


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
        self._columns = self.first[:, None] + np.arange(_BAND) - lo
        self._is_free = (self._columns >= 0) & (self._columns < self.size)
        self._derivative_matrices = [self._matrix(self.values[order]) for order in range(8)]
        self._hessian = self._cost_matrix()
        self._constraint_matrix, self._constraint_constant = self._constraint_rows()

    def _matrix(self, values: Array) -> sparse.csr_matrix:
        """(n, size) matrix of one derivative by the free coefficients of one axis."""
        rows = np.repeat(np.arange(len(values)), _BAND).reshape(self._columns.shape)
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
        columns = first[:, None] + np.arange(_BAND)
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
        return band_jets(self.values, self.first, coefficients)

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
        total = self._cost(jets) + _EXCESS_WEIGHT * self.spacing * float(np.sum(self._excess(jets)))
        if len(self.constraints.time):
            here = self._constraint_constant + self._constraint_matrix @ free.T.ravel()
            violation = np.maximum(here - self.constraints.high, self.constraints.low - here)
            total += _CONSTRAINT_WEIGHT * float(np.sum(np.maximum(violation, 0.0)))
        return total

    # ---- one round

    def solve(self) -> Array | None:
        """The coefficients (count, 3) with the least cost; None if there are none within the constraints."""
        free = self._initial_guess()
        jets = self.jets(self._all_coefficients(free))
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
            if share == 1.0 and decrease < _CONVERGENCE * max(merit, 0.1):
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
        for _ in range(_SMOOTHING_TRIES):
            if float(self._excess(self.jets(self._all_coefficients(free))).max()) <= _START_EXCESS_N:
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
        hessian = sparse.block_diag([self._hessian] * 3 + [sparse.csc_matrix((n, n))], format="csc")
        linear = np.concatenate([gradient.T.ravel(), np.full(n, _EXCESS_WEIGHT * self.spacing)])
        blocks: list[sparse.csr_matrix] = []
        limits: list[Array] = []
        equal = self.constraints.low == self.constraints.high
        here = self._constraint_constant + self._constraint_matrix @ free.T.ravel()
        rows = sparse.hstack([self._constraint_matrix, sparse.csr_matrix((len(equal), n))], format="csr")
        if equal.any():
            blocks.append(rows[equal])
            limits.append((self.constraints.high - here)[equal])
        for sign, bound in ((1.0, self.constraints.high), (-1.0, -self.constraints.low)):
            keep = ~equal & np.isfinite(bound)
            if keep.any():
                blocks.append(sign * rows[keep])
                limits.append((bound - sign * here)[keep])
        matrix, limit = self._linearised_bounds(jets)
        blocks.append(matrix)
        limits.append(limit)
        constraints = sparse.vstack(blocks, format="csc")
        right = np.concatenate(limits)
        zeros = int(equal.sum())
        cones = [clarabel.ZeroConeT(zeros)] if zeros else []
        cones.append(clarabel.NonnegativeConeT(len(right) - zeros))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = _ACCURACY
        # scaled to units in which the curvature of the cost is about one
        unit = np.concatenate(
            [np.full(3 * size, 1.0 / np.sqrt(np.median(self._hessian.diagonal()))), np.ones(n)]
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
        change: Array = (unit * np.asarray(solution.x))[: 3 * size].reshape(3, size).T
        if solution.status in _NO_SOLUTION or not np.isfinite(change).all():
            return None
        return free + change

    def _linearised_bounds(self, jets: Array) -> tuple[sparse.csr_matrix, Array]:
        """Bounds on the demand along `jets`, as rows over (coefficients, excesses)."""
        n, size, bounds = len(self.times), self.size, self.bounds
        path_demand, slope = demand(jets, self.body), demand_derivatives(jets, self.body)
        # (n, outputs, 3, 10): derivatives by the coefficients of the band
        by_band = np.einsum("irod,oik->irdk", slope, self.values[:7])

        def matrix(output: int) -> sparse.csr_matrix:
            keep = self._is_free
            rows = np.repeat(np.arange(n), _BAND).reshape(n, _BAND)
            parts = [
                sparse.csr_matrix(
                    (by_band[:, output, axis][keep], (rows[keep], self._columns[keep])), shape=(n, size)
                )
                for axis in range(3)
            ]
            return sparse.hstack(parts, format="csr")

        lag = _lag_matrix(n, self.spacing, bounds.rotor_tau)
        excess_of = -sparse.eye(n, format="csr")
        blocks: list[sparse.csr_matrix] = []
        limits: list[Array] = []

        def bound(rows: sparse.csr_matrix, value: Array, low: float, high: float, scale: float) -> None:
            for sign, margin in ((1.0, high - value), (-1.0, value - low)):
                keep = margin < _INACTIVE_N
                if keep.any():
                    blocks.append(sparse.hstack([sign * rows[keep], scale * excess_of[keep]], format="csr"))
                    limits.append(margin[keep])

        for rotor in range(FIRST_ROTOR, path_demand.shape[1]):
            bound(lag @ matrix(rotor), lag @ path_demand[:, rotor], bounds.rotor_low, bounds.rotor_high, 1.0)
        bound(matrix(TENSION), path_demand[:, TENSION], bounds.tension_low, np.inf, 1.0 / _TENSION_SCALE)
        bound(matrix(COS_TILT), path_demand[:, COS_TILT], bounds.cos_tilt, np.inf, 1.0 / _COS_SCALE)
        # in newtons, since `_INACTIVE_N` would leave out almost all of a bound in (rad/s)^2
        turn, max_turn = _TURN_SCALE * path_demand[:, TURN], _TURN_SCALE * bounds.turn_rate**2
        bound(_TURN_SCALE * matrix(TURN), turn, -np.inf, max_turn, 1.0)
        blocks.append(sparse.hstack([sparse.csr_matrix((n, 3 * size)), excess_of], format="csr"))
        limits.append(np.zeros(n))
        return sparse.vstack(blocks, format="csr"), np.concatenate(limits)


def sample_times(basis: Basis) -> Array:
    """Equally spaced times (s) over the spline, both ends included."""
    return np.linspace(basis.breaks[0], basis.breaks[-1], SAMPLES * basis.intervals + 1)


def band_jets(values: Array, first: NDArray[np.int64], coefficients: Array) -> Array:
    """(orders, n, 3) of the spline with `coefficients` (count, 3)."""
    nearby = coefficients[first[:, None] + np.arange(_BAND)]
    return np.asarray(np.einsum("oik,ikd->oid", values, nearby))


def excess(path_demand: Array, spacing: float, bounds: Bounds) -> Array:
    """(n,) excess of the demand (n, outputs) of equally spaced samples over the bounds, in N of a rotor;
    >= 0."""
    commands = rotor_commands(path_demand, spacing, bounds.rotor_tau)
    over = np.maximum(commands.max(axis=1) - bounds.rotor_high, bounds.rotor_low - commands.min(axis=1))
    over = np.maximum(over, _TENSION_SCALE * (bounds.tension_low - path_demand[:, TENSION]))
    over = np.maximum(over, _COS_SCALE * (bounds.cos_tilt - path_demand[:, COS_TILT]))
    over = np.maximum(over, _TURN_SCALE * (path_demand[:, TURN] - bounds.turn_rate**2))
    return np.asarray(np.maximum(over, 0.0))


def _lag_matrix(n: int, spacing: float, tau: float) -> sparse.csr_matrix:
    """(n, n) matrix of v + tau v', with the differences of `numpy.gradient`."""
    half = 0.5 / spacing
    upper, lower, middle = np.full(n - 1, half), np.full(n - 1, -half), np.zeros(n)
    upper[0], middle[0] = 2.0 * half, -2.0 * half
    lower[-1], middle[-1] = -2.0 * half, 2.0 * half
    return sparse.csr_matrix(sparse.eye(n) + tau * sparse.diags([lower, middle, upper], [-1, 0, 1]))
