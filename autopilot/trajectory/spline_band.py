"""The B-splines of degree 9 that are not zero at a time, with their derivatives, in machine code.

The arithmetic is that of SciPy's `BSpline`: de Boor's recursion up to the degree minus the order, then the
recursion of the derivatives. SciPy computes each order by itself, for all coefficients.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

DEGREE = 9
BAND = DEGREE + 1  # B-splines that are not zero at a time


@kernel
def _fill_band(u: Array, first: Indices, knots: Array, scales: Array, scratch: Array, out: Array) -> None:
    lower, row, before = scratch[0], scratch[1], scratch[2]
    for i in range(u.shape[0]):
        x, at = u[i], first[i] + DEGREE
        lower[0] = 1.0
        for degree in range(DEGREE + 1):
            if degree > 0:
                for n in range(degree):
                    before[n] = lower[n]
                lower[0] = 0.0
                for n in range(1, degree + 1):
                    end, begin = knots[at + n], knots[at + n - degree]
                    w = before[n - 1] / (end - begin)
                    lower[n - 1] += w * (end - x)
                    lower[n] = w * (x - begin)
            order = DEGREE - degree
            if order >= out.shape[0]:
                continue
            for n in range(degree + 1):
                row[n] = lower[n]
            for higher in range(degree + 1, DEGREE + 1):
                for n in range(higher):
                    before[n] = row[n]
                row[0] = 0.0
                for n in range(1, higher + 1):
                    w = higher * before[n - 1] / (knots[at + n] - knots[at + n - higher])
                    row[n - 1] -= w
                    row[n] = w
            for n in range(BAND):
                out[order, i, n] = row[n] / scales[order]


@kernel
def _fill_sums(band: Array, first: Indices, coefficients: Array, out: Array) -> None:
    for order in range(band.shape[0]):
        for i in range(band.shape[1]):
            for axis in range(coefficients.shape[1]):
                total = 0.0
                for n in range(BAND):
                    total += band[order, i, n] * coefficients[first[i] + n, axis]
                out[order, i, axis] = total


def band_of(u: Array, first: Indices, knots: Array, scales: Array) -> Array:
    """(orders, n, 10): the derivatives by u of the B-splines `first` ... `first` + 9 of these knots, all
    that are not zero at u (n,), each divided by its scale (orders,)."""
    out = np.empty((len(scales), len(u), BAND))
    _fill_band(u, first, knots, scales, np.empty((3, BAND)), out)
    return out


def sums_of(band: Array, first: Indices, coefficients: Array) -> Array:
    """(orders, n, 3): the splines with `coefficients` (count, 3), from the B-splines that are not zero."""
    out = np.empty((*band.shape[:2], coefficients.shape[1]))
    _fill_sums(band, first, coefficients, out)
    return out
