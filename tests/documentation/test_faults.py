"""docs/faults.md: each test that it names exists, and each row names one, except rows that need none."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "faults.md"
WITHOUT = {"the winch jams", "the battery is empty"}  # not simulated, or nothing follows


def rows() -> list[list[str]]:
    """The cells of each row of each table, without the headings."""
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    return [row for row in cells if row[2] not in ("test", "---")]


def defined_among(names: set[str]) -> set[str]:
    """Those of the names that a test has; only files in which one is defined are parsed."""
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py")]
    defined = re.compile(rf"\bdef +({'|'.join(sorted(names))})\b")
    return {
        node.name
        for text in texts
        if defined.search(text)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef) and node.name in names
    }


def test_each_row_has_a_test_that_exists() -> None:
    of_row = [(what, promised, named, re.findall(r"`(test_\w+)`", named)) for what, promised, named in rows()]
    there = defined_among({name for *_, tests in of_row for name in tests})
    for what, promised, named, tests in of_row:
        assert promised, what
        assert set(tests) <= there, f"{what}: {set(tests) - there}"
        assert tests or named == "the same" or what in WITHOUT, what
