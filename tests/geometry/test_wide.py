"""Eight numbers at once: the same bits as one by one, in machine code and in Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.geometry.kernel import kernel
from autopilot.geometry.wide import aligned_zeros, mirror_block, put_wide, transpose_blocks, wide_at

SIZE = 24
BLOCKS = [0, 8, 16]


@kernel
def combined(array: Any, to: int, of: int, j: int, factor: float) -> None:
    put_wide(array, to, j, wide_at(array, to, j) + factor * wide_at(array, of, j) - wide_at(array, of, j))


@kernel
def transposed(array: Any, i: int, j: int) -> None:
    transpose_blocks(array, i, j)


@kernel
def mirrored(array: Any, i: int, j: int) -> None:
    mirror_block(array, i, j)


def numbers(seed: int) -> Any:
    return np.random.default_rng(seed).normal(size=(SIZE, SIZE))


def plain(function: Any) -> Any:
    return getattr(function, "py_func", function)


@given(
    st.integers(0, 2**32),
    st.integers(0, SIZE - 1),
    st.integers(0, SIZE - 1),
    st.integers(0, SIZE - 8),
    st.floats(-1e6, 1e6),
)
@settings(max_examples=50, deadline=None)
def test_rows_are_combined_number_by_number(seed: int, to: int, of: int, j: int, factor: float) -> None:
    expected = numbers(seed)
    for k in range(j, j + 8):
        expected[to, k] = expected[to, k] + factor * expected[of, k] - expected[of, k]
    if to == of:
        return  # the row that is read is also written
    for function in (combined, plain(combined)):
        array = numbers(seed)
        function(array, to, of, j, factor)
        assert array.tobytes() == expected.tobytes()


@pytest.mark.parametrize("i", BLOCKS)
@pytest.mark.parametrize("j", BLOCKS)
def test_blocks_change_places_transposed(i: int, j: int) -> None:
    expected = numbers(1)
    upper, lower = (expected[a : a + 8, b : b + 8].T.copy() for a, b in ((i, j), (j, i)))
    expected[i : i + 8, j : j + 8] = lower
    expected[j : j + 8, i : i + 8] = upper
    for function in (transposed, plain(transposed)):
        array = numbers(1)
        function(array, i, j)
        assert array.tobytes() == expected.tobytes()


@pytest.mark.parametrize(("i", "j"), [(i, j) for i in BLOCKS for j in BLOCKS if i <= j])
def test_what_is_above_the_diagonal_is_written_below(i: int, j: int) -> None:
    expected = numbers(2)
    for row in range(i, i + 8):
        for column in range(j, j + 8):
            if column >= row:
                expected[column, row] = expected[row, column]
    for function in (mirrored, plain(mirrored)):
        array = numbers(2)
        function(array, i, j)
        assert array.tobytes() == expected.tobytes()


@pytest.mark.parametrize("columns", [8, 13, 32])
def test_an_aligned_array_begins_at_a_cache_line_whatever_was_allocated_before(columns: int) -> None:
    arrays = [aligned_zeros(3, columns) for _ in range(20)]
    assert {array.ctypes.data % 64 for array in arrays} == {0}
    assert all(array.shape == (3, columns) and not array.any() for array in arrays)
