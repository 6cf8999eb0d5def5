"""Reverses every sign of a source text, one at a time, and finds the reversals that no proof detects."""

from __future__ import annotations

import ast
import sys
from collections import Counter
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
    """Every altered form of one of the module's functions, with a name that says what was altered; until the
    next one is asked for, the function itself has this form."""
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    for function in functions:
        for node in list(ast.walk(function)):
            sites: list[Any] = []
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
                sites = ["left", "right"]
            elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
                sites = ["operand"]
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                sites = list(TERMS.get(node.func.id, ()))
            # a list of terms, and the place of one of them in it
            terms: Any = node.args if isinstance(node, ast.Call) else vars(node)
            for site in sites:
                name, right = f"{function.name}: {ast.unparse(node)} [{site}]", terms[site]
                terms[site] = negated(right)
                yield name, function
                terms[site] = right


def fails(proof: Any, laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> bool:
    try:
        proof(laws, model, vehicle)
    except (AssertionError, ArithmeticError, ValueError, IndexError):
        return True
    return False


def called(proof: Any, laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> Counter[Any]:
    """How often a proof calls each function, by module and name: flips of others cannot make it fail."""
    found: Counter[Any] = Counter()

    def note(frame: Any, event: str, _: Any) -> None:
        if event == "call":
            found[frame.f_code.co_filename, frame.f_code.co_name] += 1

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
    is tried first, then short ones before long ones."""
    laws = plain_laws(texts)
    order = [(proof, called(proof, laws, model, vehicle)) for proof in proofs]
    order.sort(key=lambda one: one[1].total())
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
