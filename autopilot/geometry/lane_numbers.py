"""Numbers of eight flights at once, as types of the compiler: kernels compile for them as for single numbers.

`WIDE` is a vector of eight doubles, one for each flight, `WHOLE` one of eight integers. Sums, products,
roots and the like are computed lane by lane with the same rounding as for single numbers, so that each flight
gets the same bits as alone. A number that is the same for all flights can be mixed with them.

A kernel takes one branch for all lanes. So whatever decides on a branch (a comparison, `int`, `isfinite`)
returns one result, that of lane 0. Lanes whose own result differs are recorded, and `lanes.parted` returns
them: what has been computed since then is right only for the other lanes.
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

    taken: tuple[Any, ...] = ()

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """How numba may convert another type to this one."""
        return Conversion.safe if isinstance(other, self.taken) else None


class _WholeType(_LaneType):
    taken = (types.Integer, types.Boolean)


class _WideType(_LaneType):
    taken = (types.Integer, types.Boolean, types.Float, _WholeType)


WIDE: Any = _WideType("Wide")
WHOLE: Any = _WholeType("Whole")
VECTOR = ir.VectorType(ir.DoubleType(), LANES)
WHOLES = ir.VectorType(ir.IntType(64), LANES)
INDEX, BITS = ir.IntType(32), ir.IntType(LANES)


@register_model(_WideType)
class _WideModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)  # type: ignore[no-untyped-call]


@register_model(_WholeType)
class _WholeModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, WHOLES)  # type: ignore[no-untyped-call]


# ---- one branch for all


def flag_of(builder: Any) -> Any:
    """The variable that records which lanes have parted."""
    module = builder.module
    if _FLAG in module.globals:
        return module.globals[_FLAG]
    flag = ir.GlobalVariable(module, BITS, _FLAG)
    flag.linkage, flag.initializer = "linkonce_odr", ir.Constant(BITS, 0)
    return flag


def _agreed(builder: Any, answers: Any) -> Any:
    """Lane 0's of eight truth values; the lanes whose value differs are recorded."""
    bits = builder.bitcast(answers, BITS)
    first = builder.and_(bits, ir.Constant(BITS, 1))
    others = builder.xor(bits, builder.neg(first))  # from lane 0's value in all eight bits
    flag = flag_of(builder)
    builder.store(builder.or_(builder.load(flag), others), flag)
    return builder.extract_element(answers, ir.Constant(INDEX, 0))


# ---- arithmetic

Made = Callable[[Any, Any, Any, Any], Any]  # (context, builder, signature, values) -> value


def define(function: Any, made: Made, *signatures: Any) -> None:
    """Make `function` callable in kernels with these types."""
    template = type(f"Lanes_{function.__name__}", (ConcreteTemplate,), {"key": function, "cases": signatures})
    infer_global(function, types.Function(template))  # functions of NumPy 1 do not name their module
    for one in signatures:
        lower_builtin(function, *one.args)(made)


def _by(name: str) -> Made:
    return lambda context, builder, signature, given: getattr(builder, name)(*given)


def _compared(sign: str, how: str) -> Made:
    def made(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return _agreed(builder, getattr(builder, how)(sign, *given))

    return made


_WIDES, _TWOWHOLES = signature(WIDE, WIDE, WIDE), signature(WHOLE, WHOLE, WHOLE)
for plain, in_place, floats, wholes in (
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
        cases = [_WIDES] * bool(floats) + [_TWOWHOLES] * bool(wholes)
        template = type(f"Lanes_{function.__name__}", (ConcreteTemplate,), {"key": function, "cases": cases})
        infer_global(function)(template)
        if floats:
            lower_builtin(function, WIDE, WIDE)(_by(floats))
        if wholes:
            lower_builtin(function, WHOLE, WHOLE)(_by(wholes))

for function, sign, ordered in (
    (operator.lt, "<", "fcmp_ordered"),
    (operator.le, "<=", "fcmp_ordered"),
    (operator.gt, ">", "fcmp_ordered"),
    (operator.ge, ">=", "fcmp_ordered"),
    (operator.eq, "==", "fcmp_ordered"),
    (operator.ne, "!=", "fcmp_unordered"),
):
    cases = [signature(types.boolean, WIDE, WIDE), signature(types.boolean, WHOLE, WHOLE)]
    template = type(f"Lanes_{function.__name__}", (ConcreteTemplate,), {"key": function, "cases": cases})
    infer_global(function)(template)
    lower_builtin(function, WIDE, WIDE)(_compared(sign, ordered))
    lower_builtin(function, WHOLE, WHOLE)(_compared(sign, "icmp_signed"))


def _floor_divided(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    a, b = given
    quotient, rest = builder.sdiv(a, b), builder.srem(a, b)
    zero = ir.Constant(WHOLES, None)
    down = builder.and_(
        builder.icmp_signed("!=", rest, zero), builder.icmp_signed("<", builder.xor(a, b), zero)
    )
    return builder.add(quotient, builder.sext(down, WHOLES))


def _rest_of(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    whole = _floor_divided(context, builder, signature, given)
    return builder.sub(given[0], builder.mul(whole, given[1]))


define(operator.floordiv, _floor_divided, _TWOWHOLES)
define(operator.mod, _rest_of, _TWOWHOLES)
define(operator.neg, _by("fneg"), signature(WIDE, WIDE))


def _vector_intrinsic(name: str) -> Made:
    def made(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        kind = ir.FunctionType(VECTOR, [VECTOR])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v8f64"), given)

    return made


_ONE = signature(WIDE, WIDE)
define(abs, _vector_intrinsic("fabs"), _ONE)
define(math.sqrt, _vector_intrinsic("sqrt"), _ONE)
define(np.rint, _vector_intrinsic("rint"), _ONE)


def _lane_by_lane(function: Any) -> Made:
    """Implementation of a function that the library has for single numbers only."""

    def made(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        one = signature(types.float64, *[types.float64] * len(given))
        call = context.get_function(function, one)
        found = ir.Constant(VECTOR, ir.Undefined)
        for lane in range(LANES):
            at = ir.Constant(INDEX, lane)
            value = call(builder, [builder.extract_element(vector, at) for vector in given])
            found = builder.insert_element(found, value, at)
        return found

    return made


for known in (math.sin, math.cos, math.acos, math.asin, math.log, math.exp):
    define(known, _lane_by_lane(known), _ONE)
define(math.atan2, _lane_by_lane(math.atan2), _WIDES)


def _answered(test: Callable[[Any, Any], Any]) -> Made:
    return lambda context, builder, signature, given: _agreed(builder, test(builder, given[0]))


def _is_finite(builder: Any, value: Any) -> Any:
    # x - x is 0, or nan
    gone = builder.fsub(value, value)
    return builder.fcmp_ordered("==", gone, gone)


def _is_inf(builder: Any, value: Any) -> Any:
    kind = ir.FunctionType(VECTOR, [VECTOR])
    size = builder.call(cgutils.get_or_insert_function(builder.module, kind, "llvm.fabs.v8f64"), [value])
    return builder.fcmp_ordered("==", size, _splat_constant(float("inf")))


def _splat_constant(value: float) -> Any:
    return ir.Constant(VECTOR, [ir.Constant(ir.DoubleType(), value)] * LANES)


_PREDICATE = signature(types.boolean, WIDE)
define(math.isnan, _answered(lambda builder, value: builder.fcmp_unordered("uno", value, value)), _PREDICATE)
define(math.isfinite, _answered(_is_finite), _PREDICATE)
define(math.isinf, _answered(_is_inf), _PREDICATE)


def _common(builder: Any, wholes: Any) -> Any:
    """Lane 0's of eight integers; the lanes that differ are recorded."""
    first = builder.extract_element(wholes, ir.Constant(INDEX, 0))
    _agreed(builder, builder.icmp_signed("==", wholes, _splat(builder, first, WHOLES)))
    return first


def _to_int(context: Any, builder: Any, sig: Any, given: Any) -> Any:
    wholes = given[0] if sig.args[0] == WHOLE else builder.fptosi(given[0], WHOLES)
    return _common(builder, wholes)


define(int, _to_int, signature(types.int64, WIDE), signature(types.int64, WHOLE))
define(float, lambda context, builder, sig, given: given[0], signature(WIDE, WIDE))


def _to_ceil(context: Any, builder: Any, sig: Any, given: Any) -> Any:
    up = _vector_intrinsic("ceil")(context, builder, sig, given)
    return _common(builder, builder.fptosi(up, WHOLES))


define(math.ceil, _to_ceil, signature(types.int64, WIDE))


def _extreme(sign: str) -> Made:
    """As in Python: of two numbers the first, unless the second is beyond it."""

    def made(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        found = given[0]
        for value in given[1:]:
            found = builder.select(builder.fcmp_ordered(sign, value, found), value, found)
        return found

    return made


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


def _widened_whole(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _splat(builder, context.cast(builder, value, source, types.int64), WHOLES)


def _as_wide(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return builder.sitofp(value, VECTOR)


for single in (types.Float, types.Integer, types.Boolean):
    lower_cast(single, WIDE)(_widened)
for single in (types.Integer, types.Boolean):
    lower_cast(single, WHOLE)(_widened_whole)
lower_cast(WHOLE, WIDE)(_as_wide)


def _lifted(kind: Any) -> Any:
    """The type with each of its floats replaced by eight lanes."""
    if isinstance(kind, types.Float):
        return WIDE
    if isinstance(kind, types.UniTuple):
        return types.UniTuple(_lifted(kind.dtype), kind.count)
    return kind


def _has_lanes(kind: Any) -> bool:
    return kind == WIDE or (isinstance(kind, types.UniTuple) and _has_lanes(kind.dtype))


_numba: Any = types  # its tuples and records are extended below to mix one number with eight
_new_tuple = _numba.Tuple.__new__


def _tuple_of(cls: Any, kinds: Sequence[Any]) -> Any:
    """numba's type of a tuple; single numbers beside numbers of eight lanes become eight lanes too, so that
    the tuple can be indexed."""
    if any(_has_lanes(kind) for kind in kinds):
        lifted = [_lifted(kind) for kind in kinds]
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
