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

from autopilot.geometry.compiler import INLINE_OPTIONS, intrinsic
from autopilot.geometry.lane_numbers import (
    INDEX,
    INT_VECTOR,
    LANE_BITS,
    LANES,
    VECTOR,
    WIDE,
    WIDE_INT,
    divergence_flag,
)

_SINGLES = ir.VectorType(ir.FloatType(), LANES)


@intrinsic
def diverged_lanes(_: Any) -> Any:
    """In a kernel: the lanes that have diverged from lane 0 since the last call, one bit each."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        flag = divergence_flag(builder)
        found = builder.zext(builder.load(flag), ir.IntType(64))
        builder.store(ir.Constant(LANE_BITS, 0), flag)
        return found

    return types.int64(), codegen


def _lane_type(kind: Any) -> Any:
    known: dict[Any, Any] = {types.float64: WIDE, types.int64: WIDE_INT}
    return known.get(getattr(kind, "dtype", None))


@intrinsic
def as_lane_array(_: Any, array: Any) -> Any:
    """In a kernel: an array whose last axis is the lanes, and which is aligned to 64 bytes, as an array of
    `WIDE` or `WIDE_INT`."""
    lane = _lane_type(array)
    if lane is None or array.layout != "C":
        return None
    target = types.Array(lane, array.ndim - 1, "C")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        source = context.make_array(sig.args[0])(context, builder, args[0])
        found = context.make_array(target)(context, builder)
        shape = cgutils.unpack_tuple(builder, source.shape)[:-1]
        strides = cgutils.unpack_tuple(builder, source.strides)[:-1]
        itemsize = context.get_constant(types.intp, 8 * LANES)
        vector = VECTOR if lane == WIDE else INT_VECTOR
        populate_array(
            found,
            data=builder.bitcast(source.data, vector.as_pointer()),
            shape=shape,
            strides=strides,
            itemsize=itemsize,
            meminfo=None,
            parent=None,
        )
        return found._getvalue()

    return target(array), codegen


def to_single(value: float) -> float:
    """`value` rounded to single precision."""
    return float(np.float32(value))


@intrinsic
def _single_lanes(_: Any, value: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.fpext(builder.fptrunc(args[0], _SINGLES), VECTOR)

    return WIDE(WIDE), codegen


@overload(to_single, jit_options=INLINE_OPTIONS)
def _to_single(value: Any) -> Any:
    def of_lanes(value: Any) -> Any:
        return _single_lanes(value)

    def of_one(value: Any) -> Any:
        return np.float64(np.float32(value))

    return of_lanes if value == WIDE else of_one


def if_above(value: float, limit: float, then: float, otherwise: float) -> float:
    """`then` if value > limit, else `otherwise`; in lanes for each flight separately, without a branch."""
    return then if value > limit else otherwise


@intrinsic
def _select_lanes(_: Any, value: Any, limit: Any, then: Any, otherwise: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        wide = [context.cast(builder, one, kind, WIDE) for one, kind in zip(args, sig.args, strict=True)]
        return builder.select(builder.fcmp_ordered(">", wide[0], wide[1]), wide[2], wide[3])

    return WIDE(value, limit, then, otherwise), codegen


@overload(if_above, jit_options=INLINE_OPTIONS)
def _if_above(value: Any, limit: Any, then: Any, otherwise: Any) -> Any:
    def of_lanes(value: Any, limit: Any, then: Any, otherwise: Any) -> Any:
        return _select_lanes(value, limit, then, otherwise)

    def of_one(value: Any, limit: Any, then: Any, otherwise: Any) -> Any:
        return then if value > limit else otherwise

    return of_lanes if WIDE in (value, limit, then, otherwise) else of_one


def int_per_lane(value: float) -> int:
    """`value` as an integer; in lanes each flight has its own."""
    return int(value)


@intrinsic
def _int_lanes(_: Any, value: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.fptosi(args[0], INT_VECTOR)

    return WIDE_INT(WIDE), codegen


@overload(int_per_lane, jit_options=INLINE_OPTIONS)
def _int_per_lane(value: Any) -> Any:
    def of_lanes(value: Any) -> Any:
        return _int_lanes(value)

    def of_one(value: Any) -> Any:
        return int(value)

    return of_lanes if value == WIDE else of_one


def row_count(table: Any) -> int:
    """Number of rows of a table; in lanes each flight has its own table."""
    return len(table)


def table_value(table: Any, at: int, column: int) -> float:
    """The number at a row and column of a table; in lanes each flight has its own row and its own table."""
    return float(table[at, column])


def _is_table_per_lane(kind: Any) -> bool:
    return isinstance(kind, types.UniTuple) and kind.count == LANES and isinstance(kind.dtype, types.Array)


def _arrays_per_lane(context: Any, builder: Any, kind: Any, value: Any) -> list[Any]:
    parts = [builder.extract_value(value, lane) for lane in range(LANES)]
    return [context.make_array(kind.dtype)(context, builder, part) for part in parts]


@intrinsic
def _row_count_lanes(_: Any, tables: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        found = ir.Constant(INT_VECTOR, ir.Undefined)
        for lane, table in enumerate(_arrays_per_lane(context, builder, sig.args[0], args[0])):
            rows = cgutils.unpack_tuple(builder, table.shape)[0]
            found = builder.insert_element(found, rows, ir.Constant(INDEX, lane))
        return found

    return WIDE_INT(tables), codegen


@intrinsic
def _table_value_lanes(_: Any, tables: Any, at: Any, column: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        found = ir.Constant(VECTOR, ir.Undefined)
        for lane, table in enumerate(_arrays_per_lane(context, builder, sig.args[0], args[0])):
            where = ir.Constant(INDEX, lane)
            rows, columns = cgutils.unpack_tuple(builder, table.shape)
            row = builder.extract_element(args[1], where)
            # a lane that has diverged from the others may request a row that does not exist
            row = builder.select(builder.icmp_unsigned("<", row, rows), row, ir.Constant(row.type, 0))
            place = builder.gep(table.data, [builder.add(builder.mul(row, columns), args[2])])
            found = builder.insert_element(found, builder.load(place), where)
        return found

    return WIDE(tables, WIDE_INT, types.intp), codegen


@overload(row_count, jit_options=INLINE_OPTIONS)
def _row_count(table: Any) -> Any:
    def of_lanes(table: Any) -> Any:
        return _row_count_lanes(table)

    def of_one(table: Any) -> Any:
        return table.shape[0]

    return of_lanes if _is_table_per_lane(table) else of_one


@overload(table_value, jit_options=INLINE_OPTIONS)
def _table_value(table: Any, at: Any, column: Any) -> Any:
    def of_lanes(table: Any, at: Any, column: Any) -> Any:
        return _table_value_lanes(table, at, column)

    def of_one(table: Any, at: Any, column: Any) -> Any:
        return table[at, column]

    return of_lanes if _is_table_per_lane(table) else of_one


def bits_of(value: float) -> int:
    """The 64 bits of a double as an integer."""
    return int(np.float64(value).view(np.int64))


def float_from_bits(bits: int) -> float:
    """The double with these 64 bits."""
    return float(np.int64(bits).view(np.float64))


def _bitcast(source: Any, target: Any, source_lanes: Any, target_lanes: Any) -> Any:
    @intrinsic
    def done(_: Any, value: Any) -> Any:
        result = target_lanes if value == source_lanes else target

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.bitcast(args[0], context.get_value_type(result))

        return result(source_lanes if value == source_lanes else source), codegen

    return done


_bits, _value = (
    _bitcast(types.float64, types.int64, WIDE, WIDE_INT),
    _bitcast(types.int64, types.float64, WIDE_INT, WIDE),
)


@overload(bits_of, jit_options=INLINE_OPTIONS)
def _bits_of(value: Any) -> Any:
    def implementation(value: Any) -> Any:
        return _bits(value)

    return implementation


@overload(float_from_bits, jit_options=INLINE_OPTIONS)
def _float_from_bits(bits: Any) -> Any:
    def implementation(bits: Any) -> Any:
        return _value(bits)

    return implementation
