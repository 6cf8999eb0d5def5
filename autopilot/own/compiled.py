"""A class of compiled methods as C functions on its exchange row: no Python code runs while it flies.

The class is a NamedTuple of numbers, and so is what its `start` returns. In the row, the answer is followed
by the numbers of the class and those of its memory; the functions read them there and write the memory back.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from functools import cache, update_wrapper
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numba
from numba.core.caching import NullCache

from autopilot.geometry.addresses import numbers_at
from autopilot.geometry.compiler import Kernel
from autopilot.geometry.entry import c_function_address_of
from autopilot.geometry.packed import pack, unpack, width
from autopilot.own.loaded_class import LoadedClass

P = ParamSpec("P")
T = TypeVar("T")


class NoMemory(NamedTuple):
    """The memory of a class that has none."""


class ExchangeLayout(NamedTuple):
    """Layout of an exchange row: what a method is given, a record of numbers, begins at number 0."""

    input_type: Any  # the type of this record
    answer_offset: int  # where the answer begins
    own_offset: int  # where the numbers of the class begin, followed by those of its memory

    def size(self, kind: type, memory: type) -> int:
        """Count of all numbers in the row, for a class and its memory."""
        return self.own_offset + width(kind) + width(memory)


class CFunction(NamedTuple):
    """Machine code that is called with an address; it is valid as long as its kernel exists."""

    address: int
    kernel: Any


def c_function(entry: Any) -> CFunction:
    """A kernel of one integer as a C function.

    numba's `cfunc` is not used: it leaves the functions that it calls visible to the linker, which then takes
    in their place functions of the same name that were specialised for one caller.
    """
    return CFunction(c_function_address_of(entry, 0), entry)


def is_compiled(loaded_class: LoadedClass, methods: tuple[str, ...]) -> bool:
    """Whether a class can be called as machine code: it is a NamedTuple, and its methods are kernels."""
    kind = loaded_class.kind
    methods_found = [getattr(kind, name) for name in (*methods, "start") if hasattr(kind, name)]
    return hasattr(kind, "_fields") and all(isinstance(method, Kernel) for method in methods_found)


def memory_type(instance: Any, now: Any) -> Any:
    """The type of the memory of an instance, for its input `now` at the first tick."""
    return type(instance.start(now)) if hasattr(instance, "start") else NoMemory


@cache
def compiled(
    kind: type, methods: tuple[str, ...], memory: type, layout: ExchangeLayout
) -> Mapping[str, CFunction]:
    """The C function of each of these methods of a class, for the type of its memory."""
    start = getattr(kind, "start", None) or _start_without_memory(memory)
    return {name: _compiled_method(kind, memory, layout, start, getattr(kind, name)) for name in methods}


def function_address(function: Any) -> int:
    """The address of a `CFunction` or of a function of ctypes."""
    address = getattr(function, "address", None) or ctypes.cast(function, ctypes.c_void_p).value
    return int(address or 0)


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a method, or a function that it calls, to machine code; strict IEEE arithmetic.

    The methods are those of a law or an estimator. Each program that flies one compiles it, in about a
    second. It must not create arrays: vectors are tuples of three floats, for which
    `autopilot.geometry.linear` has functions.
    """
    if numba.config.DISABLE_JIT:
        return function
    compiled: Callable[P, T] = update_wrapper(Kernel(function, lambda _: NullCache()), function)
    return compiled


def _start_without_memory(memory: type) -> Any:
    @kernel
    def start(own: Any, now: Any) -> Any:
        return memory()

    return start


def _compiled_method(kind: Any, memory: Any, layout: ExchangeLayout, start: Any, method: Any) -> CFunction:
    input_type, answer_offset, own_offset = layout
    size, memory_offset = layout.size(kind, memory), own_offset + width(kind)

    @kernel
    def entry(address: Any) -> None:
        numbers = numbers_at(address, size)
        now = unpack(input_type, numbers, 0)
        instance = unpack(kind, numbers, own_offset)
        if now.begins:
            pack(start(instance, now), numbers, memory_offset)
        new_memory, result = method(instance, unpack(memory, numbers, memory_offset), now)
        pack(new_memory, numbers, memory_offset)
        pack(result, numbers, answer_offset)

    return c_function(entry)
