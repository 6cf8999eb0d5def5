"""Plain-Python copies of the laws, made from their source text, which may be altered before it is run.

The modules of a law are found by their imports; no test lists files.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

ROOM = "autopilot.control"
JIT_IMPORT = "from autopilot.geometry.kernel import kernel"


def text_of(module: str) -> str:
    """Source text of a module."""
    spec = find_spec(module)
    assert spec is not None and spec.origin is not None, module
    return Path(spec.origin).read_text(encoding="utf-8")


def sources(*roots: ModuleType, without: Collection[str] = ()) -> dict[str, str]:
    """Source texts, by module, of these laws and of all compiled modules of the room that they import, except
    those of `without`. A module comes after the modules that it imports."""
    found: dict[str, str] = {}

    def visit(module: str) -> None:
        if module in found or module in without:
            return
        text = text_of(module)
        if JIT_IMPORT not in text:  # records, which are not compiled
            return
        for node in ast.parse(text).body:
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(ROOM + "."):
                visit(str(node.module))
        found[module] = text

    for root in roots:
        visit(root.__name__)
    return found


def plain_laws(texts: dict[str, str]) -> SimpleNamespace:
    """The laws of these source texts, by module, as plain Python, not compiled; all their names in one
    namespace, and the modules by name as `modules`."""
    namespace = SimpleNamespace()
    kept, modules = {}, {}
    try:
        for name, text in texts.items():
            assert JIT_IMPORT in text
            module = modules[name] = ModuleType(name)
            kept[name] = sys.modules.get(name)
            sys.modules[name] = module
            plain = text.replace(JIT_IMPORT, "kernel = lambda function: function")
            exec(compile(plain, name, "exec"), module.__dict__)
            vars(namespace).update(vars(module))
    finally:
        for name, module_kept in kept.items():
            if module_kept is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module_kept
    namespace.modules = modules
    return namespace


@contextmanager
def with_function(laws: SimpleNamespace, module: str, function: ast.FunctionDef) -> Iterator[None]:
    """Replace the function of the same name in the plain laws by this one, in all modules that use it."""
    original = vars(laws.modules[module])[function.name]
    made: dict[str, Any] = {}
    source = ast.Module([function], [])
    exec(compile(source, module, "exec"), vars(laws.modules[module]), made)
    users = [scope for scope in (laws, *laws.modules.values()) if vars(scope).get(function.name) is original]
    try:
        for scope in users:
            setattr(scope, function.name, made[function.name])
        yield
    finally:
        for scope in users:
            setattr(scope, function.name, original)
