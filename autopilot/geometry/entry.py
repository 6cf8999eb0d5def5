"""The machine code of a kernel, called without its dispatcher: from Python, or from other machine code.

At each call numba's dispatcher looks up the types of the arguments. For records of arrays, as the two ticks
take them, that costs several times what it costs to unpack them. Who always calls with arguments of the same
types asks for the machine code once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import typeof

T = TypeVar("T")


def entry_of(kernel: Callable[..., T], *arguments: Any) -> Callable[..., T]:
    """The machine code of a kernel for arguments of the types of these, compiled or loaded where need be.

    It must be called with arguments of these very types, which are not checked. A function that is not
    compiled is returned as it is.
    """
    if not hasattr(kernel, "overloads"):
        return kernel
    types = tuple(map(typeof, arguments))
    kernel.compile(types)  # type: ignore[attr-defined]
    entry: Callable[..., T] = kernel.overloads[types].entry_point
    return entry


def native_address_of(kernel: Callable[..., T], *arguments: Any) -> int:
    """The address at which `autopilot.geometry.addresses.call_kernel_at` finds a kernel for arguments of the
    types of these, compiled or loaded where need be; it stays there as long as the kernel lives."""
    types = tuple(map(typeof, arguments))
    kernel.compile(types)  # type: ignore[attr-defined]
    found = kernel.overloads[types]  # type: ignore[attr-defined]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


def address_of(kernel: Callable[..., T], *arguments: Any) -> int:
    """The address of a compiled kernel as a C function of such numbers, compiled or loaded where need be."""
    types = tuple(map(typeof, arguments))
    kernel.compile(types)  # type: ignore[attr-defined]
    found = kernel.overloads[types]  # type: ignore[attr-defined]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name))
