"""Special properties of the compilation of kernels."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba.core.caching import NullCache
from numba.core.errors import NumbaError

from autopilot.geometry.compiler import Kernel
from autopilot.geometry.kernel import kernel

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


class Rows(NamedTuple):
    first: Any
    second: Any


@kernel
def scaled(array: Any, factor: float, count: int) -> float:
    total = 0.0
    for i in range(count):
        array[i] *= factor
        total += array[i]
    return total


@kernel
def both(rows: Rows, factor: float) -> float:
    return scaled(rows.first, factor, 2) + scaled(rows.second, factor, 3)


def compiled(function: Any) -> Any:
    """The kernel, compiled now and not loaded from the cache."""
    return Kernel(function.py_func, lambda _: NullCache())


def test_a_kernel_inside_of_a_kernel_has_no_machine_code_and_one_version_for_all_literals() -> None:
    rows = Rows(np.ones(4), np.ones(4))
    assert compiled(both)(rows, 2.0) == 10.0
    assert rows.first.tolist() == [2.0, 2.0, 1.0, 1.0]
    assert len(numba.typeof(scaled).dispatcher.signatures) == 1
    assert scaled(np.ones(4), 3.0, 1) == 3.0


def test_references_are_not_counted_and_none_is_lost() -> None:
    rows = Rows(np.ones(4), np.ones(4))
    before = [sys.getrefcount(array) for array in rows]
    for _ in range(10):
        both(rows, 1.0)
    assert [sys.getrefcount(array) for array in rows] == before
    uncached = compiled(both)
    assert uncached(rows, 1.0) == 5.0
    assert "NRT_" not in uncached.inspect_llvm(uncached.signatures[0])


def test_a_kernel_that_makes_an_array_is_refused_when_it_is_compiled() -> None:
    @kernel
    def made(count: int) -> Any:
        return np.zeros(count)

    with pytest.raises(NumbaError):
        made(3)


def test_what_numba_compiles_by_itself_can_call_a_kernel() -> None:
    @numba.njit
    def outside(array: Any) -> float:
        return scaled(array, 2.0, 4)

    assert outside(np.ones(4)) == 8.0
