"""Operations of kernels on the numbers of eight flights, besides arithmetic, and on those of one flight.

A kernel is written for one flight. Where flights in lanes need something different, it calls a function of
this file, which does the ordinary thing with single numbers, in Python and in machine code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import overload
from numba.np.arrayobj import populate_array

from autopilot.geometry.compiler import INLINED, intrinsic
from autopilot.geometry.lane_numbers import BITS, INDEX, LANES, VECTOR, WHOLE, WHOLES, WIDE, flag_of

_SINGLES = ir.VectorType(ir.FloatType(), LANES)


@intrinsic
def parted(_: Any) -> Any:
    """In a kernel: the lanes that have parted from lane 0 since the last call, one bit each."""

    def made(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        flag = flag_of(builder)
        found = builder.zext(builder.load(flag), ir.IntType(64))
        builder.store(ir.Constant(BITS, 0), flag)
        return found

    return types.int64(), made


def _retyped(kind: Any) -> Any:
    known: dict[Any, Any] = {types.float64: WIDE, types.int64: WHOLE}
    return known.get(getattr(kind, "dtype", None))


@intrinsic
def in_lanes(_: Any, array: Any) -> Any:
    """In a kernel: an array whose last axis is the lanes, and which is aligned to 64 bytes, as an array of
    `Wide` or `Whole`."""
    lane = _retyped(array)
    if lane is None or array.layout != "C":
        return None
    target = types.Array(lane, array.ndim - 1, "C")

    def made(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        held = context.make_array(sig.args[0])(context, builder, given[0])
        found = context.make_array(target)(context, builder)
        shape = cgutils.unpack_tuple(builder, held.shape)[:-1]
        strides = cgutils.unpack_tuple(builder, held.strides)[:-1]
        itemsize = context.get_constant(types.intp, 8 * LANES)
        vector = VECTOR if lane == WIDE else WHOLES
        populate_array(
            found,
            data=builder.bitcast(held.data, vector.as_pointer()),
            shape=shape,
            strides=strides,
            itemsize=itemsize,
            meminfo=None,
            parent=None,
        )
        return found._getvalue()

    return target(array), made


def single(value: float) -> float:
    """`value` rounded to single precision."""
    return float(np.float32(value))


@intrinsic
def _single_lanes(_: Any, value: Any) -> Any:
    def made(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        return builder.fpext(builder.fptrunc(given[0], _SINGLES), VECTOR)

    return WIDE(WIDE), made


@overload(single, jit_options=INLINED)
def _single(value: Any) -> Any:
    def of_lanes(value: Any) -> Any:
        return _single_lanes(value)

    def of_one(value: Any) -> Any:
        return np.float64(np.float32(value))

    return of_lanes if value == WIDE else of_one


def if_above(value: float, limit: float, then: float, otherwise: float) -> float:
    """`then` if value > limit, else `otherwise`; in lanes for each flight separately, without a branch."""
    return then if value > limit else otherwise


@intrinsic
def _chosen_lanes(_: Any, value: Any, limit: Any, then: Any, otherwise: Any) -> Any:
    def made(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        wide = [context.cast(builder, one, kind, WIDE) for one, kind in zip(given, sig.args, strict=True)]
        return builder.select(builder.fcmp_ordered(">", wide[0], wide[1]), wide[2], wide[3])

    return WIDE(value, limit, then, otherwise), made


@overload(if_above, jit_options=INLINED)
def _if_above(value: Any, limit: Any, then: Any, otherwise: Any) -> Any:
    def of_lanes(value: Any, limit: Any, then: Any, otherwise: Any) -> Any:
        return _chosen_lanes(value, limit, then, otherwise)

    def of_one(value: Any, limit: Any, then: Any, otherwise: Any) -> Any:
        return then if value > limit else otherwise

    return of_lanes if WIDE in (value, limit, then, otherwise) else of_one


def each(value: float) -> int:
    """`value` as an integer; in lanes each flight has its own."""
    return int(value)


@intrinsic
def _each_lane(_: Any, value: Any) -> Any:
    def made(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        return builder.fptosi(given[0], WHOLES)

    return WHOLE(WIDE), made


@overload(each, jit_options=INLINED)
def _each(value: Any) -> Any:
    def of_lanes(value: Any) -> Any:
        return _each_lane(value)

    def of_one(value: Any) -> Any:
        return int(value)

    return of_lanes if value == WIDE else of_one


def rows_in(table: Any) -> int:
    """Number of rows of a table; in lanes each flight has its own table."""
    return len(table)


def taken(table: Any, at: int, column: int) -> float:
    """The number at a row and column of a table; in lanes each flight has its own row and its own table."""
    return float(table[at, column])


def _are_tables(kind: Any) -> bool:
    return isinstance(kind, types.UniTuple) and kind.count == LANES and isinstance(kind.dtype, types.Array)


def _tables(context: Any, builder: Any, kind: Any, value: Any) -> list[Any]:
    parts = [builder.extract_value(value, lane) for lane in range(LANES)]
    return [context.make_array(kind.dtype)(context, builder, part) for part in parts]


@intrinsic
def _rows_each(_: Any, tables: Any) -> Any:
    def made(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        found = ir.Constant(WHOLES, ir.Undefined)
        for lane, held in enumerate(_tables(context, builder, sig.args[0], given[0])):
            rows = cgutils.unpack_tuple(builder, held.shape)[0]
            found = builder.insert_element(found, rows, ir.Constant(INDEX, lane))
        return found

    return WHOLE(tables), made


@intrinsic
def _taken_each(_: Any, tables: Any, at: Any, column: Any) -> Any:
    def made(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        found = ir.Constant(VECTOR, ir.Undefined)
        for lane, held in enumerate(_tables(context, builder, sig.args[0], given[0])):
            where = ir.Constant(INDEX, lane)
            rows, columns = cgutils.unpack_tuple(builder, held.shape)
            row = builder.extract_element(given[1], where)
            # a lane that has parted from the others may request a row that does not exist
            row = builder.select(builder.icmp_unsigned("<", row, rows), row, ir.Constant(row.type, 0))
            place = builder.gep(held.data, [builder.add(builder.mul(row, columns), given[2])])
            found = builder.insert_element(found, builder.load(place), where)
        return found

    return WIDE(tables, WHOLE, types.intp), made


@overload(rows_in, jit_options=INLINED)
def _rows_in(table: Any) -> Any:
    def of_lanes(table: Any) -> Any:
        return _rows_each(table)

    def of_one(table: Any) -> Any:
        return table.shape[0]

    return of_lanes if _are_tables(table) else of_one


@overload(taken, jit_options=INLINED)
def _taken(table: Any, at: Any, column: Any) -> Any:
    def of_lanes(table: Any, at: Any, column: Any) -> Any:
        return _taken_each(table, at, column)

    def of_one(table: Any, at: Any, column: Any) -> Any:
        return table[at, column]

    return of_lanes if _are_tables(table) else of_one


def bits_of(value: float) -> int:
    """The 64 bits of a double as an integer."""
    return int(np.float64(value).view(np.int64))


def of_bits(bits: int) -> float:
    """The double with these 64 bits."""
    return float(np.int64(bits).view(np.float64))


def _reinterpreting(before: Any, after: Any, before_lanes: Any, after_lanes: Any) -> Any:
    @intrinsic
    def done(_: Any, value: Any) -> Any:
        result = after_lanes if value == before_lanes else after

        def made(context: Any, builder: Any, sig: Any, given: Any) -> Any:
            return builder.bitcast(given[0], context.get_value_type(result))

        return result(before_lanes if value == before_lanes else before), made

    return done


_bits, _value = (
    _reinterpreting(types.float64, types.int64, WIDE, WHOLE),
    _reinterpreting(types.int64, types.float64, WHOLE, WIDE),
)


@overload(bits_of, jit_options=INLINED)
def _bits_of(value: Any) -> Any:
    def made(value: Any) -> Any:
        return _bits(value)

    return made


@overload(of_bits, jit_options=INLINED)
def _of_bits(bits: Any) -> Any:
    def made(bits: Any) -> Any:
        return _value(bits)

    return made
