"""Every row of a table has as many cells as its heading: cells in excess would not be drawn."""

from __future__ import annotations

import re
from itertools import groupby
from pathlib import Path

import pytest

from tests.doubles.pages import PAGES

_BORDER = re.compile(r"(?<!\\)\|")


def tables(text: str) -> list[list[tuple[int, int]]]:
    """The rows of each table, as (line, number of cells)."""
    lines = re.sub(r"^```.*?^```", lambda block: "\n" * block[0].count("\n"), text, flags=re.M | re.S)
    rows = [
        (number, len(_BORDER.findall(line)) - 1 if line.startswith("|") else 0)
        for number, line in enumerate(lines.splitlines(), 1)
    ]
    return [list(table) for is_table, table in groupby(rows, key=lambda row: row[1] > 0) if is_table]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_rows_are_as_wide_as_their_heading(page: Path) -> None:
    for table in tables(page.read_text(encoding="utf-8")):
        width = table[0][1]
        assert [line for line, cells in table if cells != width] == []


def test_a_wide_row_is_found() -> None:
    assert tables("| a | b |\n|---|---|\n| 1 | 2 \\| 3 |\n\n```\n| x |\n```\n| a |\n| 1 | 2 |\n") == [
        [(1, 2), (2, 2), (3, 2)],
        [(8, 1), (9, 2)],
    ]
