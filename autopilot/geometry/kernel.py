"""How every kernel is compiled, by one process at a time, and how its machine code is found again.

numba keys its disk cache by the file of the *outermost* function alone: after a change in a callee, or of a
constant from another module, it would go on serving the old machine code. Kernels are therefore kept where
`autopilot.geometry.machine_code` says, by the content of all that their source file imports.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from functools import update_wrapper
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from numba.core import caching, config, event
from numba.extending import register_jitable

from autopilot.geometry.compiler import Kernel
from autopilot.geometry.jitable import register_with
from autopilot.geometry.machine_code import ROOT, folder_of, note_use, sources_hash

_LONGEST_S = 600.0  # that another process is waited for; then we compile what it does not deliver

_ADDRESS = re.compile(r" at 0x[0-9a-f]+")  # of a function that is an argument

P = ParamSpec("P")
T = TypeVar("T")


def _is_ours(file: str) -> bool:
    return Path(file).resolve().is_relative_to(ROOT)


class _ContentLocator:
    """Tells numba where the machine code of a function is kept: by the content of its sources alone.

    numba's own locators put the directory of the source file into the name: every clone would compile anew.
    """

    def __init__(self, function: Any, file: str) -> None:
        self._path = Path(file)
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, function: Any, file: str) -> _ContentLocator | None:
        """A locator of a function of this project; None for any other, and where nothing can be written."""
        if not Path(file).is_file() or not _is_ours(file):
            return None
        locator = cls(function, file)
        try:
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator

    def ensure_cache_path(self) -> None:
        """Make the directory."""
        path = self.get_cache_path()
        path.mkdir(parents=True, exist_ok=True)
        note_use(path.parent)

    def get_cache_path(self) -> Path:
        """Directory of the machine code."""
        return folder_of(self._path) / self._path.stem

    def get_source_stamp(self) -> str:
        """What must be unchanged for the machine code to be valid."""
        return sources_hash(self._path)

    def get_disambiguator(self) -> str:
        """Tells functions of one name in one file apart."""
        return str(self._line)


caching.CacheImpl._locator_classes.insert(0, _ContentLocator)

# whose compilation goes on here and its lock, outermost first; None where no lock could be had
_held: list[tuple[_SharedCache, Any]] = []


class _SharedCache(caching.FunctionCache):
    """numba's disk cache, shared by processes that compile at the same time.

    Whoever misses a function compiles it under a lock; who misses it meanwhile waits, and loads. As a
    function is locked before what it calls, no two processes can wait for each other. The index of a function
    is written under a lock too: of two processes that add to it at once, numba would lose the entry of one,
    or serve its machine code for the other's.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compile result, loaded; None: the caller must compile it, and holds the lock."""
        found = self._load(sig, target_context)
        if found is not None:
            return found
        types = hashlib.sha256(_ADDRESS.sub("", str(sig)).encode()).hexdigest()[:16]
        lock = self._lock(f"{self._impl.filename_base}-{types}")
        found = self._load(sig, target_context)
        if found is None:
            _held.append((self, lock))
        elif lock is not None:
            lock.release()
        return found

    def _load(self, sig: Any, target_context: Any) -> Any:
        try:
            # numba would first load all that it can compile with, which takes longer than most kernels do
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except (AttributeError, ImportError):
            # an index that names types which are no longer where they were
            index = self._lock("index")
            self.flush()
            if index is not None:
                index.release()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compile result, and let others have it."""
        index = self._lock("index")
        try:
            super().save_overload(sig, data)
        finally:
            if index is not None:
                index.release()
            _release(self)

    def _lock(self, name: str) -> Any:
        from filelock import FileLock, Timeout

        lock = FileLock(Path(self._cache_path) / f"{name}.lock", timeout=_LONGEST_S, is_singleton=True)
        try:
            lock.acquire()
        except (OSError, Timeout):
            return None
        return lock


def _cache_of(function: Any) -> Any:
    """The cache of a kernel: of this project none but ours, which keeps nothing where nothing can be written.
    numba would keep it beside the sources, and go on serving it after these have changed."""
    file = function.__code__.co_filename
    if _is_ours(file) and _ContentLocator.from_function(function, file) is None:
        return caching.NullCache()
    return _SharedCache(function)


def _release(cache: Any) -> None:
    """Give up the lock on the function with this cache, the innermost one that is being compiled."""
    if _held and _held[-1][0] is cache:
        lock = _held.pop()[1]
        if lock is not None:
            lock.release()


class _Failures(event.Listener):
    """Gives up the lock on a function that cannot be compiled for these types; numba then tries others."""

    def on_start(self, event: Any) -> None:
        """Nothing yet."""

    def on_end(self, event: Any) -> None:
        """Compiled, or not."""
        dispatcher = event.data["dispatcher"]
        if tuple(event.data["args"]) not in dispatcher.overloads:
            _release(dispatcher._cache)


event.register("numba:compile", _Failures())
register_with(register_jitable)


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile `function` to machine code with strict IEEE arithmetic and a disk cache.

    Fast-math stays off, so that CPython and machine code agree to the bit. Division by zero gives inf or nan
    as IEEE 754 says, in place of an exception. A kernel makes no arrays: it writes those that it is given.
    """
    if config.DISABLE_JIT:
        return function
    compiled: Callable[P, T] = update_wrapper(Kernel(function, _cache_of), function)
    return compiled


def threaded(function: Callable[P, T]) -> Callable[P, T]:
    """A kernel that lets other threads run while it does, for one that works for long at each call.

    It must not fly flights in lanes: of what notes that these part there is one for all threads.
    """
    if config.DISABLE_JIT:
        return function
    compiled: Callable[P, T] = update_wrapper(Kernel(function, _cache_of, nogil=True), function)
    return compiled
