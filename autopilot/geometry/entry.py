"""The machine code of a kernel, called without its dispatcher: from Python, or from other machine code.

At each call numba's dispatcher looks up the types of the arguments. For records of arrays, such as the two
ticks take, that costs several times as much as unpacking them. A caller whose arguments always have the same
types gets the machine code once and calls it directly.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import typeof

T = TypeVar("T")


def entry_point_of(kernel: Callable[..., T], *arguments: Any) -> Callable[..., T]:
    """The machine code of a kernel for arguments of the same types as these, compiled or loaded if necessary.

    It must be called with arguments of exactly these types, which are not checked. A plain Python function is
    returned as it is.
    """
    if not hasattr(kernel, "overloads"):
        return kernel
    types = tuple(map(typeof, arguments))
    kernel.compile(types)  # type: ignore[attr-defined]
    entry: Callable[..., T] = kernel.overloads[types].entry_point
    return entry


def kernel_address_of(kernel: Callable[..., T], *arguments: Any) -> int:
    """The address by which `autopilot.geometry.addresses.call_kernel_at` calls a kernel with arguments of the
    same types as these, compiled or loaded if necessary; it is valid as long as the kernel exists."""
    types = tuple(map(typeof, arguments))
    kernel.compile(types)  # type: ignore[attr-defined]
    found = kernel.overloads[types]  # type: ignore[attr-defined]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


def c_function_address_of(kernel: Callable[..., T], *arguments: Any) -> int:
    """The address of a kernel as a C function of arguments like these, compiled or loaded if necessary."""
    types = tuple(map(typeof, arguments))
    kernel.compile(types)  # type: ignore[attr-defined]
    found = kernel.overloads[types]  # type: ignore[attr-defined]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name))
