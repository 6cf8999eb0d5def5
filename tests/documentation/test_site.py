"""The site builds without a warning, its pages load nothing from elsewhere, and its search finds names."""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

import pytest

from tests.doubles.browser import Browser
from tests.doubles.pages import ROOT

pytest.importorskip("material", reason="the extra docs is not installed")
LOADED = re.compile(
    r"""(?:<script[^>]*\ssrc|<link[^>]*\shref|<img[^>]*\ssrc|@import|url)\s*[=(]\s*["']?(https?:)?//"""
)


class Site(NamedTuple):
    """The site that was built, and what was warned of meanwhile."""

    folder: Path
    warnings: list[str]


class Listener(logging.Handler):
    """Keeps what is logged."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """The site, built once for all tests."""
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    folder, listener = tmp_path_factory.mktemp("site"), Listener()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NO_MKDOCS_2_WARNING", "1")
        patch.setattr(sys, "dont_write_bytecode", False)  # as in `make docs`
        patch.chdir(ROOT)
        logging.getLogger().addHandler(listener)
        build(
            load_config(str(ROOT / "mkdocs.yml"), strict=True, site_dir=str(folder))
        )  # a warning would raise
        logging.getLogger().removeHandler(listener)
    return Site(folder, listener.messages)


def test_the_site_builds_without_a_warning_and_loads_nothing_from_elsewhere(site: Site) -> None:
    assert site.warnings == []
    pages = list(site.folder.rglob("*.html"))
    assert len(pages) > 25
    asked = {
        f"{path.name}: {found[0][:120]}"
        for path in (*pages, *site.folder.rglob("*.css"))
        for found in LOADED.finditer(path.read_text(encoding="utf-8"))
    }
    assert asked == set()
    assert {f"{page.name}: {link}" for page in pages for link in _dead(page)} == set()


def test_what_a_build_or_a_notebook_leaves_in_docs_is_not_published(site: Site) -> None:
    from mkdocs.config import load_config

    assert [path.name for path in site.folder.rglob("*.py*")] == ["betaflight_hover.py"]
    excluded = load_config(str(ROOT / "mkdocs.yml")).exclude_docs
    for name in ("site_hooks.py", "__pycache__/site_hooks.cpython-311.pyc", "notebooks/my_law.py"):
        assert excluded.match_file(name), name
    assert not excluded.match_file("examples/betaflight_hover.py")


def test_the_search_finds_names_in_code(site: Site, browser: Browser) -> None:
    browser.open((site.folder / "index.html").as_uri())
    search = """const field = document.querySelector("[data-md-component=search-query]");
        field.focus();
        field.value = arguments[0];
        field.dispatchEvent(new Event("keyup"))"""
    links = (
        "[...document.querySelectorAll('.md-search-result__link')].map((link) => link.getAttribute('href'))"
    )
    for name, page in (
        ("reset_mask", "learning.html"),  # there as reset(options={"reset_mask": ...})
        ("NextStep", "learning.html"),  # ("NextStep")
        ("SIM_WIND_E", "parameters.html"),
        ("plumbline.Error", "api.html"),
    ):
        browser.run(search, name)
        browser.wait(f"{links}.some((link) => link.includes('{page}') && link.includes('{name.lower()}'))")


def _dead(page: Path) -> Iterator[str]:
    """The links of a page to files that do not exist."""
    for link in re.findall(r'<a [^>]*href="([^"#?]+)[^"]*"', page.read_text(encoding="utf-8")):
        elsewhere = re.match(r"[a-z]+:|//", link) or (page.name == "404.html" and link.startswith("/"))
        if not elsewhere and not (page.parent / unquote(link)).exists():
            yield link
