"""Which files determine what happens in a flight: all modules that the flying modules import, and their data.

The set follows from the import statements, which are read from the source without running it. A new module is
therefore part of it as soon as it is used. Imports inside functions count. A package that finds its modules
by `iter_modules` imports all of them. Any other module that is loaded by a computed name is not found: add it
to the entry points.
"""

from __future__ import annotations

import ast
import gc
import hashlib
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

PACKAGES = ("autopilot", "gcs", "missions", "sitl")  # of this project; other libraries are not followed
ROOT = Path(__file__).resolve().parents[2]

_NOT_DATA = (".py", ".pyc", ".html")  # code is found by its imports; pages are templates of reports
# the beginning of an import statement; a whole one that begins a line; one after another statement in a line
_IMPORT_START = rb"(?:from[ \t]+[\w.]+[ \t]+import\b|import[ \t])"
_IMPORT = re.compile(rb"^[ \t]*(" + _IMPORT_START + rb"(?:[^\n(\\]|\\\n|\([^)]*\))*)", re.MULTILINE)
_INLINE_IMPORT = re.compile(rb"[:;][ \t]*" + _IMPORT_START)


def fingerprint(entries: Iterable[str], root: Path = ROOT) -> str:
    """16 hexadecimal digits over the names and contents of all files in the closure of the modules `entries`.

    `root` is the directory that holds the project's packages.
    """
    digest = hashlib.sha256()
    for path in sorted(closure(entries, root)):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def closure(entries: Iterable[str], root: Path = ROOT) -> set[Path]:
    """Source files of the modules `entries` and of all modules that they import, directly or indirectly, and
    the data files of their packages."""
    pending = list(entries)
    for entry in pending:
        if _source_file(entry, root) is None:
            raise ValueError(f"{entry} is no module below {root}; must be a module of {', '.join(PACKAGES)}")
    visited: set[str] = set()
    files: set[Path] = set()
    while pending:
        module = pending.pop()
        if module in visited:
            continue
        visited.add(module)
        path = _source_file(module, root)
        if path is None:
            continue
        files.add(path)
        if path.name == "__init__.py":
            files.update(_data_files(path.parent))
        parent = module.rpartition(".")[0]  # is executed before the module
        pending += [*([parent] if parent else []), *_imports(path, module)]
    return files


def _source_file(module: str, root: Path) -> Path | None:
    """The file of a module of this project, or None if there is no such module."""
    if module.partition(".")[0] not in PACKAGES:
        return None
    base = f"{root}/{module.replace('.', '/')}"
    for file in (f"{base}/__init__.py", f"{base}.py"):
        if os.path.isfile(file):  # noqa: PTH113 - of thousands of names, most are no modules
            return Path(file)
    return None


def _data_files(package: Path) -> Iterator[Path]:
    """The data files beside the code of a package, and in its folders that contain no code."""
    for path in package.iterdir():
        if path.name.startswith(".") or path.name == "__pycache__":
            continue
        if path.is_file() and path.suffix not in _NOT_DATA:
            yield path
        elif path.is_dir() and not any(path.glob("*.py")):
            yield from _data_files(path)


def _imports(path: Path, module: str) -> Iterator[str]:
    """Every dotted name that the file imports; `from a import b` gives a and a.b, which may be a module.

    A file that calls `iter_modules` imports all modules beside it.
    """
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    names, finds_modules = _imported(path.read_bytes(), package)
    yield from names
    if finds_modules:
        yield from (f"{package}.{found.stem}" for found in sorted(path.parent.glob("*.py")))


@cache
def _imported(source: bytes, package: str) -> tuple[tuple[str, ...], bool]:
    """Dotted names that a source in this package imports, and whether it calls `iter_modules`."""
    names: list[str] = []
    with _without_collection():  # a syntax tree has many objects, none of which is garbage
        finds_modules = b"iter_modules" in source and any(
            map(_calls_iter_modules, ast.walk(ast.parse(source)))
        )
        tree = _import_statements(source)
    for node in _statements(tree):
        match node:
            case ast.Import():
                names += [alias.name for alias in node.names]
            case ast.ImportFrom():
                base = node.module or ""
                if node.level:
                    package_parts = package.split(".")
                    base = ".".join(
                        [*package_parts[: len(package_parts) - node.level + 1], *([base] if base else [])]
                    )
                names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return tuple(names), finds_modules


def _import_statements(source: bytes) -> ast.Module:
    """A syntax tree with all import statements of a source. If each of them begins a line, only these lines
    are parsed, which takes a tenth of the time. The whole source is parsed if this fails, for example because
    a text looks like an import."""
    if not _INLINE_IMPORT.search(source):
        with suppress(SyntaxError):
            return ast.parse(b"\n".join(_IMPORT.findall(source)))
    return ast.parse(source)


@contextmanager
def _without_collection() -> Iterator[None]:
    """Disable garbage collection within the context, if it was enabled."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _calls_iter_modules(node: ast.AST) -> bool:
    match node:
        case ast.Call(func=ast.Name(id="iter_modules") | ast.Attribute(attr="iter_modules")):
            return True
    return False


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """All statements of a module, nested ones too. Expressions contain none and are skipped, because they
    make up most of a tree."""
    pending = [tree]
    while pending:
        node = pending.pop()
        yield node
        for block in ("body", "orelse", "finalbody", "handlers", "cases"):
            block_statements = getattr(node, block, ())
            if isinstance(block_statements, list):  # the body of a lambda is an expression
                pending += block_statements
