"""Links of README and docs lead to files and headings that exist, and the site has every page."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tests.doubles.pages import PAGES, ROOT, anchors, links

OUTSIDE = ("https://", "http://", "mailto:")
CONFIGURATION = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    wrong = []
    for link in links(page):
        if link.startswith(OUTSIDE):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            wrong.append(link)
    assert wrong == []


def test_docs_lead_to_docs_alone() -> None:
    """Files outside docs are not on the site."""
    docs = (ROOT / "docs").resolve()
    out = [
        f"{page.name}: {link}"
        for page in PAGES[1:]
        for link in links(page)
        if not link.startswith((*OUTSIDE, "#"))
        and not (page.parent / link.partition("#")[0]).resolve().is_relative_to(docs)
    ]
    assert out == []


def test_every_page_is_in_the_navigation() -> None:
    def files(entry: object) -> list[str]:
        if isinstance(entry, str):
            return [entry]
        parts = entry.values() if isinstance(entry, dict) else entry
        assert not isinstance(parts, str)
        return [name for part in parts for name in files(part)]  # type: ignore[union-attr]

    text = CONFIGURATION[CONFIGURATION.index("\nnav:") :]
    listed = files(yaml.safe_load(text)["nav"])
    there = {
        str(path.relative_to(ROOT / "docs"))
        for path in (ROOT / "docs").rglob("*")
        if path.suffix in (".md", ".ipynb")
    }
    assert len(listed) == len(set(listed)) and set(listed) == there
