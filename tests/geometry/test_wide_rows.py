"""Sums of rows, and squares of rows subtracted from a matrix: the bits of numpy, for one flight and in
lanes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lane_numbers import LANES
from autopilot.geometry.lanes import as_lane_array
from autopilot.geometry.wide import transposed
from autopilot.geometry.wide_rows import (
    accumulate_and_scale,
    combine,
    subtract_row,
    subtract_rows,
    subtract_squares,
    symmetrise,
    transpose,
)

ROOM, ROWS = 32, 9
SIZES = [22, 29, 31]


@kernel
def all_rows(square: Any, rows: Any, into: Any, which: Any, shares: Any, count: int, n: int) -> None:
    """All operations on rows, one after the other."""
    for k in range(count):
        combine(rows, k, square, which, shares, n)
    subtract_row(rows, 1, shares[2, 2], 0, n)
    for k in range(count):
        subtract_rows(rows, k, shares, n)
    accumulate_and_scale(into, rows, shares, count, n)


@kernel
def all_rows_in_lanes(square: Any, rows: Any, into: Any, which: Any, shares: Any, count: int, n: int) -> None:
    all_rows(
        as_lane_array(square),
        as_lane_array(rows),
        as_lane_array(into),
        which,
        as_lane_array(shares),
        count,
        n,
    )


@kernel
def squares(square: Any, rows: Any, count: int, n: int) -> None:
    subtract_squares(square, rows, count, n)


@kernel
def squares_in_lanes(square: Any, rows: Any, count: int, n: int) -> None:
    subtract_squares(as_lane_array(square), as_lane_array(rows), count, n)


@kernel
def moved(before: Any, n: int) -> None:
    transpose(before, n)
    after = transposed(before)
    for i in range(n):
        after[2, i] = 3.0 * after[5, i]
    symmetrise(after, n)


@kernel
def moved_in_lanes(square: Any, n: int) -> None:
    moved(as_lane_array(square), n)


def numbers(*shape: int) -> list[Any]:
    """Random arrays of this shape, one for each lane."""
    random = np.random.default_rng(shape)
    return [random.normal(size=shape) for _ in range(LANES)]


def beside(arrays: list[Any], columns: int = 0) -> Any:
    """(..., LANES) arrays side by side, beginning at a whole cache line; padded to `columns` if that is
    more."""
    shape = (arrays[0].shape[0], max(columns, arrays[0].shape[1]), LANES)
    block = np.zeros(int(np.prod(shape)) + 8)
    first = -block.ctypes.data // 8 % 8
    found = block[first : first + int(np.prod(shape))].reshape(shape)
    found[:, : arrays[0].shape[1]] = np.stack(arrays, axis=-1)
    return found


def compiled(function: Any) -> bool:
    return hasattr(function, "py_func")


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("count", [2, 3, 6, 9])
def test_rows(n: int, count: int) -> None:
    square, rows, into, shares = numbers(ROOM, ROOM), numbers(ROWS, ROOM), numbers(1, ROOM), numbers(ROWS, 13)
    which = np.random.default_rng(count).integers(0, n, (ROWS, 13))
    which[:, 0] = np.arange(ROWS) % 5 + 1
    found = []
    for lane in range(LANES):
        expected_rows, expected = rows[lane].copy(), into[lane].copy()
        s = shares[lane]
        for k in range(count):
            total = s[k, 1] * square[lane][which[k, 1]]
            for e in range(2, which[k, 0] + 1):
                total = total + s[k, e] * square[lane][which[k, e]]
            expected_rows[k] = total
        expected_rows[1] = expected_rows[1] - s[2, 2] * expected_rows[0]
        for k in range(count):
            for i in range(k):
                expected_rows[k] = expected_rows[k] - s[i, 0] * expected_rows[i]
        for k in range(count):
            expected = expected + s[k, 0] * expected_rows[k]
        expected_rows[:count] = s[:count, 1:2] * expected_rows[:count]
        found.append((expected_rows, expected))
        own_rows, own = rows[lane].copy(), into[lane].copy()
        all_rows(square[lane], own_rows, own, which, s, count, n)
        assert own_rows[:count, :n].tobytes() == expected_rows[:count, :n].tobytes()
        assert own[:, :n].tobytes() == expected[:, :n].tobytes()
    if compiled(all_rows_in_lanes):
        lanes_rows, lanes_into = beside(rows), beside(into)
        all_rows_in_lanes(beside(square, 40), lanes_rows, lanes_into, which, beside(shares), count, n)
        for lane, (expected_rows, expected) in enumerate(found):
            assert lanes_rows[:count, :n, lane].tobytes() == expected_rows[:count, :n].tobytes()
            assert lanes_into[:, :n, lane].tobytes() == expected[:, :n].tobytes()


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("count", [3, 6, 9])
def test_squares(n: int, count: int) -> None:
    square, rows = numbers(ROOM, ROOM), numbers(ROWS, ROOM)
    found = []
    for lane in range(LANES):
        expected = square[lane][:n, :n].copy()
        for k in range(count):
            row = rows[lane][k, :n]
            expected = expected - row[:, None] * row[None, :]
        expected = np.triu(expected) + np.triu(expected, 1).T
        found.append(expected)
        own = square[lane].copy()
        squares(own, rows[lane], count, n)
        assert own[:n, :n].tobytes() == expected.tobytes()
    if compiled(squares_in_lanes):
        lanes = beside(square, 40)
        squares_in_lanes(lanes, beside(rows), count, n)
        for lane, expected in enumerate(found):
            assert lanes[:n, :n, lane].tobytes() == expected.tobytes()
            assert lanes[n:, n:ROOM, lane].tobytes() == square[lane][n:, n:].tobytes()


@pytest.mark.parametrize("n", SIZES)
def test_a_square_looked_at_the_other_way_round(n: int) -> None:
    square = numbers(ROOM, ROOM)
    found = []
    for lane in range(LANES):
        expected = square[lane][:n, :n].T.copy()
        expected[2] = 3.0 * expected[5]
        expected = np.triu(expected) + np.triu(expected, 1).T
        found.append(expected)
        own = square[lane].copy()
        moved(own, n)
        assert own[:n, :n].tobytes() == expected.tobytes()
    if compiled(moved_in_lanes):
        lanes = beside(square, 40)
        moved_in_lanes(lanes, n)
        for lane, expected in enumerate(found):
            assert lanes[:n, :n, lane].tobytes() == expected.tobytes()
