"""Rows of numbers, eight at a time: their sums, and the operations on a covariance.

Each number goes through the same operations in the same order for one flight, in lanes and in Python; only
how many numbers are processed before the next row differs.
"""

from __future__ import annotations

from typing import Any

from autopilot.geometry.kernel import kernel
from autopilot.geometry.wide import (
    WIDTH,
    Array,
    columns_at_once,
    eight_at,
    mirror_block,
    put_eight,
    put_wide,
    transpose_blocks,
    wide_at,
)


@kernel
def combine(into: Array, k: int, array: Array, rows: Any, shares: Array, n: int) -> None:
    """Set row k of `into` to a weighted sum of rows of `array`, of n numbers each: row rows[k, e] times
    shares[k, e], for e from 1 to rows[k, 0]."""
    if columns_at_once(into) == 1:
        for j in range(0, n, WIDTH):
            total = shares[k, 1] * eight_at(array, rows[k, 1], j)
            for entry in range(2, rows[k, 0] + 1):
                total = total + shares[k, entry] * eight_at(array, rows[k, entry], j)
            put_eight(into, k, j, total)
        return
    share, row = shares[k, 1], rows[k, 1]
    for j in range(0, n, WIDTH):
        put_wide(into, k, j, share * wide_at(array, row, j))
    for entry in range(2, rows[k, 0] + 1):
        share, row = shares[k, entry], rows[k, entry]
        for j in range(0, n, WIDTH):
            put_wide(into, k, j, wide_at(into, k, j) + share * wide_at(array, row, j))


@kernel
def subtract_row(array: Array, k: int, share: float, other: int, n: int) -> None:
    """Subtract from row k, of n numbers, `share` times row `other`."""
    for j in range(0, n, WIDTH):
        put_eight(array, k, j, eight_at(array, k, j) - share * eight_at(array, other, j))


@kernel
def subtract_rows(array: Array, k: int, shares: Array, n: int) -> None:
    """Subtract from row k, of n numbers, shares[i, 0] times row i, for each row i before it."""
    for j in range(0, n, WIDTH):
        remainder = eight_at(array, k, j)
        for i in range(k):
            remainder = remainder - shares[i, 0] * eight_at(array, i, j)
        put_eight(array, k, j, remainder)


@kernel
def accumulate_and_scale(into: Array, array: Array, factors: Array, count: int, n: int) -> None:
    """Add to the only row of `into` the first `count` rows of `array`, of n numbers, times factors[k, 0];
    then multiply each of these rows by factors[k, 1]."""
    for j in range(0, n, WIDTH):
        total = eight_at(into, 0, j)
        for k in range(count):
            row = eight_at(array, k, j)
            total = total + factors[k, 0] * row
            put_eight(array, k, j, factors[k, 1] * row)
        put_eight(into, 0, j, total)


@kernel
def transpose(array: Array, n: int) -> None:
    """Transpose the first n x n numbers, n rounded up to a multiple of eight. The result must be accessed
    through `turned`."""
    for i in range(0, n, WIDTH):
        for j in range(i, n, WIDTH):
            transpose_blocks(array, i, j)


@kernel
def symmetrise(array: Array, n: int) -> None:
    """Copy the part above the diagonal of the first n x n numbers to below it."""
    step = columns_at_once(array)
    for i in range(0, n, step):
        for j in range(i, n, step):
            mirror_block(array, i, j)


@kernel
def subtract_squares(array: Array, of: Array, count: int, n: int) -> None:
    """Subtract the squares of `count` rows, a multiple of three, from the first n x n numbers of `array`:
    array[i, j] -= of[k, i] of[k, j], from the diagonal on. The part below is its mirror image, as the product
    is symmetric."""
    if columns_at_once(array) == 1:
        _subtract_squares_in_lanes(array, of, count, n)
        return
    for first in range(0, count, 3):
        for i in range(n):
            a, b, c = of[first, i], of[first + 1, i], of[first + 2, i]
            for j in range(i - i % WIDTH, n, WIDTH):
                remainder = wide_at(array, i, j) - a * wide_at(of, first, j) - b * wide_at(of, first + 1, j)
                put_wide(array, i, j, remainder - c * wide_at(of, first + 2, j))
    symmetrise(array, n)


# ---- in lanes: two rows by two columns at a time, so that each number read is used twice


@kernel
def _subtract_squares_in_lanes(array: Array, of: Array, count: int, n: int) -> None:
    for i in range(0, n - 1, 2):
        first = 0
        while first < count:
            if count - first >= 6:
                _subtract_six(array, of, first, i, n)
                first += 6
            else:
                _subtract_three(array, of, first, i, n)
                first += 3
    if n % 2 != 0:
        for i in range(n):
            _subtract_one(array, of, count, i, n - 1)


@kernel
def _put_square(array: Array, i: int, j: int, square: Any) -> None:
    """Write a square of two by two numbers whose first is at [i, j], and its mirror image."""
    p, q, r, s = square
    # on the diagonal the two overlap: the number above it is written last and stays
    put_wide(array, i + 1, j, r)
    put_wide(array, j, i + 1, r)
    put_wide(array, i, j, p)
    put_wide(array, i, j + 1, q)
    put_wide(array, i + 1, j + 1, s)
    put_wide(array, j, i, p)
    put_wide(array, j + 1, i, q)
    put_wide(array, j + 1, i + 1, s)


@kernel
def _subtract_one(array: Array, of: Array, count: int, i: int, j: int) -> None:
    remainder = wide_at(array, i, j)
    for k in range(count):
        lane_i: Any = wide_at(of, k, i)
        remainder = remainder - lane_i * wide_at(of, k, j)
    put_wide(array, i, j, remainder)
    put_wide(array, j, i, remainder)


@kernel
def _minus_three(square: Any, of: Array, first: int, j: int, a: Any, b: Any) -> Any:
    """A square of two by two minus what three rows of `of` contribute; `a` and `b` are the numbers of these
    rows that belong to the two rows of the square."""
    p, q, r, s = square
    c, d = wide_at(of, first, j), wide_at(of, first, j + 1)
    p, q, r, s = p - a[0] * c, q - a[0] * d, r - b[0] * c, s - b[0] * d
    c, d = wide_at(of, first + 1, j), wide_at(of, first + 1, j + 1)
    p, q, r, s = p - a[1] * c, q - a[1] * d, r - b[1] * c, s - b[1] * d
    c, d = wide_at(of, first + 2, j), wide_at(of, first + 2, j + 1)
    return p - a[2] * c, q - a[2] * d, r - b[2] * c, s - b[2] * d


@kernel
def _three_at(of: Array, first: int, i: int) -> Any:
    return wide_at(of, first, i), wide_at(of, first + 1, i), wide_at(of, first + 2, i)


@kernel
def _square_at(array: Array, i: int, j: int) -> Any:
    first, second = wide_at(array, i, j), wide_at(array, i, j + 1)
    return first, second, wide_at(array, i + 1, j), wide_at(array, i + 1, j + 1)


@kernel
def _subtract_three(array: Array, of: Array, first: int, i: int, n: int) -> None:
    a, b = _three_at(of, first, i), _three_at(of, first, i + 1)
    for j in range(i, n - 1, 2):
        _put_square(array, i, j, _minus_three(_square_at(array, i, j), of, first, j, a, b))


@kernel
def _subtract_six(array: Array, of: Array, first: int, i: int, n: int) -> None:
    a, b = _three_at(of, first, i), _three_at(of, first, i + 1)
    c, d = _three_at(of, first + 3, i), _three_at(of, first + 3, i + 1)
    for j in range(i, n - 1, 2):
        square = _minus_three(_square_at(array, i, j), of, first, j, a, b)
        _put_square(array, i, j, _minus_three(square, of, first + 3, j, c, d))
