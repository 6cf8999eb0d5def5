"""Tests see the product as its users do: no private names, no sources loaded or listed by their path.

A name that begins with one underscore may change with any edit; a test that depends on it tests how something
is done. What a test needs is either reached through the public interface or deserves a public name. Source
files are found by importing their modules: a list of paths goes stale when a file moves.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("autopilot", "sitl", "gcs", "missions")

NAMED_TUPLE = {
    "_replace",
    "_asdict",
    "_fields",
    "_make",
    "_field_defaults",
}  # public, in spite of their names
# private names that tests use, by file, each with the reason
EXCEPTIONS = {
    ("tests/clients/programs/mavsdk_flight.py", "_exit"): "a program that is not taken apart at its end",
    ("tests/clients/programs/dronekit_flight.py", "_master"): "DroneKit has no mode names for PX4",
    ("tests/wire/test_tlog.py", "_timestamp"): "where pymavlink puts the time of a record",
}
# tests whose subject is the set of source files
ABOUT_SOURCES = ("tests/architecture/", "tests/gcs/batch/test_closure.py")
LOADERS = {"spec_from_file_location", "SourceFileLoader", "run_path"}
BY_STRING = {"getattr", "setattr", "delattr", "hasattr", "object", "patch"}  # also of monkeypatch and mock


def is_private(name: str) -> bool:
    """Whether the name has one leading underscore; a name with two belongs to the language."""
    return name.startswith("_") and not name.startswith("__") and name not in NAMED_TUPLE


def called_name(call: ast.Call) -> str:
    """`setattr` of both `setattr(...)` and `monkeypatch.setattr(...)`."""
    function = call.func
    return getattr(function, "attr", "") or getattr(function, "id", "")


def own_names(tree: ast.AST) -> set[str]:
    """The names that the classes of a file define themselves: methods, attributes of the class and of
    `self`."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            for inner in ast.walk(node):
                if isinstance(inner, ast.FunctionDef):
                    found.add(inner.name)
                elif isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Store):
                    found.add(inner.id)
                elif isinstance(inner, ast.Attribute) and isinstance(inner.ctx, ast.Store) and of_self(inner):
                    found.add(inner.attr)
    return found


def of_self(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")


def private_names(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """(line, name) of every private name that the file does not define itself."""
    own = own_names(tree)
    for node in ast.walk(tree):
        names: list[str] = []
        match node:
            case ast.Attribute(attr=name) if not (of_self(node) and name in own):
                names = [name]
            case ast.ImportFrom(module=module, names=aliases):
                if (module or "").partition(".")[0] in (*ROOMS, "tests"):
                    names = [*(module or "").split("."), *(alias.name for alias in aliases)]
            case ast.Import(names=aliases):
                dotted = [alias.name for alias in aliases if alias.name.partition(".")[0] in ROOMS]
                names = [part for name in dotted for part in name.split(".")]
            case ast.Call(args=arguments) if called_name(node) in BY_STRING:
                texts = [
                    a.value for a in arguments if isinstance(a, ast.Constant) and isinstance(a.value, str)
                ]
                names = [part for text in texts[:1] for part in text.split(".")]
        yield from ((getattr(node, "lineno", 0), name) for name in names if is_private(name))


def places(tree: ast.AST, sources: frozenset[str]) -> Iterator[tuple[int, str]]:
    """(line, what) of every source that is loaded by its path, and of every path of a source of the
    product."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) if name in LOADERS:
                yield node.lineno, name
            case ast.Constant(value=str(text)) if text.endswith(".py") and "/" in text:
                if any(source == text or source.endswith("/" + text) for source in sources):
                    yield node.lineno, text


def product_sources(root: Path) -> frozenset[str]:
    """Paths of the product's source files, from the root."""
    return frozenset(str(p.relative_to(root)) for room in ROOMS for p in (root / room).rglob("[!_]*.py"))


@cache
def offences(root: Path) -> list[tuple[str, int, str]]:
    """(file, line, name) of all that the tests should not know."""
    sources, found = product_sources(root), []
    for path in sorted((root / "tests").rglob("*.py")):
        file, tree = str(path.relative_to(root)), ast.parse(path.read_text(encoding="utf-8"), str(path))
        found += [(file, line, name) for line, name in private_names(tree)]
        if not file.startswith(ABOUT_SOURCES):
            found += [(file, line, name) for line, name in places(tree, sources)]
    return found


def test_no_test_knows_what_is_private() -> None:
    wrong = [o for o in offences(ROOT) if (o[0], o[2]) not in EXCEPTIONS]
    assert not wrong, "private names in tests:\n" + "\n".join(
        f"{f}:{line}: {name}" for f, line, name in wrong
    )


def test_no_exception_outlives_its_reason() -> None:
    met = {(file, name) for file, _, name in offences(ROOT)}
    assert sorted(set(EXCEPTIONS) - met) == [], "no longer needed: take them off the list"


BAD = {
    "attribute": ("autopilot._state", "_state"),
    "of something of ours": ("class A:\n    def f(self):\n        return self.onboard._state", "_state"),
    "inherited": ("class A(HilSimulator):\n    def f(self):\n        return self._core", "_core"),
    "of our own name": ("class A:\n    def __init__(self):\n        self._x = 1\nother._x", "_x"),
    "imported": ("from autopilot.supervisor.requests import decide, _modes", "_modes"),
    "module": ("from gcs._old import fly", "_old"),
    "dotted module": ("import sitl._core", "_core"),
    "patched": ("monkeypatch.setattr(status, '_LISTEN_S', 0.3)", "_LISTEN_S"),
    "patched by path": ("mock.patch('gcs.commands.status._LISTEN_S', 0.3)", "_LISTEN_S"),
    "patched object": ("patch.object(status, '_LISTEN_S', 0.3)", "_LISTEN_S"),
    "fetched": ("getattr(onboard, '_state')", "_state"),
    "set": ("onboard._options = None", "_options"),
    "loaded by place": (
        "spec = importlib.util.spec_from_file_location('x', path)",
        "spec_from_file_location",
    ),
    "listed": ("FILES = ('control/mixer.py',)", "control/mixer.py"),
    "listed whole": ("FILES = ('autopilot/control/mixer.py',)", "autopilot/control/mixer.py"),
}
GOOD = """
from autopilot.control import mixer
import gcs.cli

class Double:
    _count = 0

    def __init__(self):
        self._heard = []

    def _note(self):
        self._heard.append(self._count)

    def note(self):
        self._note()

view = view._replace(x=1)
name = record.__class__.__name__
monkeypatch.setattr(status, "LISTEN_S", 0.3)
script = "clients/fly.py"
_local = 3
print(_local)
"""


def sample(root: Path, text: str) -> list[tuple[str, int, str]]:
    for name, content in {"autopilot/control/mixer.py": "", "tests/room/test_it.py": text}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(content, encoding="utf-8")
    return offences(root)


@pytest.mark.parametrize("name", BAD)
def test_a_private_name_is_caught(name: str, tmp_path: Path) -> None:
    text, found = BAD[name]
    assert [(file, what) for file, _, what in sample(tmp_path, text)] == [("tests/room/test_it.py", found)]


def test_what_is_public_or_its_own_is_let_pass(tmp_path: Path) -> None:
    assert sample(tmp_path, GOOD) == []
