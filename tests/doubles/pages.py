"""Pages of the documentation split into their contents: code blocks with their marks, headings and links.

A block is a fence with a language; a comment in the line above states what is special about it:

    <!-- not run: REASON: more -->   REASON is display, firmware, network or minutes
    <!-- run by: tests/... -->       another test runs it
    <!-- file: NAME -->              it is the content of this file, which the blocks after it may use
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
REASONS = ("display", "firmware", "network", "minutes")
_MARK = re.compile(r"<!-- (not run|run by|file): (.+) -->")
_FENCE = re.compile(r"(`{3,})(\S*)")
_HEADING = re.compile(r"#{1,6} +(.*?) *#*")
_LINK = re.compile(r"(?<!\\)\[[^\]\n]*(?:\n[^\]\n]*)?\]\(([^()\s]+)\)")


@dataclass(frozen=True)
class Block:
    """A fence; `line` is that of its first line of content."""

    page: Path
    line: int
    language: str
    text: str
    mark: str  # not run, run by, file, or nothing
    said: str  # what the mark says

    @property
    def place(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def split(page: Path) -> tuple[list[Block], list[tuple[int, str]]]:
    """The blocks of a page, and the lines outside of them with their numbers."""
    blocks, prose = [], []
    end, language, begin, above = "", "", 0, ""
    lines = page.read_text(encoding="utf-8").split("\n")
    for number, line in enumerate(lines, 1):
        if end:
            if line.strip() == end:
                mark = _MARK.fullmatch(above)
                found = mark.groups() if mark else ("", "")
                text = "\n".join(lines[begin : number - 1]) + "\n"
                blocks.append(Block(page, begin + 1, language, text, *found))
                end = ""
        elif fence := _FENCE.fullmatch(line):
            end, language, begin, above = fence[1], fence[2], number, lines[number - 2]
        else:
            prose.append((number, line))
    assert not end, f"{page}: a fence that does not end"
    return blocks, prose


def anchors(page: Path) -> set[str]:
    """The anchors that may follow # in a link to the page, as GitHub and the site make them."""
    found: dict[str, int] = {}
    names = set()
    for _, line in split(page)[1]:
        heading = _HEADING.fullmatch(line)
        if heading is None:
            continue
        text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1])
        name = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
        count = found.get(name, 0)
        names.add(f"{name}-{count}" if count else name)
        found[name] = count + 1
    return names


def links(page: Path) -> list[str]:
    """The targets of the links of a page."""
    text = "\n".join(re.sub(r"`[^`]*`", "", line) for _, line in split(page)[1])
    return _LINK.findall(text)
