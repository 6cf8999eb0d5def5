"""Where the machine code of kernels is kept, and whether all of it is there; without numba, which is heavy.

A directory is named by a hash over a source file and all files of this project that it imports, directly or
not, so that a stale entry cannot be met and a change recompiles only what it can reach. Where the checkout
lies does not enter the hash: a second clone of the same source finds the machine code of the first.

Once a program has compiled all that a flight needs it leaves a mark (`mark_ready`), by which the next one
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
from tempfile import NamedTemporaryFile

from platformdirs import user_cache_path

ROOT = Path(__file__).resolve().parents[2]
_DAY_S = 86400.0
KEPT_S = 90.0 * _DAY_S  # that machine code is kept without being used
_MARKS = "ready"
CHOSEN_BY_USER = os.environ.get("NUMBA_CACHE_DIR", "")
# it begins with letters, which are found fast: what is found in a text too does no harm
_IMPORT = re.compile(
    rb"from[ \t]+((?:autopilot|sitl|missions|gcs|plumbline)[\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)"
)
_NAME = re.compile(rb"\w+")
_CPU_INFO = Path("/proc/cpuinfo")
_CPU_FIELDS = ("model name", "flags", "Features", "CPU implementer", "CPU part")


@cache
def _source(path: Path) -> bytes:
    return path.read_bytes()


@cache
def _digest(path: Path) -> bytes:
    return hashlib.sha256(_source(path)).digest()


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
def sources_hash(path: Path, root: Path = ROOT) -> str:
    """Hash of a source file and of all files of the project at `root` that it imports, directly or not."""
    seen, ahead = {path}, [path]
    while ahead:
        fresh = _imported(ahead.pop(), root) - seen
        seen |= fresh
        ahead += fresh
    digest = hashlib.sha256()
    for name, file in sorted((os.path.relpath(file, root), file) for file in seen):
        digest.update(name.encode() + b"\0" + _digest(file))
    return digest.hexdigest()[:16]


def _kernels() -> Path:
    return user_cache_path("plumbline") / "kernels"


def folder_of(path: Path) -> Path:
    """Where the machine code of the kernels in this source file is kept."""
    return _kernels() / sources_hash(path)


@cache
def note_use(folder: Path) -> None:
    """Remember, once a program, that what is kept in this folder is used."""
    with suppress(OSError):
        os.utime(folder)


def drop_unused(now_s: float) -> None:
    """Delete what has not been used for so long: most of it is of sources that have changed since.

    `now_s` is of the clock by which files are dated. A mark goes before what it promises, which is kept a
    day longer: no flight finds a mark without the code.
    """
    with suppress(OSError):
        for mark in (_kernels() / _MARKS).iterdir():
            if now_s - mark.stat().st_mtime > KEPT_S:
                mark.unlink()
        for folder in _kernels().iterdir():
            if folder.name != _MARKS and now_s - folder.stat().st_mtime > KEPT_S + _DAY_S:
                shutil.rmtree(folder, ignore_errors=True)


@cache
def _machine() -> str:
    """What machine code depends on beside its sources: processor, interpreter and compiler."""
    known = [platform.machine(), platform.python_version(), version("numba"), version("llvmlite")]
    known += [os.environ.get(name, "") for name in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_OPT")]
    with suppress(OSError):
        lines = (line.partition(":") for line in _CPU_INFO.read_text().partition("\n\n")[0].splitlines())
        known += [value.strip() for name, _, value in lines if name.strip() in _CPU_FIELDS]
    return hashlib.sha256("\0".join(known).encode()).hexdigest()[:16]


def _marks() -> Path:
    return (Path(CHOSEN_BY_USER) if CHOSEN_BY_USER else _kernels()) / _MARKS


def _mark(source: Path, part: str) -> Path:
    return _marks() / f"{sources_hash(source)}-{_machine()}-{part}"


def why_not_kept() -> str:
    """Why machine code cannot be kept, so that each program compiles anew; empty where it can."""
    try:
        _marks().mkdir(parents=True, exist_ok=True)
        with NamedTemporaryFile(dir=_marks()):
            return ""
    except OSError as error:
        return f"{_marks().parent}: {error.strerror}"


def is_ready(source: Path, parts: Iterable[str]) -> bool:
    """True if all kernels of these parts are there, or none is ever compiled; `source` imports them all."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return True
    return all(is_marked(source, part) for part in parts)


def is_marked(source: Path, part: str) -> bool:
    """True if `mark_ready` was called for this part with these very sources, on this machine."""
    mark = _mark(source, part)
    if not mark.is_file():
        return False
    with suppress(OSError):
        os.utime(mark)
    return True


def mark_ready(source: Path, parts: Iterable[str]) -> None:
    """Say so; where nothing can be written, the next program will look again."""
    with suppress(OSError):
        for part in parts:
            mark = _mark(source, part)
            mark.parent.mkdir(parents=True, exist_ok=True)
            mark.touch()
