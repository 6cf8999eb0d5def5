"""Machine code that moves the numbers of a record to a row of float64 or to bytes, and back.

`packed` and `compiled` write such moves as Python source, an assignment for each number. numba takes a
quarter of a second per record to compile that source; here the same loads, stores and conversions are emitted
directly. The source is still used for records of eight flights, and for arrays that are not contiguous.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from llvmlite import ir
from numba import types

from autopilot.geometry.compiler import intrinsic


def is_row(array: Any, of: Any = types.float64) -> bool:
    """Whether an array, given by its numba type, is a contiguous row of numbers of type `of`."""
    return isinstance(array, types.Array) and (array.dtype, array.ndim, array.layout) == (of, 1, "C")


def _parts(kind: Any) -> tuple[Any, ...]:
    """The types of the elements of a tuple type."""
    return tuple(kind)


def is_numbers(kind: Any) -> bool:
    """Whether a numba type is a number, or a tuple that contains only numbers, at any depth."""
    if isinstance(kind, types.BaseTuple):
        return all(is_numbers(part) for part in _parts(kind))
    return isinstance(types.unliteral(kind), types.Integer | types.Float | types.Boolean)


def _numbers_of(context: Any, builder: Any, value: Any, kind: Any) -> Iterator[tuple[Any, Any]]:
    """The numbers of a value of this type, in order, each with its own type."""
    if isinstance(kind, types.BaseTuple):
        for i, part in enumerate(_parts(kind)):
            yield from _numbers_of(context, builder, builder.extract_value(value, i), part)
    else:
        plain = types.unliteral(kind)
        yield (value if plain == kind else context.cast(builder, value, kind, plain)), plain


def _value_from(context: Any, builder: Any, numbers: Iterator[tuple[Any, Any]], kind: Any) -> Any:
    """The value of this type made from the next numbers of an iterator, each given with its own type."""
    if isinstance(kind, types.BaseTuple):
        parts = [_value_from(context, builder, numbers, part) for part in _parts(kind)]
        return context.make_tuple(builder, kind, parts)
    number, plain = next(numbers)
    return context.cast(builder, number, plain, kind)


def _data(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    return context.make_array(kind)(context, builder, array).data


# ---- rows of float64


def _pointers(builder: Any, data: Any, first: Any) -> Iterator[Any]:
    i = 0
    while True:
        yield builder.gep(data, [builder.add(first, ir.Constant(first.type, i))])
        i += 1


@intrinsic
def put_numbers(_: Any, record: Any, row: Any, first: Any) -> Any:
    """In a kernel: write the numbers of a record to `row[first]` and onwards; `first` is not negative."""
    if not (is_row(row) and is_numbers(record)):
        return None

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind, row_type, _ = signature.args
        places = _pointers(builder, _data(context, builder, row_type, args[1]), args[2])
        for number, plain in _numbers_of(context, builder, args[0], kind):
            builder.store(context.cast(builder, number, plain, types.float64), next(places))
        return context.get_dummy_value()

    return types.none(record, row, types.intp), codegen


@intrinsic
def numbers_at(_: Any, kind: Any, row: Any, first: Any) -> Any:
    """In a kernel: the tuple of the numba type `kind` whose first number is `row[first]`; `first` is not
    negative."""
    if not (is_row(row) and isinstance(kind, types.TypeRef) and is_numbers(kind.instance_type)):
        return None
    record_type = kind.instance_type

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        places = _pointers(builder, _data(context, builder, signature.args[1], args[1]), args[2])
        numbers = ((builder.load(place), types.float64) for place in places)
        return _value_from(context, builder, numbers, record_type)

    return record_type(kind, row, types.intp), codegen


# ---- bytes


def _field(builder: Any, data: Any, first: int, size: int, double: bool) -> Any:
    """Pointer to a number of `size` bytes that begins at byte `first`."""
    number: Any = {4: ir.FloatType(), 8: ir.DoubleType()}[size] if double else ir.IntType(8 * size)
    place = builder.gep(data, [ir.Constant(ir.IntType(64), first)])
    return builder.bitcast(place, number.as_pointer())


def _fields(builder: Any, data: Any, layout: Sequence[tuple[int, str]]) -> Iterator[tuple[Any, Any]]:
    """Pointer and type of each number of a layout."""
    for first, name in layout:
        kind = getattr(types, name)
        yield _field(builder, data, first, kind.bitwidth // 8, isinstance(kind, types.Float)), kind


def field_putter(layout: Sequence[tuple[int, str]]) -> Any:
    """For kernels: put(values, payload) writes the numbers of a tuple to bytes.

    `layout` gives, for each number, its first byte and NumPy's name of its type.
    """

    @intrinsic
    def put(_: Any, values: Any, payload: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            data = _data(context, builder, signature.args[1], args[1])
            numbers = _numbers_of(context, builder, args[0], signature.args[0])
            for (number, plain), (place, kind) in zip(numbers, _fields(builder, data, layout), strict=True):
                builder.store(context.cast(builder, number, plain, kind), place, align=1)
            return context.get_dummy_value()

        return types.none(values, payload), codegen

    return put


def field_taker(layout: Sequence[tuple[int, str]], record_type: Any) -> Any:
    """For kernels: take(payload) reads a tuple of the numba type `record_type` from bytes in this layout."""

    @intrinsic
    def take(_: Any, payload: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            data = _data(context, builder, signature.args[0], args[0])
            fields = _fields(builder, data, layout)
            numbers = ((builder.load(place, align=1), kind) for place, kind in fields)
            return _value_from(context, builder, numbers, record_type)

        return record_type(payload), codegen

    return take
