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
    """A page from disk with its scene in the variable `scene`."""
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
    assert red > green > blue and red - blue > 60  # amber, as nothing else is
    assert seen[1] != seen[0]
    page.listen()
    assert page.errors == []
    assert [url for url in page.requests if not url.startswith("file:")] == []


def test_a_slack_cable_is_a_curve_of_its_own_length_that_stays_above_the_ground(page: Browser) -> None:
    lengths = page.run(
        """const out = [];
        for (const [load, position] of [
          [[0, 0, -1], [0.1, 0.1, -1.5]], [[0, 0, -1], [0.5, 0.1, -1.1]], [[0, 0, -0.02], [0.3, 0, -0.1]]]) {
          const slack = {position, load: {position: load, attached: true}, taut: false};
          scene.show({time: 0, vehicles: [vehicle(slack)]});
          const p = scene.crafts.get(1).points;
          let length = 0, lowest = -Infinity;
          for (let i = 3; i < p.length; i += 3) {
            length += Math.hypot(p[i] - p[i - 3], p[i + 1] - p[i - 2], p[i + 2] - p[i - 1]);
            lowest = Math.max(lowest, p[i + 2]);
          }
          out.push([length, lowest]);
        }
        return out"""
    )
    for length, _ in lengths[:2]:
        assert length == pytest.approx(0.7, rel=0.01)  # a polygon of 24 sides instead of the curve
    assert max(lowest for _, lowest in lengths) < 0.0  # down is positive


def test_a_load_that_was_let_go_hangs_on_no_cable(page: Browser) -> None:
    assert page.run(
        """scene.show({time: 0, vehicles: [vehicle()]});
        const before = pixel(...scene.project([0, 0, -1.35]));
        const gone = {load: {position: [0, 0, -0.02], attached: false}, taut: false};
        scene.show({time: 0, vehicles: [vehicle(gone)]});
        const after = pixel(...scene.project([0, 0, -1.35]));
        return [before, after].map((p) => Math.min(...p.slice(0, 3)) > 150)"""
    ) == [True, False]


def test_a_click_names_the_place_at_the_height_of_the_load_and_on_the_ground(page: Browser) -> None:
    spot = page.run(
        """scene.show({time: 0, vehicles: [vehicle()]});
        scene.onPick((level, ground, clicks) => { globalThis.picked = [level, ground, clicks]; });
        return scene.project([0.4, -0.3, -1])"""
    )
    page.click_at("#scene", *spot)
    level, ground, clicks = page.wait("globalThis.picked")
    # a pixel covers about 4 mm there, seen at an angle
    assert level == pytest.approx([0.4, -0.3, -1.0], abs=0.02)
    assert ground[2] == pytest.approx(0.0, abs=1e-6)
    assert clicks == 1


def test_the_camera_that_follows_keeps_the_vehicle_where_it_was_in_the_picture(page: Browser) -> None:
    moved = """scene.show({time: 0, vehicles: [vehicle({position: [arguments[0], 3, -2.7],
          load: {position: [arguments[0], 3, -2], attached: true}})]});
        return scene.project([arguments[0], 3, -2.7])"""
    page.run(moved, 0)
    page.run("scene.camera('follow')")
    first = page.run(moved, 0)
    assert page.run(moved, 40) == pytest.approx(first, abs=0.5)
    page.run("scene.camera('orbit')")
    assert page.run(moved, 41) != pytest.approx(first, abs=20)


@pytest.mark.parametrize("size", [(1280, 800), (360, 640)])
def test_fit_brings_a_whole_path_into_the_picture(page: Browser, size: tuple[int, int]) -> None:
    page.resize(*size)
    pixels = page.run(
        """const flown = [], error = [];
        for (let i = 0; i < 200; i += 1) {
          flown.push(9 * Math.sin(i / 30), 4 * Math.cos(i / 30) + 30, -2 - Math.sin(i / 15));
          error.push(i / 1000);
        }
        const path = new Float32Array(flown);
        scene.setTrack({asked: path, flown: path, error: new Float32Array(error)});
        scene.fit();
        scene.render();
        const out = [];
        for (let i = 0; i < flown.length; i += 3) out.push(scene.project(flown.slice(i, i + 3)));
        return out"""
    )
    assert all(0 < x < size[0] and 0 < y < size[1] for x, y in pixels)


def test_the_path_is_coloured_by_the_error_and_the_legend_tells_the_scale(page: Browser) -> None:
    early, late, text = page.run(
        """const flown = [], error = [];
        for (let i = 0; i < 100; i += 1) { flown.push(0, i / 25 - 2, -1); error.push(i < 50 ? 0.001 : 0.18); }
        scene.setTrack({asked: null, flown: new Float32Array(flown), error: new Float32Array(error)});
        scene.fit();
        const near = (place) => {
          const [x, y] = scene.project(place), found = [];
          for (let dy = -3; dy <= 3; dy += 1) found.push(pixel(x, y + dy));
          return found.sort((a, b) => Math.max(...b.slice(0, 3)) - Math.max(...a.slice(0, 3)))[0];
        };
        return [near([0, -1, -1]), near([0, 1, -1]), document.querySelector(".scene-legend").textContent]"""
    )
    assert early[2] > early[0] + 60  # blue
    assert late[0] > late[2] + 60  # vermilion
    assert text.endswith("200 mm")


def test_a_path_that_grows_shows_its_legend_with_the_first_error_and_widens_the_scale(page: Browser) -> None:
    assert page.run(
        """const legend = document.querySelector(".scene-legend"), seen = [];
        const tell = () => seen.push(legend.style.display === "none" ? "" : legend.textContent);
        for (let i = 0; i < 5; i += 1) scene.extendTrack(1, [0, 0.1 * i, -1], null, null);
        tell();
        scene.extendTrack(1, [0, 1, -1], 0.004, [0, 1, -1]);
        scene.extendTrack(1, [0, 1.1, -1], 0.004, [0, 1.1, -1]);
        tell();
        scene.extendTrack(1, [0, 1.2, -1], 0.31, [0, 1.2, -1]);
        tell();
        for (let i = 0; i < 2000; i += 1) scene.extendTrack(1, [0, 1 + 0.01 * i, -1], 0.01, null);
        scene.render();
        scene.clearTrack(1);
        tell();
        return seen.map((text) => text.slice(-6))"""
    ) == ["", "020 mm", "500 mm", ""]
    page.listen()
    assert page.errors == []


def test_fence_rally_points_wind_and_themes_are_drawn_without_a_word_on_the_console(page: Browser) -> None:
    before, fenced, light = page.run(
        """scene.setTheme("dark");
        scene.show({time: 0, vehicles: [vehicle()]});
        scene.look([0, 0, -1], 12);
        const at = () => pixel(...scene.project([2, 0, -1.5]));
        const before = at();
        scene.setFence({zones: [{kind: "exclusion", polygon: [[2, -2], [2, 2], [3, 2], [3, -2]]},
                                {kind: "inclusion", centre: [0, 0], radius: 6}], radius: 8, height: 4});
        scene.setRally([[1, 1, 0]]);
        scene.setWaypoints([[0, 0, 0], [0, 0, -2], [3, 3, -2]]);
        scene.setGoal([1, 1, -1]);
        scene.show({time: 0.1, vehicles: [vehicle()], wind: [3, 1, 0]});
        const fenced = at();
        scene.setTheme("light");
        const light = at();
        scene.setFence(null); scene.setRally([]); scene.setGoal(null); scene.setWaypoints([]);
        scene.show({time: 0.2, vehicles: []});
        scene.render();
        scene.dispose();
        return [before, fenced, light]"""
    )
    assert fenced[0] > before[0] + 15  # reddish
    assert min(light[:3]) > 150
    page.listen()
    assert page.errors == []
