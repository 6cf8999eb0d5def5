"""How every kernel is compiled, and where its machine code is kept.

numba keys its disk cache by the file of the *outermost* function alone: after a change in a callee, or of a
constant from another module, it would go on serving the old machine code. Kernels are therefore kept in a
directory named by a hash over their own source file and all files of this project that it imports, directly
or not, so that a stale entry cannot be met and a change recompiles only what it can reach. Where the checkout
lies does not enter the hash: a second clone of the same source finds the machine code of the first.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable
from functools import cache, update_wrapper
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from numba.core import caching, config
from platformdirs import user_cache_path

from autopilot.geometry.compiler import Kernel

_ROOT = Path(__file__).resolve().parents[2]
_IMPORT = re.compile(
    rb"^\s*from\s+((?:autopilot|sitl|missions|gcs)[\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)", re.MULTILINE
)
_NAME = re.compile(rb"\w+")
_CHOSEN_BY_USER = "NUMBA_CACHE_DIR" in os.environ

P = ParamSpec("P")
T = TypeVar("T")


@cache
def _source(path: Path) -> bytes:
    return path.read_bytes()


@cache
def _packages(path: Path, root: Path) -> tuple[Path, ...]:
    """The files that make `path`, or what it lies in, packages of the project at `root`."""
    inside = [parent for parent in (path, *path.parents) if parent.is_relative_to(root)]
    return tuple(file for file in (parent / "__init__.py" for parent in inside) if file.is_file())


@cache
def _imported(path: Path, root: Path) -> frozenset[Path]:
    """Files below `root` that the file imports itself."""
    found: set[Path] = set()
    for module, names in _IMPORT.findall(_source(path)):
        base = root.joinpath(*module.decode().split("."))
        found.update(_packages(base, root))
        if base.is_dir():
            parts = (base / name.decode() for name in _NAME.findall(names))
            found.update(p for q in parts for p in (q.with_suffix(".py"), q / "__init__.py") if p.is_file())
        elif base.with_suffix(".py").is_file():
            found.add(base.with_suffix(".py"))
    if b"iter_modules(__path__)" in _source(path):  # a package that finds its modules by itself
        found.update(path.parent.glob("*.py"))
    return frozenset(found)


@cache
def sources_hash(path: Path, root: Path = _ROOT) -> str:
    """Hash of a source file and of all files of the project at `root` that it imports, directly or not."""
    seen, ahead = {path}, [path]
    while ahead:
        fresh = _imported(ahead.pop(), root) - seen
        seen |= fresh
        ahead += fresh
    digest = hashlib.sha256()
    for name, file in sorted((os.path.relpath(file, root), file) for file in seen):
        digest.update(name.encode() + b"\0" + _source(file) + b"\0")
    return digest.hexdigest()[:16]


def _folder(path: Path) -> Path:
    return user_cache_path("plumbline") / "kernels" / sources_hash(path)


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
        if _CHOSEN_BY_USER or not Path(file).is_file() or not Path(file).resolve().is_relative_to(_ROOT):
            return None
        locator = cls(function, file)
        try:
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator

    def ensure_cache_path(self) -> None:
        """Make the directory."""
        self.get_cache_path().mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> Path:
        """Directory of the machine code."""
        return _folder(self._path) / self._path.stem

    def get_source_stamp(self) -> str:
        """What must be unchanged for the machine code to be valid."""
        return sources_hash(self._path)

    def get_disambiguator(self) -> str:
        """Tells functions of one name in one file apart."""
        return str(self._line)


caching.CacheImpl._locator_classes.insert(0, _ContentLocator)


def is_compiled(path: Path) -> bool:
    """True if machine code of kernels in this source file is kept from an earlier run, as far as is known."""
    return _CHOSEN_BY_USER or _folder(path).is_dir()


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile `function` to machine code with strict IEEE arithmetic and a disk cache.

    Fast-math stays off, so that CPython and machine code agree to the bit. Division by zero gives inf or nan
    as IEEE 754 says, in place of an exception. A kernel makes no arrays: it writes those that it is given.
    """
    if config.DISABLE_JIT:
        return function
    compiled: Callable[P, T] = update_wrapper(Kernel(function), function)
    return compiled
