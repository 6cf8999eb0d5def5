"""Bringing columns to other time stamps."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs.analysis.align import as_of, hermite, linear
from tests.gcs import tolerances


@settings(deadline=None)  # a busy machine must not fail the test
@given(st.tuples(*[st.floats(-5.0, 5.0)] * 4), st.integers(2, 20))
def test_cubics_are_met_exactly_and_lines_by_both(coefficients, n):
    t = np.cumsum(np.linspace(0.1, 0.4, n))
    at = np.linspace(t[0], t[-1], 57)
    cubic, line = np.polynomial.Polynomial(coefficients), np.polynomial.Polynomial(coefficients[:2])
    scale = 1.0 + np.abs(cubic(at)).max()
    found = hermite(t, cubic(t)[:, None], cubic.deriv()(t)[:, None], at)[:, 0]
    assert np.abs(found - cubic(at)).max() <= tolerances.POLYNOMIAL * scale
    found = linear(t, line(t), at)
    assert np.abs(found - line(at)).max() <= tolerances.POLYNOMIAL * scale


def test_a_stamp_gives_its_own_sample_whatever_lies_beside_it():
    t = np.array((0.0, 0.1, 0.2, 5.0))
    values = np.array((1.0, np.nan, 3.0, 4.0))
    assert linear(t, values, t).tolist()[0::2] == [1.0, 3.0]
    assert linear(t, values, t)[3] == 4.0
    assert np.isnan(linear(t, values, np.array((0.05, 0.15)))).all()
    rates = np.zeros((4, 1))
    assert hermite(t, values[:, None], rates, t)[2, 0] == 3.0


def test_nothing_is_invented_outside_or_over_a_silence():
    t = np.array((1.0, 1.1, 2.0))
    v = np.array((10.0, 11.0, 20.0))
    at = np.array((0.99, 1.0, 1.05, 1.5, 2.0, 2.1, 3.0))
    nan = np.nan
    np.testing.assert_array_equal(linear(t, v, at), (nan, 10.0, 10.5, nan, 20.0, nan, nan))
    np.testing.assert_array_equal(as_of(t, v, at), (nan, 10.0, 10.0, 11.0, 20.0, 20.0, nan))


def test_empty_sources_give_nothing():
    none, at = np.zeros(0), np.array((0.0, 1.0))
    assert np.isnan(linear(none, none, at)).all()
    assert np.isnan(as_of(none, np.zeros((0, 3)), at)).all()
    assert hermite(none, np.zeros((0, 3)), np.zeros((0, 3)), at).shape == (2, 3)
    assert linear(np.array((1.0,)), np.array((7.0,)), at).tolist()[1] == 7.0
