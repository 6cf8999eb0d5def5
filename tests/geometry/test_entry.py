"""The machine code of a kernel does what the kernel does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import Row


class Rows(NamedTuple):
    first: Row
    second: Row


@kernel
def weighed(rows: Rows, weight: float, count: int) -> float:
    """Adds up, and leaves a mark."""
    rows.second[0] = count
    return float(weight * (rows.first[0] + rows.second[1]))


def test_the_entry_returns_what_the_kernel_returns_and_writes_into_the_same_rows() -> None:
    enter = entry_point_of(weighed, Rows(np.zeros(2), np.zeros(2)), 0.5, 1)
    for k in range(3):
        rows = Rows(np.array([1.0 + k, 2.0]), np.array([3.0, 4.0]))
        assert enter(rows, 0.1, k) == weighed(rows, 0.1, k)
        assert enter(rows, 3.0, 7) == 3.0 * (5.0 + k)
        assert rows.second[0] == 7.0


def test_what_is_not_compiled_is_called_as_it_is() -> None:
    assert entry_point_of(len, [1]) is len
