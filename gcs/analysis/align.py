"""Columns brought to common time stamps: the last value, straight lines, or cubics through value and rate.

All times are in seconds and strictly increasing; values are (n,) or (n, k). Where the source was silent for
longer than `max_gap_s`, or has not begun, or has ended, the result is NaN: a report does not invent what
was not received.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gcs.analysis.axes import Floats

Indices = NDArray[np.intp]
# left neighbours, right neighbours, fraction of the way (shaped to broadcast against the values) -> values
Interpolant = Callable[[Indices, Indices, Floats], Floats]

MAX_GAP_S = 0.5  # a load that moves at 2 m/s is anywhere within a metre after half a second of silence


def as_of(stamps_s: Floats, values: Floats, at_s: Floats, max_gap_s: float = MAX_GAP_S) -> Floats:
    """The last value at or before each time."""
    found = np.full((len(at_s), *values.shape[1:]), np.nan)
    index = np.searchsorted(stamps_s, at_s, side="right") - 1
    known = index >= 0
    known[known] = at_s[known] - stamps_s[index[known]] <= max_gap_s
    found[known] = values[index[known]]
    return found


def linear(stamps_s: Floats, values: Floats, at_s: Floats, max_gap_s: float = MAX_GAP_S) -> Floats:
    """Straight lines between the samples."""

    def line(left: Indices, right: Indices, s: Floats) -> Floats:
        return (1.0 - s) * values[left] + s * values[right]

    return _interpolate(stamps_s, values, at_s, max_gap_s, line)


def hermite(
    stamps_s: Floats, values: Floats, rates: Floats, at_s: Floats, max_gap_s: float = MAX_GAP_S
) -> Floats:
    """Cubics that meet value and rate at both neighbours; `rates` per second, shaped as `values`."""

    def cubic(left: Indices, right: Indices, s: Floats) -> Floats:
        h = (stamps_s[right] - stamps_s[left]).reshape(s.shape)
        return (
            (1.0 + 2.0 * s) * (1.0 - s) ** 2 * values[left]
            + s * (1.0 - s) ** 2 * h * rates[left]
            + s * s * (3.0 - 2.0 * s) * values[right]
            + s * s * (s - 1.0) * h * rates[right]
        )

    return _interpolate(stamps_s, values, at_s, max_gap_s, cubic)


def _interpolate(
    stamps_s: Floats, values: Floats, at_s: Floats, max_gap_s: float, interpolant: Interpolant
) -> Floats:
    """The sample itself where a time equals its stamp; `interpolant` where it lies between two stamps that
    are at most `max_gap_s` apart; else NaN."""
    found = np.full((len(at_s), *values.shape[1:]), np.nan)
    if len(stamps_s) == 0:
        return found
    last = len(stamps_s) - 1
    left = np.clip(np.searchsorted(stamps_s, at_s, side="right") - 1, 0, last)
    right = np.minimum(left + 1, last)
    span = stamps_s[right] - stamps_s[left]
    exact = at_s == stamps_s[left]
    found[exact] = values[left[exact]]
    inner = ~exact & (at_s > stamps_s[left]) & (at_s < stamps_s[right]) & (span <= max_gap_s)
    fraction = (at_s[inner] - stamps_s[left[inner]]) / span[inner]
    found[inner] = interpolant(left[inner], right[inner], fraction.reshape(-1, *(1,) * (values.ndim - 1)))
    return found
