"""The proofs hold, and they are proofs: flipping any single sign of the laws makes one of them fail.

The flips are made in the source text, one at a time and all of them: every term of every sum and
difference, every factor in front of a vector, every order of a cross product. So a term added to a law
tomorrow is flipped too.
"""

from __future__ import annotations

import ast
import copy
import sys
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

from autopilot.control.records import Vehicle

NEGATE = "(lambda v: tuple(-c for c in v) if isinstance(v, tuple) else -v)({})"
# terms of these calls by position: each may stand with the wrong sign
TERMS = {"add": (0, 1), "sub": (0, 1), "add3": (0, 1, 2), "axpy": (0, 2), "scale": (0,), "cross": (0,)}

# flips that change nothing, each with the reason
HARMLESS = {
    "thesis.py: start: (0.0, 0.0, 0.0)": "minus zero",
}


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
    except (AssertionError, ArithmeticError, ValueError):
        return True
    return False


def called(proof: Any, laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> set[Any]:
    """File and name of each function that a proof calls: flips of others cannot make it fail."""
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
    harmless: Callable[[str, str], bool],
    model: SimpleNamespace,
    vehicle: Vehicle,
) -> tuple[list[str], int]:
    """Flips that no proof finds, and how many were tried. The proof that found the last is asked first."""
    laws = model.plain_laws(texts)
    order = [(proof, called(proof, laws, model, vehicle)) for proof in proofs]
    survivors, count = [], 0
    for file, text in texts.items():
        for name, altered in flips(ast.parse(text)):
            if harmless(file, name):
                continue
            count += 1
            with model.with_function(laws, file, altered):
                for k, (proof, reached) in enumerate(order):
                    if (file, altered.name) in reached and fails(proof, laws, model, vehicle):
                        order.insert(0, order.pop(k))
                        break
                else:
                    survivors.append(f"{file}: {name}")
    return survivors, count


def test_proof(proof: Any, laws: SimpleNamespace, model: SimpleNamespace, bebop: Vehicle) -> None:
    proof(laws, model, bebop)


def test_each_flip_fails_a_proof(model: SimpleNamespace, bebop: Vehicle, proofs: tuple[Any, ...]) -> None:
    def harmless(file: str, name: str) -> bool:
        return f"{file.removeprefix('control/')}: {name}" in HARMLESS

    survivors, count = surviving(model.sources(), proofs, harmless, model, bebop)
    assert not survivors, "\n".join(survivors)
    assert count > 100, f"only {count} flips were found"
