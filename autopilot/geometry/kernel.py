"""How every kernel is compiled, by one process at a time, and how its machine code is found again.

numba keys its disk cache only by the file of the *outermost* function: after a change in a callee, or of a
constant from another module, it would still load the old machine code. Kernels are therefore stored in the
folder given by `autopilot.geometry.machine_code`, keyed by the content of all that their source file imports.
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
from autopilot.geometry.machine_code import ROOT, kernel_folder, record_use, sources_hash

_MAX_LOCK_WAIT_S = 600.0  # longest wait for another process; then this process compiles the kernel itself

_ADDRESS = re.compile(r" at 0x[0-9a-f]+")  # the address of a function that is an argument

P = ParamSpec("P")
T = TypeVar("T")


def _is_project_file(file: str) -> bool:
    return Path(file).resolve().is_relative_to(ROOT)


class _ContentLocator:
    """Tells numba where the machine code of a function is stored: keyed only by the content of its sources.

    numba's own locators put the directory of the source file into the key: every clone would compile again.
    """

    def __init__(self, function: Any, file: str) -> None:
        self._path = Path(file)
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, function: Any, file: str) -> _ContentLocator | None:
        """A locator for a function of this project; None for others, and if the cache cannot be written."""
        if not Path(file).is_file() or not _is_project_file(file):
            return None
        locator = cls(function, file)
        try:
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator

    def ensure_cache_path(self) -> None:
        """Create the directory, and note that it is used."""
        path = self.get_cache_path()
        path.mkdir(parents=True, exist_ok=True)
        record_use(path.parent)

    def get_cache_path(self) -> Path:
        """Directory of the machine code."""
        return kernel_folder(self._path) / self._path.stem

    def get_source_stamp(self) -> str:
        """What must be unchanged for the machine code to be valid."""
        return sources_hash(self._path)

    def get_disambiguator(self) -> str:
        """Distinguishes functions of the same name in one file."""
        return str(self._line)


caching.CacheImpl._locator_classes.insert(0, _ContentLocator)

# caches of the functions being compiled in this process, outermost first, and their locks (None: no lock)
_compiling: list[tuple[_SharedCache, Any]] = []


class _SharedCache(caching.FunctionCache):
    """numba's disk cache, shared by processes that compile at the same time.

    The first process that does not find a function compiles it under a lock; others that need it meanwhile
    wait, and load it. Because a function is locked before the functions that it calls, no two processes can
    wait for each other. The index of a function is written under a lock too: if two processes added to it at
    the same time, numba would lose the entry of one, or load its machine code for the other's.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compile result, loaded; None: the caller must compile it, and this process holds the lock."""
        found = self._load(sig, target_context)
        if found is not None:
            return found
        types = hashlib.sha256(_ADDRESS.sub("", str(sig)).encode()).hexdigest()[:16]
        lock = self._lock(f"{self._impl.filename_base}-{types}")
        found = self._load(sig, target_context)
        if found is None:
            _compiling.append((self, lock))
        elif lock is not None:
            lock.release()
        return found

    def _load(self, sig: Any, target_context: Any) -> Any:
        try:
            # numba would first load all parts of its compiler, which takes longer than most kernels
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except (AttributeError, ImportError):
            # the index names types that have since been moved
            index = self._lock("index")
            self.flush()
            if index is not None:
                index.release()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store a compile result, and release the lock so that other processes can load it."""
        index = self._lock("index")
        try:
            super().save_overload(sig, data)
        finally:
            if index is not None:
                index.release()
            _release(self)

    def _lock(self, name: str) -> Any:
        from filelock import FileLock, Timeout

        lock = FileLock(Path(self._cache_path) / f"{name}.lock", timeout=_MAX_LOCK_WAIT_S, is_singleton=True)
        try:
            lock.acquire()
        except (OSError, Timeout):
            return None
        return lock


def _cache_of(function: Any) -> Any:
    """The cache of a kernel: for kernels of this project only the cache by content, or none where it cannot
    be written. numba would store them beside the sources, and load them even after a change of these."""
    file = function.__code__.co_filename
    if _is_project_file(file) and _ContentLocator.from_function(function, file) is None:
        return caching.NullCache()
    return _SharedCache(function)


def _release(cache: Any) -> None:
    """Release the lock on the function with this cache if it is the innermost one being compiled."""
    if _compiling and _compiling[-1][0] is cache:
        lock = _compiling.pop()[1]
        if lock is not None:
            lock.release()


class _FailureListener(event.Listener):
    """Releases the lock on a function that cannot be compiled for these types; numba then tries others."""

    def on_start(self, event: Any) -> None:
        """Do nothing yet."""

    def on_end(self, event: Any) -> None:
        """Release the lock if the compilation failed."""
        dispatcher = event.data["dispatcher"]
        if tuple(event.data["args"]) not in dispatcher.overloads:
            _release(dispatcher._cache)


event.register("numba:compile", _FailureListener())
register_with(register_jitable)


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile `function` to machine code with strict IEEE arithmetic and a disk cache.

    Fast-math stays off, so that CPython and machine code agree to the bit. Division by zero gives inf or nan
    as IEEE 754 says, instead of an exception. A kernel creates no arrays: it writes to those it is given.
    """
    if config.DISABLE_JIT:
        return function
    compiled: Callable[P, T] = update_wrapper(Kernel(function, _cache_of), function)
    return compiled


def nogil_kernel(function: Callable[P, T]) -> Callable[P, T]:
    """A kernel that lets other threads run meanwhile (it releases the GIL), for kernels with long calls.

    It must not fly flights in lanes: all threads share one record of the lanes that have diverged.
    """
    if config.DISABLE_JIT:
        return function
    compiled: Callable[P, T] = update_wrapper(Kernel(function, _cache_of, nogil=True), function)
    return compiled
