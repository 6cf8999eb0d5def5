"""The B-splines that are not zero at a time, against those of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from autopilot.trajectory.spline_band import BAND, DEGREE
from autopilot.trajectory.splines import COLUMNS, Basis, evaluate_path

# of the greatest of ten numbers, by two programs that divide by the same knots
ROUNDING = 1e-14


@pytest.mark.parametrize("intervals", [14, 41, 400])
def test_they_and_their_derivatives_are_those_of_scipy(intervals: int) -> None:
    begin, end = -0.45, 7.3
    basis = Basis(begin, end, intervals)
    times = np.sort(np.concatenate([basis.breaks, np.random.default_rng(1).uniform(begin, end, 200)]))
    band, first = basis.band(times, 8)
    knots = np.concatenate([np.full(DEGREE, begin), basis.breaks, np.full(DEGREE, end)])
    coefficients = np.random.default_rng(2).normal(size=(basis.count, 3))
    spline = BSpline(knots, coefficients, DEGREE)
    nearby = coefficients[first[:, None] + np.arange(BAND)]
    for order in range(8):
        found, expected = np.einsum("ik,ikd->id", band[order], nearby), spline(times, nu=order)
        terms = np.abs(band[order][:, :, None] * nearby).sum(axis=1)
        assert (np.abs(found - expected) <= ROUNDING * intervals * terms.max()).all(), order


def test_the_table_of_a_spline_has_its_path() -> None:
    basis = Basis(1.0, 4.0, 20)
    coefficients, origin = np.random.default_rng(3).normal(size=(basis.count, 3)), np.array([1.0, 2.0, 3.0])
    table = basis.pieces(coefficients, origin)
    assert table.shape == (20, COLUMNS)
    times = np.random.default_rng(4).uniform(1.0, 4.0, 100)
    band, first = basis.band(times, 7)
    expected = np.einsum("oik,ikd->oid", band, coefficients[first[:, None] + np.arange(BAND)])
    expected[0] += origin
    found = np.array([evaluate_path(table, time) for time in times]).transpose(1, 0, 2)
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert (np.abs(found - expected) <= 100.0 * ROUNDING * scale).all()
