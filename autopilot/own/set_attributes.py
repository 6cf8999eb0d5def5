"""Attributes of a class that were set after it was defined: a process that reads its file lacks them."""

from __future__ import annotations

import ast
import sys
import textwrap
from collections.abc import Iterator
from inspect import getsource
from typing import Any


def attributes_set_since(kind: type) -> list[str]:
    """The attributes, with the name of the class that has each, whose value is not that in the source file.

    Functions are not compared, nor values that the source does not determine.
    """
    return [
        f"{one.__name__}.{name}"
        for one in kind.__mro__
        if one.__module__ != "builtins"
        for name in _set_since(one)
    ]


def _set_since(kind: type) -> Iterator[str]:
    try:
        body = ast.parse(textwrap.dedent(getsource(kind))).body[0]
    except (OSError, TypeError, SyntaxError):
        return
    if not isinstance(body, ast.ClassDef):
        return
    # what each attribute that is assigned in the body prints as; None if that cannot be said
    written: dict[str, str | None] = {
        node.id: None
        for node in ast.walk(body)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }
    names, values = vars(sys.modules[kind.__module__]), dict[str, Any]()
    for statement in body.body:
        for name, expression in _assignments(statement):
            written[name] = _evaluate(name, expression, names, values)
    for name, value in vars(kind).items():
        if name.startswith("__") or callable(value) or hasattr(value, "__get__"):
            continue
        if name not in written:
            if not name.startswith("_"):  # NamedTuple and ABC set such ones
                yield name
        elif written[name] not in (None, repr(value)):
            yield name


def _assignments(statement: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    if isinstance(statement, ast.Assign):
        targets, value = statement.targets, statement.value
    elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
        targets, value = [statement.target], statement.value
    else:
        return
    for target in targets:
        if isinstance(target, ast.Name):
            yield target.id, value


def _evaluate(name: str, expression: ast.expr, names: dict[str, Any], values: dict[str, Any]) -> str | None:
    """What the value of an expression prints as; None if it fails, or is another each time. The expressions
    that follow find it in `values`."""
    code = compile(ast.Expression(expression), "<class>", "eval")
    try:
        values[name] = eval(code, names, values)
        first, second = repr(values[name]), repr(eval(code, names, values))
    except Exception:  # of any kind, by the user's code
        return None
    return first if first == second else None
