"""docs/troubleshooting.md quotes messages of the programs; each quotation must be a text of the code."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import autopilot
import gcs
import missions
import plumbline
import sitl
from tests.doubles.pages import ROOT

PAGE = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
HEADINGS = re.findall(r"^### `(.+)`$", PAGE, re.MULTILINE)
ROOMS = (autopilot, gcs, missions, plumbline, sitl)
SHORTEST = 5  # fewest characters of a piece of a quotation that is searched for


@cache
def literals() -> str:
    """All texts of the code, those of f-strings with `\\0` where a value is inserted."""
    found = []
    for room in ROOMS:
        for path in Path(room.__path__[0]).rglob("*.py"):
            if "dialect" in path.parts:
                continue
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                match node:
                    case ast.Constant(value=str(text)):
                        found.append(text)
                    case ast.JoinedStr(values=parts):
                        found.append(
                            "".join(
                                part.value if isinstance(part, ast.Constant) else "\0"  # type: ignore[misc]
                                for part in parts
                            )
                        )
    return "\n".join(found)


def test_what_is_quoted_is_said() -> None:
    said = literals()
    missing = [
        (heading, piece.strip())
        for heading in HEADINGS
        for piece in re.split(r"\.\.\.", heading)
        if len(piece.strip()) >= SHORTEST and piece.strip() not in said
    ]
    assert missing == []


def test_a_quotation_has_something_to_look_for() -> None:
    assert len(HEADINGS) > 20
    for heading in HEADINGS:
        assert any(len(piece.strip()) >= SHORTEST for piece in heading.split("...")), heading


def test_a_text_that_nobody_says_is_found() -> None:
    assert "no vehicle was abducted" not in literals()
