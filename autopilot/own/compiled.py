"""A class of compiled methods as C functions over its desk: Python is not asked while it flies.

The class is a NamedTuple of numbers, and so is what its `start` returns. Behind the answer on the desk lie
its own numbers and those of its memory, which the functions take from there and put back.
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
from autopilot.geometry.entry import address_of
from autopilot.geometry.packed import pack, unpack, width
from autopilot.own.brought import Brought

P = ParamSpec("P")
T = TypeVar("T")


class Nothing(NamedTuple):
    """The memory of a law that has none."""


class Desk(NamedTuple):
    """What lies where on a desk: from number 0 on what a method is given, a record of numbers."""

    given: Any  # its type
    answer: int  # where the answer is put
    own: int  # from where on the numbers of the class lie, and behind them those of its memory

    def room(self, kind: type, memory: type) -> int:
        """How many numbers it has for a class and what that remembers."""
        return self.own + width(kind) + width(memory)


class CFunction(NamedTuple):
    """Machine code that is called with an address; it lives as long as its kernel."""

    address: int
    kernel: Any


def c_function(entry: Any) -> CFunction:
    """A kernel of one whole number as a C function.

    Not by numba's `cfunc`: that leaves what it calls visible to the linker, which then finds in its place
    functions of the same name that were fitted to one caller.
    """
    return CFunction(address_of(entry, 0), entry)


def is_compiled(brought: Brought, methods: tuple[str, ...]) -> bool:
    """Whether a class can be called as machine code: all of these methods are kernels over numbers."""
    kind = brought.kind
    found = [getattr(kind, name) for name in (*methods, "start") if hasattr(kind, name)]
    return hasattr(kind, "_fields") and all(isinstance(method, Kernel) for method in found)


def memory_of(made: Any, now: Any) -> Any:
    """The type of what one remembers, given what it is given at its first tick."""
    return type(made.start(now)) if hasattr(made, "start") else Nothing


@cache
def compiled(kind: type, methods: tuple[str, ...], memory: type, desk: Desk) -> Mapping[str, CFunction]:
    """The C function of each of these methods of a class, given the type of its memory."""
    start = getattr(kind, "start", None) or _without(memory)
    return {name: _function(kind, memory, desk, start, getattr(kind, name)) for name in methods}


def address_in(function: Any) -> int:
    """The address of a `CFunction` or of a function of ctypes."""
    found = getattr(function, "address", None) or ctypes.cast(function, ctypes.c_void_p).value
    return int(found or 0)


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a method, or a function that it calls, to machine code; strict IEEE arithmetic.

    The methods are those of a law or an estimator. It is compiled where it is flown, in about a second. It
    may make no arrays: vectors are tuples of three floats, and the functions of `autopilot.geometry.linear`
    reckon with them.
    """
    if numba.config.DISABLE_JIT:
        return function
    compiled: Callable[P, T] = update_wrapper(Kernel(function, lambda _: NullCache()), function)
    return compiled


def _without(memory: type) -> Any:
    @kernel
    def start(own: Any, now: Any) -> Any:
        return memory()

    return start


def _function(kind: Any, memory: Any, desk: Desk, start: Any, method: Any) -> CFunction:
    given, answer, own = desk
    room, remembered = desk.room(kind, memory), own + width(kind)

    @kernel
    def entry(address: Any) -> None:
        numbers = numbers_at(address, room)
        now = unpack(given, numbers, 0)
        made = unpack(kind, numbers, own)
        if now.begins:
            pack(start(made, now), numbers, remembered)
        after, answered = method(made, unpack(memory, numbers, remembered), now)
        pack(after, numbers, remembered)
        pack(answered, numbers, answer)

    return c_function(entry)
