"""Numbers and functions at addresses: how machine code calls code that was compiled or written separately.

`numbers_at(address, size)` returns the numbers (float64) at an address as an array that does not own its
memory; `call_at(function, address)` calls the C function `void f(void *)` at an address with another address.
Both work in kernels and, where nothing is compiled, in Python.

`call_kernel_at(address, arguments)` calls a separately compiled kernel that returns nothing,
`call_int_kernel_at` one that returns an integer; `call_kernel_returning(types)` makes a function that calls
one that returns values of these types. Nothing is checked: the arguments, a tuple, must have the types for
which the kernel was compiled (`autopilot.geometry.entry.kernel_address_of`), or be the members of its tuples
one after another. All of these work only in kernels, as does `bytes_at(address, size)`: the bytes at an
address, whose memory they do not own.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


def _numbers_in_python(address: int, size: int) -> Any:
    return np.ctypeslib.as_array((ctypes.c_double * size).from_address(address))


def _call_in_python(function: int, address: int) -> None:
    _FUNCTION(function)(address)


def _numbers(context: Any, address: Any, size: Any) -> Any:
    kind = types.Array(types.float64, 1, "C")

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(kind)(context, builder)
        wide = context.get_constant(types.intp, 8)
        data = builder.inttoptr(args[0], array.data.type)
        populate_array(array, data, (args[1],), (wide,), wide, None)
        return array._getvalue()

    return kind(types.int64, types.int64), codegen


def _kernel_call(returned: Any) -> Any:
    """An intrinsic that calls a kernel with this return type by numba's own calling convention."""

    def typed(_: Any, address: Any, arguments: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            kinds, caller = signature.args[1].types, context.call_conv
            function = builder.inttoptr(args[0], caller.get_function_type(returned, kinds).as_pointer())
            status, found = caller.call_function(
                builder, function, returned, kinds, cgutils.unpack_tuple(builder, args[1])
            )
            with cgutils.if_unlikely(builder, status.is_error):
                caller.return_status_propagate(builder, status)
            return context.get_dummy_value() if returned is types.none else found

        return returned(types.int64, arguments), codegen

    return intrinsic(typed)


def call_kernel_returning(*returned: Any) -> Any:
    """A function that calls a kernel at an address, which returns a tuple of these numba types."""
    return _kernel_call(types.BaseTuple.from_types(returned))


def _bytes(_: Any, address: Any, size: Any) -> Any:
    kind = types.Bytes(types.uint8, 1, "C")

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        found = context.make_helper(builder, kind)
        one = context.get_constant(types.intp, 1)
        data = builder.inttoptr(args[0], found.data.type)
        populate_array(found, data, (args[1],), (one,), one, None)
        return found._getvalue()

    return kind(types.int64, types.int64), codegen


def _call(context: Any, function: Any, address: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t])
        function = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(function, [builder.inttoptr(args[1], cgutils.voidptr_t)])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), codegen


numbers_at: Any = _numbers_in_python if numba.config.DISABLE_JIT else intrinsic(_numbers)
call_at: Any = _call_in_python if numba.config.DISABLE_JIT else intrinsic(_call)
call_kernel_at: Any = _kernel_call(types.none)
call_int_kernel_at: Any = _kernel_call(types.int64)
bytes_at: Any = intrinsic(_bytes)
