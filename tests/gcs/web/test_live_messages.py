"""What the live page tells over its picture, in a page from disk."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcs.web import asset
from tests.doubles.browser import Browser

TEXT = "Reposition denied: load height -3.00 m, least 0.3 m"  # of the length that a STATUSTEXT may have

PAGE = """<!doctype html><meta charset="utf-8"><title>messages</title><style>{style}</style>
<main><section id="stage"><div id="toast">{text}</div><div id="banner">{text}</div></section></main>"""


@pytest.mark.parametrize("width", [500, 800, 1000, 1280])
@pytest.mark.parametrize("box", ["toast", "banner"])
def test_a_text_that_fits_stands_in_one_line(browser: Browser, tmp_path: Path, box: str, width: int) -> None:
    path = tmp_path / "messages.html"
    path.write_text(PAGE.format(style=asset("live.css"), text=TEXT))
    browser.open(path.as_uri(), width, 800)
    lines = browser.run(
        f"""const box = document.getElementById("{box}"), range = document.createRange();
        range.selectNodeContents(box);
        return new Set([...range.getClientRects()].map((line) => Math.round(line.top))).size"""
    )
    assert lines == 1
