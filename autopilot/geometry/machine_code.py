"""Where the machine code of kernels is stored, and whether it is complete; without numba, which loads slowly.

A directory is named by a hash over a source file and all files of this project that it imports, directly or
indirectly, so that stale code is never found and a change recompiles only what depends on it. The location of
the checkout does not enter the hash: a second clone of the same source finds the machine code of the first.

When a program has compiled all that a flight needs, it leaves a mark (`mark_ready`). From it the next program
knows (`is_ready`), before it has loaded anything, whether it will have to compile.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from tempfile import NamedTemporaryFile, TemporaryDirectory

from platformdirs import user_cache_path

ROOT = Path(__file__).resolve().parents[2]
_DAY_S = 86400.0
RETENTION_S = 90.0 * _DAY_S  # how long unused machine code is kept
_MARKS = "ready"
CACHE_VARIABLE = "NUMBA_CACHE_DIR"  # environment variable that names the folder of machine code
KEEPING_HINT = f"to keep it, let {CACHE_VARIABLE} name a folder that can be written"
_PACKAGES = ("autopilot", "sitl", "missions", "gcs", "plumbline")
# begins with literal letters, which are searched fast; matches inside a text do no harm
_IMPORT = re.compile(
    rb"from[ \t]+((?:%b)[\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)" % "|".join(_PACKAGES).encode()
)
_NAME = re.compile(rb"\w+")
_CPU_INFO = Path("/proc/cpuinfo")
_CPU_FIELDS = ("model name", "flags", "Features", "CPU implementer", "CPU part")


@cache
def _source(file: str, root: str) -> bytes:
    return Path(root, file).read_bytes()


@cache
def _digest(file: str, root: str) -> bytes:
    return hashlib.sha256(_source(file, root)).digest()


@cache
def _files(root: str) -> frozenset[str]:
    """The source files of the project at `root`, relative to it; as texts: a `Path` costs as much as ten."""
    walked = (step for package in _PACKAGES for step in os.walk(f"{root}{os.sep}{package}"))
    inside = ((os.path.relpath(folder, root), names) for folder, _, names in walked)
    return frozenset(
        f"{folder}{os.sep}{name}" for folder, names in inside for name in names if name.endswith(".py")
    )


@cache
def _module_files(module: str, root: str) -> frozenset[str]:
    """The file of a module, and the `__init__.py` files of the packages that contain it."""
    base = module.replace(".", os.sep)
    packages = (
        f"{base[:end]}{os.sep}__init__.py"
        for end, character in enumerate(base + os.sep)
        if character == os.sep
    )
    return _files(root) & {f"{base}.py", *packages}


@cache
def _imported_files(file: str, root: str) -> frozenset[str]:
    """The files below `root` that a file imports directly."""
    found: set[str] = set()
    for module, names in _IMPORT.findall(_source(file, root)):
        module_path = module.decode()
        found |= _module_files(module_path, root)
        if f"{module_path.replace('.', os.sep)}.py" not in found:  # a package: the names may be its modules
            found.update(
                *(_module_files(f"{module_path}.{name.decode()}", root) for name in _NAME.findall(names))
            )
    if b"iter_modules(__path__)" in _source(file, root):  # a package that finds its modules itself
        folder = file.rpartition(os.sep)[0]
        found.update(other for other in _files(root) if other.rpartition(os.sep)[0] == folder)
    return frozenset(found)


@cache
def sources_hash(path: Path, root: Path = ROOT) -> str:
    """Hash of a source file and all files of the project at `root` that it imports, directly or not."""
    first, top = os.path.relpath(path, root), str(root)
    visited, pending = {first}, [first]
    while pending:
        new_files = _imported_files(pending.pop(), top) - visited
        visited |= new_files
        pending += new_files
    digest = hashlib.sha256()
    for file in sorted(visited):
        digest.update(file.encode() + b"\0" + _digest(file, top))
    return digest.hexdigest()[:16]


def _kernels() -> Path:
    """The folder of all machine code, in the user's cache or in the folder that NUMBA_CACHE_DIR names."""
    named = os.environ.get(CACHE_VARIABLE)
    cache = Path(named) / "plumbline" if named else user_cache_path("plumbline")
    return cache / "kernels"


def kernel_folder(path: Path) -> Path:
    """The folder in which the machine code of the kernels in this source file is stored."""
    return _kernels() / sources_hash(path)


@cache
def record_use(folder: Path) -> None:
    """Record, once per program, that the content of this folder is in use."""
    with suppress(OSError):
        os.utime(folder)


def drop_unused(now_s: float) -> None:
    """Delete what has not been used for `RETENTION_S`: mostly code of sources that have changed since.

    `now_s` is the time of the clock that dates files. A mark is deleted before the code that it vouches for,
    which is kept a day longer: no flight finds a mark without the code.
    """
    with suppress(OSError):
        for mark in (_kernels() / _MARKS).iterdir():
            if now_s - mark.stat().st_mtime > RETENTION_S:
                mark.unlink()
        for folder in _kernels().iterdir():
            if folder.name != _MARKS and now_s - folder.stat().st_mtime > RETENTION_S + _DAY_S:
                shutil.rmtree(folder, ignore_errors=True)


@cache
def _machine() -> str:
    """Hash of what machine code depends on besides its sources: processor, interpreter and compiler."""
    known = [platform.machine(), platform.python_version(), version("numba"), version("llvmlite")]
    known += [os.environ.get(name, "") for name in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_OPT")]
    with suppress(OSError):
        lines = (line.partition(":") for line in _CPU_INFO.read_text().partition("\n\n")[0].splitlines())
        known += [value.strip() for name, _, value in lines if name.strip() in _CPU_FIELDS]
    return hashlib.sha256("\0".join(known).encode()).hexdigest()[:16]


def _marks() -> Path:
    return _kernels() / _MARKS


def _mark(source: Path, part: str) -> Path:
    return _marks() / f"{sources_hash(source)}-{_machine()}-{part}"


def storage_problem() -> str:
    """Where and why machine code cannot be stored; empty if it can be stored."""
    try:
        _marks().mkdir(parents=True, exist_ok=True)
        with NamedTemporaryFile(dir=_marks()):
            return ""
    except OSError as error:
        return f"{_marks().parent}: {error.strerror}"


_temporary_folders: list[TemporaryDirectory[str]] = []  # each is deleted when this process ends


def use_temporary_folder() -> None:
    """From now on, store the machine code of this process, and of those that it starts, in a folder that is
    deleted when this process ends."""
    _temporary_folders.append(TemporaryDirectory(prefix="plumbline-"))
    os.environ[CACHE_VARIABLE] = _temporary_folders[-1].name


def is_ready(source: Path, parts: Iterable[str]) -> bool:
    """True if all kernels of these parts are compiled, or compiling is off; `source` imports them all."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return True
    return all(is_marked(source, part) for part in parts)


def is_marked(source: Path, part: str) -> bool:
    """True if `mark_ready` was called for this part with exactly these sources, on this machine."""
    mark = _mark(source, part)
    if not mark.is_file():
        return False
    with suppress(OSError):
        os.utime(mark)
    return True


def mark_ready(source: Path, parts: Iterable[str]) -> None:
    """Mark these parts as compiled; if nothing can be written, the next program checks again."""
    with suppress(OSError):
        for part in parts:
            mark = _mark(source, part)
            mark.parent.mkdir(parents=True, exist_ok=True)
            mark.touch()
