"""Comparison of numbers with their proved values."""

from __future__ import annotations

from typing import Any

import numpy as np

EXACT = 1e-12  # a handful of roundings on numbers of order one


def close(actual: Any, expected: Any, tolerance: float) -> None:
    """Assert that all numbers are equal within the tolerance times the largest expected magnitude (at least
    1); NaN always fails."""
    actual, expected = np.asarray(actual, float), np.asarray(expected, float)
    error = np.max(np.abs(actual - expected))
    assert error <= tolerance * max(1.0, float(np.max(np.abs(expected)))), f"{actual} is not {expected}"
