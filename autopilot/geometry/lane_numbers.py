"""Numbers of eight flights at once, as types of the compiler: kernels compile for them as for single numbers.

`WIDE` is a vector of eight doubles, one for each flight, `WIDE_INT` one of eight integers. Sums, products,
roots and the like are computed lane by lane with the same rounding as for single numbers, so that each flight
gets the same bits as alone. A number that is the same for all flights can be mixed with them.

A kernel takes one branch for all lanes. So whatever decides on a branch (a comparison, `int`, `isfinite`)
returns one result, that of lane 0. Lanes whose own result differs are recorded, and `lanes.diverged_lanes`
returns them: what has been computed since then is right only for the other lanes.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_cast
from numba.core.typeconv import Conversion  # type: ignore[attr-defined]
from numba.core.typing.templates import AbstractTemplate, ConcreteTemplate, infer_global, signature
from numba.extending import lower_builtin, models, register_model

LANES = 8
_FLAG = "plumbline_lanes_parted"


class _LaneType(types.Type):
    """Eight numbers; a single number is converted to eight copies of it."""

    convertible_types: tuple[Any, ...] = ()

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """How numba may convert another type to this one."""
        return Conversion.safe if isinstance(other, self.convertible_types) else None


class _WideIntType(_LaneType):
    convertible_types = (types.Integer, types.Boolean)


class _WideType(_LaneType):
    convertible_types = (types.Integer, types.Boolean, types.Float, _WideIntType)


WIDE: Any = _WideType("Wide")
WIDE_INT: Any = _WideIntType("Whole")
VECTOR = ir.VectorType(ir.DoubleType(), LANES)
INT_VECTOR = ir.VectorType(ir.IntType(64), LANES)
INDEX, LANE_BITS = ir.IntType(32), ir.IntType(LANES)


@register_model(_WideType)
class _WideModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)  # type: ignore[no-untyped-call]


@register_model(_WideIntType)
class _WideIntModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, INT_VECTOR)  # type: ignore[no-untyped-call]


# ---- one branch for all


def divergence_flag(builder: Any) -> Any:
    """The variable that records which lanes have diverged."""
    module = builder.module
    if _FLAG in module.globals:
        return module.globals[_FLAG]
    flag = ir.GlobalVariable(module, LANE_BITS, _FLAG)
    flag.linkage, flag.initializer = "linkonce_odr", ir.Constant(LANE_BITS, 0)
    return flag


def _lane_zero_branch(builder: Any, answers: Any) -> Any:
    """Lane 0's of eight truth values; the lanes whose value differs are recorded."""
    bits = builder.bitcast(answers, LANE_BITS)
    first = builder.and_(bits, ir.Constant(LANE_BITS, 1))
    others = builder.xor(bits, builder.neg(first))  # from lane 0's value in all eight bits
    flag = divergence_flag(builder)
    builder.store(builder.or_(builder.load(flag), others), flag)
    return builder.extract_element(answers, ir.Constant(INDEX, 0))


# ---- arithmetic

Lowering = Callable[[Any, Any, Any, Any], Any]  # (context, builder, signature, values) -> value


def define_for_lanes(function: Any, codegen: Lowering, *signatures: Any) -> None:
    """Make `function` callable in kernels with these types."""
    template = type(f"Lanes_{function.__name__}", (ConcreteTemplate,), {"key": function, "cases": signatures})
    infer_global(function, types.Function(template))  # functions of NumPy 1 do not name their module
    for one in signatures:
        lower_builtin(function, *one.args)(codegen)


def _builder_method(name: str) -> Lowering:
    return lambda context, builder, signature, args: getattr(builder, name)(*args)


def _comparison(sign: str, how: str) -> Lowering:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _lane_zero_branch(builder, getattr(builder, how)(sign, *args))

    return codegen


_BINARY, _INT_BINARY = signature(WIDE, WIDE, WIDE), signature(WIDE_INT, WIDE_INT, WIDE_INT)
for plain, in_place, floats, ints in (
    (operator.add, operator.iadd, "fadd", "add"),
    (operator.sub, operator.isub, "fsub", "sub"),
    (operator.mul, operator.imul, "fmul", "mul"),
    (operator.truediv, operator.itruediv, "fdiv", ""),
    (operator.and_, operator.iand, "", "and_"),
    (operator.xor, operator.ixor, "", "xor"),
    (operator.or_, operator.ior, "", "or_"),
    (operator.rshift, operator.irshift, "", "ashr"),
    (operator.lshift, operator.ilshift, "", "shl"),
):
    for function in (plain, in_place):
        cases = [_BINARY] * bool(floats) + [_INT_BINARY] * bool(ints)
        template = type(f"Lanes_{function.__name__}", (ConcreteTemplate,), {"key": function, "cases": cases})
        infer_global(function)(template)
        if floats:
            lower_builtin(function, WIDE, WIDE)(_builder_method(floats))
        if ints:
            lower_builtin(function, WIDE_INT, WIDE_INT)(_builder_method(ints))

for function, sign, ordered in (
    (operator.lt, "<", "fcmp_ordered"),
    (operator.le, "<=", "fcmp_ordered"),
    (operator.gt, ">", "fcmp_ordered"),
    (operator.ge, ">=", "fcmp_ordered"),
    (operator.eq, "==", "fcmp_ordered"),
    (operator.ne, "!=", "fcmp_unordered"),
):
    cases = [signature(types.boolean, WIDE, WIDE), signature(types.boolean, WIDE_INT, WIDE_INT)]
    template = type(f"Lanes_{function.__name__}", (ConcreteTemplate,), {"key": function, "cases": cases})
    infer_global(function)(template)
    lower_builtin(function, WIDE, WIDE)(_comparison(sign, ordered))
    lower_builtin(function, WIDE_INT, WIDE_INT)(_comparison(sign, "icmp_signed"))


def _floor_divided(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    a, b = args
    quotient, rest = builder.sdiv(a, b), builder.srem(a, b)
    zero = ir.Constant(INT_VECTOR, None)
    down = builder.and_(
        builder.icmp_signed("!=", rest, zero), builder.icmp_signed("<", builder.xor(a, b), zero)
    )
    return builder.add(quotient, builder.sext(down, INT_VECTOR))


def _modulo(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    quotient = _floor_divided(context, builder, signature, args)
    return builder.sub(args[0], builder.mul(quotient, args[1]))


define_for_lanes(operator.floordiv, _floor_divided, _INT_BINARY)
define_for_lanes(operator.mod, _modulo, _INT_BINARY)
define_for_lanes(operator.neg, _builder_method("fneg"), signature(WIDE, WIDE))


def _vector_intrinsic(name: str) -> Lowering:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(VECTOR, [VECTOR])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v8f64"), args)

    return codegen


_UNARY = signature(WIDE, WIDE)
define_for_lanes(abs, _vector_intrinsic("fabs"), _UNARY)
define_for_lanes(math.sqrt, _vector_intrinsic("sqrt"), _UNARY)
define_for_lanes(np.rint, _vector_intrinsic("rint"), _UNARY)


def _lane_by_lane(function: Any) -> Lowering:
    """Implementation of a function that the library has for single numbers only."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        one = signature(types.float64, *[types.float64] * len(args))
        call = context.get_function(function, one)
        found = ir.Constant(VECTOR, ir.Undefined)
        for lane in range(LANES):
            at = ir.Constant(INDEX, lane)
            value = call(builder, [builder.extract_element(vector, at) for vector in args])
            found = builder.insert_element(found, value, at)
        return found

    return codegen


for known in (math.sin, math.cos, math.acos, math.asin, math.log, math.exp):
    define_for_lanes(known, _lane_by_lane(known), _UNARY)
define_for_lanes(math.atan2, _lane_by_lane(math.atan2), _BINARY)


def _predicate(test: Callable[[Any, Any], Any]) -> Lowering:
    return lambda context, builder, signature, args: _lane_zero_branch(builder, test(builder, args[0]))


def _is_finite(builder: Any, value: Any) -> Any:
    # x - x is 0, or nan
    difference = builder.fsub(value, value)
    return builder.fcmp_ordered("==", difference, difference)


def _is_inf(builder: Any, value: Any) -> Any:
    kind = ir.FunctionType(VECTOR, [VECTOR])
    size = builder.call(cgutils.get_or_insert_function(builder.module, kind, "llvm.fabs.v8f64"), [value])
    return builder.fcmp_ordered("==", size, _splat_constant(float("inf")))


def _splat_constant(value: float) -> Any:
    return ir.Constant(VECTOR, [ir.Constant(ir.DoubleType(), value)] * LANES)


_PREDICATE = signature(types.boolean, WIDE)
define_for_lanes(
    math.isnan, _predicate(lambda builder, value: builder.fcmp_unordered("uno", value, value)), _PREDICATE
)
define_for_lanes(math.isfinite, _predicate(_is_finite), _PREDICATE)
define_for_lanes(math.isinf, _predicate(_is_inf), _PREDICATE)


def _lane_zero_int(builder: Any, ints: Any) -> Any:
    """Lane 0's of eight integers; the lanes that differ are recorded."""
    first = builder.extract_element(ints, ir.Constant(INDEX, 0))
    _lane_zero_branch(builder, builder.icmp_signed("==", ints, _splat(builder, first, INT_VECTOR)))
    return first


def _to_int(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    ints = args[0] if sig.args[0] == WIDE_INT else builder.fptosi(args[0], INT_VECTOR)
    return _lane_zero_int(builder, ints)


define_for_lanes(int, _to_int, signature(types.int64, WIDE), signature(types.int64, WIDE_INT))
define_for_lanes(float, lambda context, builder, sig, args: args[0], signature(WIDE, WIDE))


def _to_ceil(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    up = _vector_intrinsic("ceil")(context, builder, sig, args)
    return _lane_zero_int(builder, builder.fptosi(up, INT_VECTOR))


define_for_lanes(math.ceil, _to_ceil, signature(types.int64, WIDE))


def _extreme(sign: str) -> Lowering:
    """As in Python: of two numbers the first, unless the second is beyond it."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        found = args[0]
        for value in args[1:]:
            found = builder.select(builder.fcmp_ordered(sign, value, found), value, found)
        return found

    return codegen


for function, sign in ((max, ">"), (min, "<")):

    class _Extreme(AbstractTemplate):
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            """The type of the result, if one of the arguments has eight lanes."""
            if WIDE not in args:
                return None
            return signature(WIDE, *[WIDE] * len(args))

    infer_global(function)(_Extreme)
    for count in range(2, 7):
        lower_builtin(function, *[WIDE] * count)(_extreme(sign))


# ---- one number as eight, in tuples and in records


def _splat(builder: Any, value: Any, kind: Any) -> Any:
    one = builder.insert_element(ir.Constant(kind, ir.Undefined), value, ir.Constant(INDEX, 0))
    mask = ir.Constant(ir.VectorType(INDEX, LANES), [ir.Constant(INDEX, 0)] * LANES)
    return builder.shuffle_vector(one, ir.Constant(kind, ir.Undefined), mask)


def _widened(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _splat(builder, context.cast(builder, value, source, types.float64), VECTOR)


def _widened_int(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _splat(builder, context.cast(builder, value, source, types.int64), INT_VECTOR)


def _int_to_wide(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return builder.sitofp(value, VECTOR)


for single in (types.Float, types.Integer, types.Boolean):
    lower_cast(single, WIDE)(_widened)
for single in (types.Integer, types.Boolean):
    lower_cast(single, WIDE_INT)(_widened_int)
lower_cast(WIDE_INT, WIDE)(_int_to_wide)


def _with_lanes(kind: Any) -> Any:
    """The type with each of its floats replaced by eight lanes."""
    if isinstance(kind, types.Float):
        return WIDE
    if isinstance(kind, types.UniTuple):
        return types.UniTuple(_with_lanes(kind.dtype), kind.count)
    return kind


def _has_lanes(kind: Any) -> bool:
    return kind == WIDE or (isinstance(kind, types.UniTuple) and _has_lanes(kind.dtype))


_numba: Any = types  # its tuples and records are extended below to mix one number with eight
_new_tuple = _numba.Tuple.__new__


def _tuple_of(cls: Any, kinds: Sequence[Any]) -> Any:
    """numba's type of a tuple; single numbers beside numbers of eight lanes become eight lanes too, so that
    the tuple can be indexed."""
    if any(_has_lanes(kind) for kind in kinds):
        lifted = [_with_lanes(kind) for kind in kinds]
        if all(kind == lifted[0] for kind in lifted):
            return types.UniTuple(lifted[0], len(lifted))
    return _new_tuple(cls, kinds)


_numba.Tuple.__new__ = _tuple_of


def _unified_records(self: Any, context: Any, other: Any) -> Any:
    """The common type of two record types, unified field by field; None if there is none."""
    if not isinstance(other, _numba.BaseNamedTuple) or other.instance_class is not self.instance_class:
        return None
    kinds = [context.unify_pairs(a, b) for a, b in zip(self.types, other.types, strict=True)]
    if any(kind is None for kind in kinds):
        return None
    return types.BaseTuple.from_types(kinds, self.instance_class)


_numba.NamedTuple.unify = _numba.NamedUniTuple.unify = _unified_records


def _record_to_record(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    parts = [builder.extract_value(value, i) for i in range(len(source))]
    cast = [context.cast(builder, *one) for one in zip(parts, source.types, target.types, strict=True)]
    return context.make_tuple(builder, target, cast)


for first in (types.NamedTuple, types.NamedUniTuple):
    for second in (types.NamedTuple, types.NamedUniTuple):
        lower_cast(first, second)(_record_to_record)
