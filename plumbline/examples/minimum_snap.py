"""Minimum snap through waypoints, after Mellinger and Kumar: a polynomial of degree 7 for each segment.

D. Mellinger, V. Kumar: Minimum Snap Trajectory Generation and Control for Quadrotors. IEEE International
Conference on Robotics and Automation, 2011.

| symbol | code name | meaning                                                        |
|--------|-----------|----------------------------------------------------------------|
| T_k    | T         | duration of segment k, s                                       |
| u      | u         | time in a segment divided by its duration, 0 ... 1             |
| c_ki   | c         | coefficient of u^i in segment k, m                             |
| A, b   | A, b      | conditions: waypoints, rest at both ends, equal derivatives    |

Among all paths that pass the waypoints at given times, and are at rest up to the jerk at both ends, the path
of least snap consists of polynomials of degree 7 whose derivatives up to the sixth are equal where two
segments meet: as many equations as coefficients. A segment lasts as long as it would at the mission's speed,
plus a time to accelerate; then the whole path is slowed down until speed, acceleration and rotors allow it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import perm, sqrt

import numpy as np
from numpy.typing import NDArray

from plumbline.planners import Parameter, Path, Route, polynomials, slower, use

Array = NDArray[np.float64]

N = 8  # coefficients of a segment
REST = 4  # derivatives, including the position, that are given at the ends
MEET = 7  # derivatives, including the position, that are equal where two segments meet
TRIES = 40

PARAMETERS = {"SNAP_SLOW": Parameter(1.0, 1.0, 5.0, "", "How many times as long as need be the paths take")}


class MinimumSnap:
    """The planner."""

    parameters = PARAMETERS

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.longer = parameters["SNAP_SLOW"]

    def plan(self, route: Route) -> Path:
        """A path from rest to rest through each point."""
        points = np.array(route.points)
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        T = lengths / route.speed_m_s + sqrt(lengths.mean() / route.accel_m_s2)
        breaks = np.concatenate([[0.0], np.cumsum(T)])
        path = polynomials(breaks, coefficients(points, T), breaks)
        for _ in range(TRIES):
            longer = use(path, route)
            if longer <= 1.0:
                break
            path = slower(path, min(1.01 * longer, 1.5))
        return slower(path, self.longer)


def coefficients(points: Array, T: Array) -> Array:
    """Coefficients (segments, N, 3) of the powers of time since the beginning of each segment."""
    n, mean = len(T), float(T.mean())
    A, b = np.zeros((n * N, n * N)), np.zeros((n * N, 3))
    row = 0

    def hold(value: Array | float, *terms: tuple[int, float, int, float]) -> None:
        """Add an equation: derivatives of this order of segments at u, each times a factor, sum to value."""
        nonlocal row
        for segment, u, order, factor in terms:
            columns = slice(segment * N, (segment + 1) * N)
            A[row, columns] = factor * (mean / T[segment]) ** order * powers(order, u)
        b[row] = value
        row += 1

    for k in range(n):
        hold(points[k], (k, 0.0, 0, 1.0))
        hold(points[k + 1], (k, 1.0, 0, 1.0))
    for order in range(1, REST):
        hold(0.0, (0, 0.0, order, 1.0))
        hold(0.0, (n - 1, 1.0, order, 1.0))
    for k in range(n - 1):
        for order in range(1, MEET):
            hold(0.0, (k, 1.0, order, 1.0), (k + 1, 0.0, order, -1.0))
    c = np.linalg.solve(A, b).reshape(n, N, 3)
    return np.asarray(c / T[:, None, None] ** np.arange(N)[:, None])


def powers(order: int, u: float) -> Array:
    """(N,) the derivative of this order of each power of u."""
    return np.array([perm(i, order) * u ** max(i - order, 0) for i in range(N)])
