"""Logarithm, sine and cosine against the mathematics library, in units of the last place."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sitl.sensors.elementary import cosine_sine, logarithm

# The bound of the algorithm is below one unit in the last place, that of the C library as well.
UNITS = 2.0

WORD = st.integers(0, 2**32 - 1)
TURN = 2.0 * math.pi / 2**32


def units(found: float, expected: float) -> float:
    return abs(found - expected) / math.ulp(expected)


@given(WORD)
def test_logarithm(word: int) -> None:
    x = (word + 1.0) / 2**32
    assert units(logarithm(x), math.log(x)) <= UNITS


def test_logarithm_of_one_is_zero_and_of_the_least_word_finite() -> None:
    assert logarithm(1.0) == 0.0
    assert units(logarithm(2.0**-32), -32.0 * math.log(2.0)) <= UNITS


@given(WORD)
def test_cosine_and_sine(word: int) -> None:
    cosine, sine = cosine_sine(word)
    # the library gets an angle of an eighth of a turn at most, which is exact except for one rounding
    quarter = (word + 2**29) >> 30
    angle = (word - (quarter << 30)) * TURN
    c, s = math.cos(angle), math.sin(angle)
    expected = [(c, s), (-s, c), (-c, -s), (s, -c)][quarter % 4]
    for found, right in zip((cosine, sine), expected, strict=True):
        assert found == right == 0.0 or units(found, right) <= UNITS


def test_quarters_of_a_turn_are_exact() -> None:
    found = [cosine_sine(quarter << 30) for quarter in range(4)]
    assert np.array_equal(found, [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])


def test_kernel_and_python_agree_to_the_bit() -> None:
    words = np.random.default_rng(1).integers(0, 2**32, 2000).tolist()
    plain = getattr(cosine_sine, "py_func", cosine_sine), getattr(logarithm, "py_func", logarithm)
    for word in words:
        assert cosine_sine(word) == plain[0](word)
        x = (word + 1.0) / 2**32
        assert logarithm(x) == plain[1](x)
