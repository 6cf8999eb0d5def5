"""Reverses every sign of a source text, one at a time, and finds the reversals that no proof detects."""

from __future__ import annotations

import ast
import copy
import sys
from collections.abc import Collection, Iterator
from types import SimpleNamespace
from typing import Any

from autopilot.control.records import Vehicle
from tests.control.plain_laws import plain_laws, with_function

NEGATE = "(lambda v: tuple(-c for c in v) if isinstance(v, tuple) else -v)({})"
# positions of the terms of these calls: each term may have the wrong sign
TERMS = {"add": (0, 1), "sub": (0, 1), "add3": (0, 1, 2), "axpy": (0, 2), "scale": (0,), "cross": (0,)}


def negated(node: ast.expr) -> ast.expr:
    return ast.parse(NEGATE.format(ast.unparse(node)), mode="eval").body


def flips(tree: ast.Module) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Every altered copy of one of the module's functions, with a name that says what was altered."""
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    for function in functions:
        for index, node in enumerate(ast.walk(function)):
            sites: list[Any] = []
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
                sites = ["left", "right"]
            elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
                sites = ["operand"]
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                sites = list(TERMS.get(node.func.id, ()))
            for site in sites:
                altered = copy.deepcopy(function)
                twin: Any = list(ast.walk(altered))[index]
                if isinstance(site, int):
                    twin.args[site] = negated(twin.args[site])
                else:
                    setattr(twin, site, negated(getattr(twin, site)))
                yield f"{function.name}: {ast.unparse(node)} [{site}]", ast.fix_missing_locations(altered)


def fails(proof: Any, laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> bool:
    try:
        proof(laws, model, vehicle)
    except (AssertionError, ArithmeticError, ValueError, IndexError):
        return True
    return False


def called(proof: Any, laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> set[Any]:
    """Module and name of each function that a proof calls: flips of others cannot make it fail."""
    found = set()

    def note(frame: Any, event: str, _: Any) -> None:
        if event == "call":
            found.add((frame.f_code.co_filename, frame.f_code.co_name))

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        proof(laws, model, vehicle)
    finally:
        sys.setprofile(before)
    return found


def surviving(
    texts: dict[str, str],
    proofs: tuple[Any, ...],
    harmless: Collection[str],
    model: SimpleNamespace,
    vehicle: Vehicle,
) -> tuple[list[str], int]:
    """Flips that no proof detects, and the number of flips tried. The proof that detected the previous flip
    is tried first."""
    laws = plain_laws(texts)
    order = [(proof, called(proof, laws, model, vehicle)) for proof in proofs]
    survivors, count, spared = [], 0, set()
    for module, text in texts.items():
        for name, altered in flips(ast.parse(text)):
            if f"{module}: {name}" in harmless:
                spared.add(f"{module}: {name}")
                continue
            count += 1
            with with_function(laws, module, altered):
                for k, (proof, reached) in enumerate(order):
                    if (module, altered.name) in reached and fails(proof, laws, model, vehicle):
                        order.insert(0, order.pop(k))
                        break
                else:
                    survivors.append(f"{module}: {name}")
    assert spared == set(harmless), f"no such flips: {set(harmless) - spared}"
    return survivors, count
