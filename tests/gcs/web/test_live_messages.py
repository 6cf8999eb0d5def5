"""The messages of the live page over its picture, in a page from disk."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest

import gcs.web
from gcs.web import asset
from tests.doubles.browser import Browser

TEXT = "Reposition denied: load height -3.00 m, min 0.3 m"  # as long as a STATUSTEXT may be

PAGE = """<!doctype html><meta charset="utf-8"><title>messages</title><style>{style}</style>
<main><section id="stage"><div id="over"><div id="banner">{text}</div></div><div id="toast">{text}</div>
</section></main>"""


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


SHOWN = """
const put = (id, text) => {
  const box = document.getElementById(id);
  box.textContent = text;
  box.hidden = false;
};
put("mission", "Case B: a sine of growing and shrinking amplitude");
put("phase", "mission, item 3, cable slack");
put("about", "law plumbline · sensors lab · vehicle bebop · seed 1 · 4.2 x real time");
put("wind", "wind 3.0 m/s");
put("toast", arguments[0]);
put("banner", `interrupted: ${arguments[0]}`);
put("hint", "Click: go there · drag: turn · wheel: zoom");
const legend = document.querySelector(".scene-legend");
legend.style.display = "block";
const names = ["title", "about", "cameras", "wind", "banner", "toast", "hint"];
const seen = names.map((id) => document.getElementById(id));
return [...seen, legend].filter((one) => getComputedStyle(one).display !== "none").map((one) => {
  const { left, right, top, bottom } = one.getBoundingClientRect();
  return [one.id || one.className, left, right, top, bottom];
});
"""


def test_nothing_over_the_picture_lies_on_anything_else(browser: Browser) -> None:
    browser.open((Path(gcs.web.__file__).with_name("live.html")).as_uri())
    browser.wait("document.querySelector('.scene-legend') !== null")
    for width in (360, 390, 500, 800, 910, 1000, 1160, 1280):
        browser.resize(width, 800)
        boxes = browser.run(SHOWN, TEXT)
        assert all(box[1] >= 0 and box[2] <= width for box in boxes), (width, boxes)
        over = [
            (one[0], other[0])
            for one, other in combinations(boxes, 2)
            if min(one[2], other[2]) > max(one[1], other[1]) and min(one[4], other[4]) > max(one[3], other[3])
        ]
        assert not over, width


@pytest.mark.parametrize("width", [390, 910, 1280])
def test_a_refusal_of_two_lines_moves_nothing(browser: Browser, width: int) -> None:
    browser.open((Path(gcs.web.__file__).with_name("live.html")).as_uri(), width, 800)
    below = """
        document.getElementById("answer").textContent = arguments[0];
        return document.getElementById("world").getBoundingClientRect().top"""
    assert browser.run(below, "") == browser.run(below, f"goto: denied; {TEXT}")


def test_the_live_page_calls_its_cameras_as_the_report_does(browser: Browser) -> None:
    browser.open((Path(gcs.web.__file__).with_name("live.html")).as_uri())
    names = browser.run(
        "return [...document.querySelectorAll('#cameras button')].map((one) => one.textContent)"
    )
    assert names == browser.run("return [...Plumbline.CAMERAS.map(([, name]) => name), Plumbline.WHOLE]")
    assert len(set(names)) == 4
