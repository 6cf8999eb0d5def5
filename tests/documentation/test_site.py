"""The site builds without a warning, and its pages load nothing from elsewhere."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import pytest

from tests.doubles.pages import ROOT

pytest.importorskip("material", reason="the extra docs is not installed")
LOADED = re.compile(
    r"""(?:<script[^>]*\ssrc|<link[^>]*\shref|<img[^>]*\ssrc|@import|url)\s*[=(]\s*["']?(https?:)?//"""
)


def test_the_site_builds_without_a_warning_and_loads_nothing_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    monkeypatch.setenv("NO_MKDOCS_2_WARNING", "1")
    monkeypatch.chdir(ROOT)
    config = load_config(str(ROOT / "mkdocs.yml"), strict=True, site_dir=str(tmp_path))
    build(config)  # strict: a warning would raise
    assert [record.message for record in caplog.records if record.levelname == "WARNING"] == []
    pages = list(tmp_path.rglob("*.html"))
    assert len(pages) > 25
    asked = {
        f"{path.name}: {found[0][:120]}"
        for path in (*pages, *tmp_path.rglob("*.css"))
        for found in LOADED.finditer(path.read_text(encoding="utf-8"))
    }
    assert asked == set()
    assert {f"{page.name}: {link}" for page in pages for link in _dead(page)} == set()


def _dead(page: Path) -> Iterator[str]:
    """The links of a page to files that do not exist."""
    for link in re.findall(r'<a [^>]*href="([^"#?]+)[^"]*"', page.read_text(encoding="utf-8")):
        elsewhere = re.match(r"[a-z]+:|//", link) or (page.name == "404.html" and link.startswith("/"))
        if not elsewhere and not (page.parent / unquote(link)).exists():
            yield link
