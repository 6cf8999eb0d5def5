"""A kernel that calls another one by its address gets what a direct call would return."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
import pytest

from autopilot.geometry.addresses import call_int_kernel_at, call_kernel_at
from autopilot.geometry.entry import kernel_address_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import Row

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


class Rows(NamedTuple):
    first: Row
    second: Row


class Own(NamedTuple):
    """The same arrays as fields of another record, with an address beside them."""

    first: Row
    second: Row
    address: int


@kernel
def doubled(rows: Rows, share: float, chosen: bool) -> None:
    rows.second[0] = 2.0 * rows.first[1] + share if chosen else -1.0


@kernel
def counted(rows: Rows, more: int) -> int:
    return len(rows.first) + more


@kernel
def by_address(own: Own, share: float, chosen: bool) -> None:
    call_kernel_at(own.address, (own.first, own.second, share, chosen))


@kernel
def answer_of(address: int, rows: Rows, more: int) -> int:
    return int(call_int_kernel_at(address, (rows, more)))


def test_it_writes_into_the_same_rows_given_the_members_of_a_tuple_or_the_tuple() -> None:
    rows = Rows(np.array([1.0, 3.0]), np.zeros(1))
    address = kernel_address_of(doubled, rows, 0.5, True)
    by_address(Own(rows.first, rows.second, address), 0.5, True)
    assert rows.second[0] == 6.5
    by_address(Own(rows.first, rows.second, address), 0.5, False)
    assert rows.second[0] == -1.0


def test_it_hands_back_a_whole_number() -> None:
    rows = Rows(np.zeros(4), np.zeros(1))
    address = kernel_address_of(counted, rows, 1)
    assert [answer_of(address, rows, more) for more in (-9, 0, 2**40)] == [-5, 4, 2**40 + 4]
