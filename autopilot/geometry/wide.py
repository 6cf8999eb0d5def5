"""Eight numbers that machine code moves, adds and multiplies in one instruction.

LLVM does not vectorise loops over small matrices: it cannot know that their arrays do not overlap. `Wide` is
a vector of eight doubles with + - *, element by element, so that machine code and Python agree to the bit:

    put_wide(P, i, j, wide_at(P, i, j) + factor * wide_at(P, k, j))      # eight numbers of row i

Arrays are two-dimensional, of float64, contiguous by rows. The numbers from column j to j + 7 must exist: as
in kernels generally, nothing is checked. An array of `aligned_zeros` is faster: eight numbers are then in one
line of the processor's cache.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, overload, register_model
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

from autopilot.geometry.compiler import INLINE_OPTIONS
from autopilot.geometry.lane_numbers import VECTOR, WIDE, define_for_lanes

WIDTH = 8
Array = NDArray[np.float64]


class Wide:
    """Eight numbers. A number times a `Wide` multiplies each of them."""

    __slots__ = ("numbers",)

    def __init__(self, numbers: tuple[float, ...]) -> None:
        self.numbers = numbers

    def __add__(self, other: Wide) -> Wide:
        return Wide(tuple(a + b for a, b in zip(self.numbers, other.numbers, strict=True)))

    def __sub__(self, other: Wide) -> Wide:
        return Wide(tuple(a - b for a, b in zip(self.numbers, other.numbers, strict=True)))

    def __rmul__(self, factor: float) -> Wide:
        return Wide(tuple(factor * a for a in self.numbers))


def aligned_zeros(rows: int, columns: int) -> Array:
    """An array of zeros that begins at the start of a cache line."""
    numbers = np.zeros(rows * columns + WIDTH)
    first = -numbers.ctypes.data // numbers.itemsize % WIDTH
    return numbers[first : first + rows * columns].reshape(rows, columns)


def wide_at(array: Array, i: int, j: int) -> Wide:
    """The numbers array[i, j] ... array[i, j + 7]."""
    return Wide(tuple(array[i, j : j + WIDTH].tolist()))


def put_wide(array: Array, i: int, j: int, wide: Wide) -> None:
    """Write eight numbers to array[i, j] ... array[i, j + 7]."""
    array[i, j : j + WIDTH] = wide.numbers


def columns_at_once(array: Array) -> int:
    """Number of columns that `wide_at` takes: eight; from an array in lanes, one."""
    return WIDTH


def eight_at(array: Array, i: int, j: int) -> Wide:
    """The numbers array[i, j] ... array[i, j + 7]; from an array in lanes eight neighbours as well."""
    return wide_at(array, i, j)


def put_eight(array: Array, i: int, j: int, eight: Wide) -> None:
    """Write eight numbers to array[i, j] ... array[i, j + 7]."""
    put_wide(array, i, j, eight)


def transposed(array: Array) -> Array:
    """The array after `transpose_blocks`; an array in lanes, in which that function moves nothing, as a
    transposed view."""
    return array


def transpose_blocks(array: Array, i: int, j: int) -> None:
    """Exchange the blocks of 8 x 8 numbers that begin at [i, j] and [j, i], each transposed."""
    upper = array[i : i + WIDTH, j : j + WIDTH].T.copy()
    array[i : i + WIDTH, j : j + WIDTH] = array[j : j + WIDTH, i : i + WIDTH].T.copy()
    array[j : j + WIDTH, i : i + WIDTH] = upper


def mirror_block(array: Array, i: int, j: int) -> None:
    """Copy the part above the diagonal of the 8 x 8 block at [i, j], j >= i, to its mirror image below."""
    for row in range(i, i + WIDTH):
        for column in range(max(j, row), j + WIDTH):
            array[column, row] = array[row, column]


# ---- for the compiler


_LANE = ir.IntType(32)


def _pointer(context: Any, builder: Any, kind: Any, array: Any, i: Any, j: Any) -> Any:
    """Pointer to the eight numbers from array[i, j] on; in an array in lanes, to the one number of eight
    lanes."""
    held = context.make_array(kind)(context, builder, array)
    rows, columns = cgutils.unpack_tuple(builder, held.shape)
    at = (builder.mul(i, columns), j) if kind.layout == "C" else (builder.mul(j, rows), i)
    place = builder.gep(held.data, [builder.add(*at)])
    return builder.bitcast(place, VECTOR.as_pointer())


def _shuffled(builder: Any, a: Any, b: Any, lanes: list[int]) -> Any:
    """A vector of the given lanes: 0-7 are those of `a`, 8-15 those of `b`."""
    mask = ir.Constant(ir.VectorType(_LANE, WIDTH), [ir.Constant(_LANE, lane) for lane in lanes])
    return builder.shuffle_vector(a, b, mask)


def _transposed_vectors(builder: Any, rows: list[Any]) -> list[Any]:
    """The columns of eight given rows as eight vectors: blocks of 4, 2 and 1 are exchanged."""
    rows = list(rows)
    for size in (4, 2, 1):
        for i in (k for k in range(WIDTH) if not k & size):
            a, b = rows[i], rows[i + size]
            first = [k if not k & size else WIDTH + k - size for k in range(WIDTH)]
            second = [k + size if not k & size else WIDTH + k for k in range(WIDTH)]
            rows[i], rows[i + size] = _shuffled(builder, a, b, first), _shuffled(builder, a, b, second)
    return rows


def _block(context: Any, builder: Any, kind: Any, array: Any, i: Any, j: Any) -> list[Any]:
    """Pointers to the eight rows of the block at [i, j]."""
    return [
        _pointer(context, builder, kind, array, builder.add(i, ir.Constant(i.type, k)), j)
        for k in range(WIDTH)
    ]


def _load(builder: Any, places: list[Any]) -> list[Any]:
    return [builder.load(place, align=8) for place in places]


def _store(builder: Any, rows: list[Any], places: list[Any]) -> None:
    for row, place in zip(rows, places, strict=True):
        builder.store(row, place, align=8)


def _has_lane_elements(array: Any) -> bool:
    return bool(array.dtype == WIDE)


def _is_supported(array: Any) -> bool:
    layouts = "CF" if _has_lane_elements(array) else "C"
    return isinstance(array, types.Array) and array.ndim == 2 and array.layout in layouts


@overload(columns_at_once, jit_options=INLINE_OPTIONS)
def _columns_at_once(array: Any) -> Any:
    count = 1 if _has_lane_elements(array) else WIDTH

    def implementation(array: Any) -> Any:
        return count

    return implementation if _is_supported(array) else None


@intrinsic
def _load_wide(_: Any, array: Any, i: Any, j: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], *args)
        return builder.load(place, align=8)

    return WIDE(array, types.intp, types.intp), codegen


@intrinsic
def _store_wide(_: Any, array: Any, i: Any, j: Any, wide: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], *args[:3])
        builder.store(args[3], place, align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, WIDE), codegen


@intrinsic
def _exchange_blocks(_: Any, array: Any, i: Any, j: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind, (held, first, second) = signature.args[0], args
        upper = _block(context, builder, kind, held, first, second)
        lower = _block(context, builder, kind, held, second, first)
        above, below = (_transposed_vectors(builder, _load(builder, places)) for places in (upper, lower))
        _store(builder, below, upper)
        _store(builder, above, lower)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp), codegen


@intrinsic
def _mirror_lanes(_: Any, array: Any, i: Any, j: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind, (held, first, second) = signature.args[0], args
        upper = _block(context, builder, kind, held, first, second)
        lower = _block(context, builder, kind, held, second, first)
        rows = _load(builder, upper)
        columns = _transposed_vectors(builder, rows)
        on_diagonal = builder.icmp_signed("==", first, second)
        for k in range(WIDTH):
            kept = [WIDTH + lane if lane < k else lane for lane in range(WIDTH)]
            half = _shuffled(builder, rows[k], columns[k], kept)
            builder.store(builder.select(on_diagonal, half, columns[k]), lower[k], align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp), codegen


@overload(wide_at, jit_options=INLINE_OPTIONS)
def _wide_at(array: Any, i: Any, j: Any) -> Any:
    def implementation(array: Any, i: Any, j: Any) -> Any:
        return _load_wide(array, i, j)

    return implementation if _is_supported(array) else None


@overload(put_wide, jit_options=INLINE_OPTIONS)
def _put_wide(array: Any, i: Any, j: Any, wide: Any) -> Any:
    def implementation(array: Any, i: Any, j: Any, wide: Any) -> Any:
        return _store_wide(array, i, j, wide)

    return implementation if _is_supported(array) else None


@overload(transpose_blocks, jit_options=INLINE_OPTIONS)
def _transpose_blocks(array: Any, i: Any, j: Any) -> Any:
    def implementation(array: Any, i: Any, j: Any) -> Any:
        return _exchange_blocks(array, i, j)

    def of_lanes(array: Any, i: Any, j: Any) -> None:
        pass

    if not _is_supported(array):
        return None
    return of_lanes if _has_lane_elements(array) else implementation


@overload(mirror_block, jit_options=INLINE_OPTIONS)
def _mirror_block(array: Any, i: Any, j: Any) -> Any:
    def implementation(array: Any, i: Any, j: Any) -> Any:
        return _mirror_lanes(array, i, j)

    def of_lanes(array: Any, i: Any, j: Any) -> Any:
        _store_wide(array, j, i, _load_wide(array, i, j))

    if not _is_supported(array):
        return None
    return of_lanes if _has_lane_elements(array) else implementation


# ---- a transposed view of an array in lanes


@infer_global(transposed)
class _TransposedTemplate(AbstractTemplate):
    key = transposed

    def generic(self, args: Any, kws: Any) -> Any:
        """The type of the view."""
        (array,) = args
        if not _is_supported(array):
            return None
        return signature(array.copy(layout="F") if _has_lane_elements(array) else array, array)


def _lower_transposed(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    if sig.return_type == sig.args[0]:
        return args[0]
    source = context.make_array(sig.args[0])(context, builder, args[0])
    found = context.make_array(sig.return_type)(context, builder)
    populate_array(
        found,
        data=source.data,
        shape=cgutils.unpack_tuple(builder, source.shape)[::-1],
        strides=cgutils.unpack_tuple(builder, source.strides)[::-1],
        itemsize=source.itemsize,
        meminfo=None,
        parent=None,
    )
    return found._getvalue()


lower_builtin(transposed, types.Array)(_lower_transposed)


# ---- eight neighbours in an array in lanes


class _EightType(types.Type):
    """Eight neighbours in a row of an array in lanes: one vector each."""


EIGHT: Any = _EightType("Eight")
_VECTORS = ir.ArrayType(VECTOR, WIDTH)


@register_model(_EightType)
class _EightModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTORS)  # type: ignore[no-untyped-call]


def _neighbours(context: Any, builder: Any, kind: Any, array: Any, i: Any, j: Any) -> list[Any]:
    """Pointers to eight neighbours."""
    columns = [builder.add(j, ir.Constant(j.type, k)) for k in range(WIDTH)]
    return [_pointer(context, builder, kind, array, i, column) for column in columns]


def _joined(builder: Any, vectors: list[Any]) -> Any:
    found = ir.Constant(_VECTORS, ir.Undefined)
    for k, vector in enumerate(vectors):
        found = builder.insert_value(found, vector, k)
    return found


def _one_by_one(name: str) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        def part(k: int, value: Any, kind: Any) -> Any:
            return builder.extract_value(value, k) if kind == EIGHT else value

        pairs = list(zip(args, sig.args, strict=True))
        done = [getattr(builder, name)(*(part(k, *one) for one in pairs)) for k in range(WIDTH)]
        return _joined(builder, done)

    return codegen


define_for_lanes(operator.add, _one_by_one("fadd"), signature(EIGHT, EIGHT, EIGHT))
define_for_lanes(operator.sub, _one_by_one("fsub"), signature(EIGHT, EIGHT, EIGHT))
define_for_lanes(operator.mul, _one_by_one("fmul"), signature(EIGHT, WIDE, EIGHT))


@intrinsic
def _load_eight(_: Any, array: Any, i: Any, j: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _joined(builder, _load(builder, _neighbours(context, builder, sig.args[0], *args)))

    return EIGHT(array, types.intp, types.intp), codegen


@intrinsic
def _store_eight(_: Any, array: Any, i: Any, j: Any, eight: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        vectors = [builder.extract_value(args[3], k) for k in range(WIDTH)]
        _store(builder, vectors, _neighbours(context, builder, sig.args[0], *args[:3]))
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, EIGHT), codegen


@overload(eight_at, jit_options=INLINE_OPTIONS)
def _eight_at(array: Any, i: Any, j: Any) -> Any:
    def implementation(array: Any, i: Any, j: Any) -> Any:
        return _load_wide(array, i, j)

    def of_lanes(array: Any, i: Any, j: Any) -> Any:
        return _load_eight(array, i, j)

    if not _is_supported(array):
        return None
    return of_lanes if _has_lane_elements(array) else implementation


@overload(put_eight, jit_options=INLINE_OPTIONS)
def _put_eight(array: Any, i: Any, j: Any, eight: Any) -> Any:
    def implementation(array: Any, i: Any, j: Any, eight: Any) -> Any:
        return _store_wide(array, i, j, eight)

    def of_lanes(array: Any, i: Any, j: Any, eight: Any) -> Any:
        return _store_eight(array, i, j, eight)

    if not _is_supported(array):
        return None
    return of_lanes if _has_lane_elements(array) else implementation
