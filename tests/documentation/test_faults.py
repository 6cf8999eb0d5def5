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


def test_each_row_has_a_test_that_exists() -> None:
    there = {
        node.name
        for path in (ROOT / "tests").rglob("test_*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }
    for what, promised, named in rows():
        assert promised, what
        tests = re.findall(r"`(test_\w+)`", named)
        assert set(tests) <= there, f"{what}: {set(tests) - there}"
        assert tests or named == "the same" or what in WITHOUT, what
