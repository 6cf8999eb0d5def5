"""The 3-D scene in a page from disk, as a report carries it: what is drawn is where it should be."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcs.web import SCENE_SCRIPTS, asset
from tests.doubles.browser import Browser

PAGE = """<!doctype html><meta charset="utf-8"><title>scene</title>
<style>html, body {{ margin: 0; height: 100% }} #stage {{ position: relative; height: 100% }}
canvas {{ display: block; width: 100%; height: 100% }}</style>
<div id="stage"><canvas id="scene"></canvas></div>{scripts}
<script>
globalThis.scene = new Plumbline.Scene(document.getElementById("scene"), {{ theme: "auto" }});
globalThis.vehicle = (changes) => ({{
  id: 1, position: [0, 0, -1.7], attitude: [1, 0, 0, 0], rotors: [0.5, 0.5, 0.5, 0.5],
  load: {{ position: [0, 0, -1], attached: true }}, taut: true, asked: null, ...changes }});
// the colour of one pixel of the canvas, in CSS pixels
globalThis.pixel = (x, y) => {{
  scene.render();
  const gl = scene.renderer.getContext(), out = new Uint8Array(4);
  gl.readPixels(Math.round(x), scene.canvas.height - 1 - Math.round(y), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, out);
  return [...out];
}};
</script>"""


@pytest.fixture
def page(browser: Browser, tmp_path: Path) -> Browser:
    """A page from disk with a scene of its own, `scene`."""
    path = tmp_path / "scene.html"
    path.write_text(PAGE.format(scripts="".join(f"<script>{asset(name)}</script>" for name in SCENE_SCRIPTS)))
    browser.open(path.as_uri())
    return browser


def test_the_load_is_drawn_where_it_is_projected_to(page: Browser) -> None:
    seen = page.run(
        """scene.show({time: 0, vehicles: [vehicle()], wind: null});
        const before = pixel(...scene.project([0, 0, -1]));
        const moved = vehicle({load: {position: [2, 2, -1], attached: true}});
        scene.show({time: 0, vehicles: [moved], wind: null});
        return [before, pixel(...scene.project([0, 0, -1]))]"""
    )
    red, green, blue, _ = seen[0]
    assert red > green > blue and red - blue > 60  # amber, as no other thing
    assert seen[1] != seen[0]
    page.listen()
    assert page.errors == []
    assert [url for url in page.requests if not url.startswith("file:")] == []
