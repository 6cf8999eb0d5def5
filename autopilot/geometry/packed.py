"""Records as rows of numbers: how data passes between Python and machine code.

Passing an array to a compiled function takes a fifth of a microsecond, a nested record ten microseconds. So
what is carried from tick to tick lies in flat arrays, and kernels take records out and put them back:

    load = unpack(LoadEstimate, row, 40)      # the record whose first number is row[40]
    pack(load, row, 40)

`pack` and `unpack` follow the annotations of a NamedTuple: floats, ints, bools, tuples of fixed length
and further NamedTuples, in the order of their fields, one number each. Integers are exact up to 2^53.
Both also work in Python, with the same bits. `with_field` is `_replace` for kernels, where it does not exist.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from autopilot.geometry.compiler import INLINE_OPTIONS
from autopilot.geometry.lanes import int_per_lane
from autopilot.geometry.row_moves import is_numbers, is_row, numbers_at, put_numbers

Row = NDArray[np.float64]
R = TypeVar("R")
IntPerLane = Annotated[
    int, "each"
]  # an int that differs from flight to flight when flights are flown in lanes
_NUMBERS: dict[Any, str] = {float: "{}", int: "int({})", IntPerLane: "int_per_lane({})", bool: "{} != 0.0"}
_COMPILED: dict[Any, Any] = {
    float: types.float64,
    int: types.int64,
    IntPerLane: types.int64,
    bool: types.boolean,
}  # for one flight


@cache
def _fields(record: Any) -> tuple[tuple[str, Any], ...]:
    """Names and types of a NamedTuple's fields."""
    hints = get_type_hints(record, include_extras=True)
    return tuple((name, hints[name]) for name in record._fields)


def _is_record(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def _parts(kind: Any) -> tuple[Any, ...]:
    """Types of the fields of a record, or of the elements of a tuple. Raises TypeError for others."""
    if _is_record(kind):
        return tuple(part for _, part in _fields(kind))
    if get_origin(kind) is tuple and Ellipsis not in get_args(kind):
        return get_args(kind)
    raise TypeError(f"{kind!r} has no fixed number of floats, ints or bools")


@cache
def width(kind: Any) -> int:
    """Count of the numbers in a record of this type, a tuple or a number. Raises TypeError for others."""
    return 1 if kind in _NUMBERS else sum(map(width, _parts(kind)))


def field_offset(record: Any, name: str) -> int:
    """Index of a field's first number in the row of a record."""
    names = record._fields[: record._fields.index(name)]
    kinds = dict(_fields(record))
    return sum(width(kinds[before]) for before in names)


def _unpack_source(kind: Any, at: int, known: dict[str, Any]) -> tuple[str, int]:
    """Source of the expression that takes a `kind` from `row[at + first]`, and the place of the next one."""
    if kind in _NUMBERS:
        return _NUMBERS[kind].format(f"row[first + {at}]"), at + 1
    parts = []
    for part in _parts(kind):
        text, at = _unpack_source(part, at, known)
        parts.append(text)
    if not _is_record(kind):
        return f"({', '.join(parts)},)", at
    name = f"{kind.__name__}_{len(known)}"  # two record types may have the same name
    known[name] = kind
    return f"{name}({', '.join(parts)})", at


def _pack_source(kind: Any, value: str, at: int) -> Iterator[tuple[int, str]]:
    """(place, source of the value) for each number of the `kind` that the expression `value` names."""
    if kind in _NUMBERS:
        yield at, value
    elif _is_record(kind):
        for name, part in _fields(kind):
            yield from _pack_source(part, f"{value}.{name}", at)
            at += width(part)
    else:
        for i, part in enumerate(get_args(kind)):
            yield from _pack_source(part, f"{value}[{i}]", at)
            at += width(part)


@cache
def _unpacker(kind: Any) -> Any:
    known: dict[str, Any] = {"int_per_lane": int_per_lane}
    text, _ = _unpack_source(kind, 0, known)
    exec(f"def take(kind: Any, row: Any, first: Any) -> Any:\n    return {text}\n", known)
    return known["take"]


@cache
def _packer(kind: Any) -> Any:
    width(kind)
    lines = "".join(f"    row[first + {i}] = {text}\n" for i, text in _pack_source(kind, "record", 0))
    namespace: dict[str, Any] = {}
    exec(f"def put(record: Any, row: Any, first: Any) -> Any:\n{lines or '    pass'}\n", namespace)
    return namespace["put"]


def unpack(kind: type[R], row: Row, first: int) -> R:
    """The record of type `kind` that begins at `row[first]`."""
    record: Any = kind
    numbers = row[first : first + width(record)].tolist()
    return _unpacker(record)(record, numbers, 0)  # type: ignore[no-any-return]


def pack(record: Any, row: Row, first: int) -> None:
    """Write a record's numbers to `row[first]` and onwards."""
    kind: Any = type(record)
    _packer(kind)(record, row, first)


def packed(record: Any) -> Row:
    """A record's numbers as a new array."""
    kind: Any = type(record)
    row = np.zeros(width(kind))
    pack(record, row, 0)
    return row


def with_field(record: R, name: str, value: Any) -> R:
    """The record with one field replaced; in kernels `name` must be a literal."""
    return record._replace(**{name: value})  # type: ignore[attr-defined,no-any-return]


def _compiled_type(kind: Any) -> Any:
    """numba's type for a record of this type, a tuple or a number, for one flight."""
    if kind in _COMPILED:
        return _COMPILED[kind]
    parts = [_compiled_type(part) for part in _parts(kind)]
    return types.BaseTuple.from_types(parts, kind if _is_record(kind) else None)


@overload(unpack, jit_options=INLINE_OPTIONS)
def _unpack(kind: Any, row: Any, first: Any) -> Any:
    if not isinstance(kind, types.NamedTupleClass):
        return None
    record: Any = kind.instance_class
    if not is_row(row):
        return _unpacker(record)
    compiled_type = _compiled_type(record)

    def take(kind: Any, row: Any, first: Any) -> Any:
        return numbers_at(compiled_type, row, first)

    return take


@overload(pack, jit_options=INLINE_OPTIONS)
def _pack(record: Any, row: Any, first: Any) -> Any:
    kind: Any = getattr(record, "instance_class", None)
    if not _is_record(kind):
        return None
    if not (is_row(row) and is_numbers(record)):
        return _packer(kind)
    width(kind)  # raises TypeError for what could not be unpacked again

    def put(record: Any, row: Any, first: Any) -> Any:
        put_numbers(record, row, first)

    return put


@overload(with_field, jit_options=INLINE_OPTIONS, prefer_literal=True)
def _with_field(record: Any, name: Any, value: Any) -> Any:
    kind: Any = getattr(record, "instance_class", None)
    if not _is_record(kind) or not isinstance(name, types.StringLiteral):
        return None
    if name.literal_value not in kind._fields:
        return None
    parts = ", ".join("value" if part == name.literal_value else f"record.{part}" for part in kind._fields)
    namespace: dict[str, Any] = {"kind": kind}
    exec(f"def put(record: Any, name: Any, value: Any) -> Any:\n    return kind({parts})\n", namespace)
    return namespace["put"]
