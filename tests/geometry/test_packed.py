"""Records packed into rows of numbers come back equal to the bit, in machine code and in Python."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf, nan
from typing import Any, NamedTuple, get_args, get_type_hints

import numba
import numpy as np
import pytest
from numba.core.errors import TypingError

from autopilot.control.laws import LAWS
from autopilot.core.tick import ControlMemory, CoreConstants, EstimateSummary, Winch
from autopilot.estimation.records import EstimatorState
from autopilot.geometry.linear import Vec3
from autopilot.geometry.packed import Row, pack, packed, unpack, width, with_field
from autopilot.supervisor.quiescence import Stretch
from sitl.world import World, WorldModel

FIRST, BEHIND = 3, 2  # numbers before and after the record that do not belong to it
NEIGHBOUR = 7.25
FLOATS = (0.0, -0.0, inf, -inf, nan, 5e-324, 1.7976931348623157e308, 0.1, -1.0 / 3.0)
INTS = (0, -1, 2**53, -(2**53), 1_700_000_000_000_000)

IN_ROWS = (EstimatorState, ControlMemory, EstimateSummary, Stretch, CoreConstants, Winch, World, WorldModel)
OF_LAWS = dict.fromkeys(kind for law in LAWS.values() for kind in (law.constants, law.memory))

needs_compiler = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


class Here:
    class Same(NamedTuple):
        x: float
        n: int


class There:
    class Same(NamedTuple):
        flag: bool
        v: Vec3


class Both(NamedTuple):
    first: Here.Same
    second: There.Same
    pairs: tuple[tuple[float, int], tuple[bool, Here.Same]]


class Nothing(NamedTuple):
    pass


class Named(NamedTuple):
    name: str


class Endless(NamedTuple):
    numbers: tuple[float, ...]


class Listed(NamedTuple):
    inner: tuple[float, list[float]]


def made(kind: Any, rng: np.random.Generator) -> Any:
    """A value of this type, of random and of awkward numbers."""
    if kind is bool:
        return bool(rng.integers(2))
    if kind is int:
        return int(rng.choice([*INTS, int(rng.integers(-(10**9), 10**9))]))
    if kind is float:
        return float(rng.choice([*FLOATS, float(rng.normal()), float(rng.normal())]))
    if hasattr(kind, "_fields"):
        hints = get_type_hints(kind)
        return kind(*(made(hints[name], rng) for name in kind._fields))
    return tuple(made(part, rng) for part in get_args(kind))


def numbers(value: Any) -> Iterator[float]:
    """The numbers of nested tuples, in order."""
    if isinstance(value, tuple):
        for part in value:
            yield from numbers(part)
    else:
        yield float(value)


def through(kind: Any) -> Callable[[Row, Row], Any]:
    """Function that takes a record out of a row, puts it into another and returns it."""

    def trip(row: Row, out: Row) -> Any:
        record = unpack(kind, row, FIRST)
        pack(record, out, FIRST)
        return record

    return trip


def row_with(record: Any) -> Row:
    """The record's numbers as the row should have them, with neighbours."""
    return np.array([*[NEIGHBOUR] * FIRST, *numbers(record), *[NEIGHBOUR] * BEHIND])


def comes_back(trip: Callable[[Row, Row], Any], kind: Any) -> None:
    rng = np.random.default_rng(len(kind.__name__))
    for _ in range(20):
        record = made(kind, rng)
        row = row_with(record)
        out = np.full(row.shape, NEIGHBOUR)
        taken = trip(row, out)
        # of the same types at all levels, with the sign of zero
        assert repr(taken) == repr(record)
        assert type(taken) is kind
        assert out.tobytes() == row.tobytes()


def is_named(kind: Any) -> str:
    return f"{kind.__module__.rpartition('.')[2]}.{kind.__qualname__}"


@pytest.mark.parametrize("kind", [*IN_ROWS, *OF_LAWS, Both], ids=is_named)
def test_what_is_packed_comes_back_to_the_bit(kind: Any) -> None:
    comes_back(through(kind), kind)


@needs_compiler
@pytest.mark.parametrize("kind", [*IN_ROWS, *OF_LAWS, Both], ids=is_named)
def test_machine_code_packs_and_unpacks_the_same_bits(kind: Any) -> None:
    comes_back(numba.njit(through(kind)), kind)


@pytest.mark.parametrize("kind", [*IN_ROWS, *OF_LAWS, Both], ids=is_named)
def test_a_new_row_is_as_wide_as_the_record_has_numbers(kind: Any) -> None:
    record = made(kind, np.random.default_rng(1))
    row = packed(record)
    assert row.shape == (width(kind),)
    assert row.tobytes() == np.array(list(numbers(record))).tobytes()


def test_a_record_of_nothing_takes_no_room() -> None:
    assert width(Nothing) == 0
    assert packed(Nothing()).shape == (0,)
    assert unpack(Nothing, np.zeros(2), 1) == Nothing()


def test_two_records_of_one_name_are_kept_apart() -> None:
    both = Both(Here.Same(0.5, 3), There.Same(True, (1.0, 2.0, 3.0)), ((4.0, 5), (False, Here.Same(6.0, 7))))
    found = unpack(Both, packed(both), 0)
    assert found == both
    assert type(found.first) is Here.Same
    assert type(found.second) is There.Same
    assert type(found.pairs[1][1]) is Here.Same


@pytest.mark.parametrize("kind", [str, list, dict, tuple, tuple[float, ...], Named, Endless, Listed])
def test_what_is_no_fixed_number_of_numbers_is_refused(kind: Any) -> None:
    with pytest.raises(TypeError, match="has no fixed number of floats, ints or bools"):
        width(kind)
    with pytest.raises(TypeError, match="has no fixed number of floats, ints or bools"):
        unpack(kind, np.zeros(3), 0)


@pytest.mark.parametrize("record", ["text", [1.0], Named("a"), Endless((1.0, 2.0)), Listed((1.0, [2.0]))])
def test_what_is_no_record_of_numbers_is_not_packed(record: Any) -> None:
    row = np.zeros(4)
    for way in (lambda: pack(record, row, 0), lambda: packed(record)):
        with pytest.raises(TypeError, match="has no fixed number of floats, ints or bools"):
            way()
    assert not row.any()


@needs_compiler
def test_machine_code_is_not_made_for_what_is_no_record_of_numbers() -> None:
    @numba.njit
    def put(record: Any, row: Row) -> None:
        pack(record, row, 0)

    row = np.zeros(4)
    for record in ((1.0, 2.0), 1.0, Named("a"), Endless((1.0, 2.0))):
        with pytest.raises((TypingError, TypeError)):
            put(record, row)
    for kind in (Named, Endless, float):
        with pytest.raises((TypingError, TypeError)):
            numba.njit(through(kind))(np.zeros(9), np.zeros(9))
    assert not row.any()


def replaced(record: There.Same, v: Vec3) -> There.Same:
    return with_field(record, "v", v)


def flagged(record: There.Same, flag: bool) -> There.Same:
    return with_field(record, "flag", flag)


def misspelt(record: There.Same, v: Vec3) -> There.Same:
    return with_field(record, "w", v)


def test_one_field_is_replaced() -> None:
    record, v = There.Same(True, (1.0, -0.0, 3.0)), (4.0, nan, -0.0)
    for changed, expected in (
        (lambda f: f(replaced)(record, v), There.Same(True, v)),
        (lambda f: f(flagged)(record, False), There.Same(False, record.v)),
    ):
        assert repr(changed(lambda f: f)) == repr(expected)
        assert repr(changed(numba.njit)) == repr(expected)


@needs_compiler
def test_a_field_that_does_not_exist_is_not_replaced() -> None:
    record = There.Same(True, (1.0, 2.0, 3.0))
    with pytest.raises((ValueError, TypeError), match="unexpected field"):  # since Python 3.13
        misspelt(record, record.v)
    with pytest.raises(TypingError):
        numba.njit(misspelt)(record, record.v)
    with pytest.raises(TypingError):
        numba.njit(replaced)((True, record.v), record.v)
