"""The running plots of the live page, in a page from disk."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from gcs.web import asset
from tests.doubles.browser import Browser

PAGE = """<!doctype html><meta charset="utf-8"><title>plots</title>
<style>#strips {{ width: 300px }} .strip {{ height: 132px }}</style>
<div id="signals"></div><div id="strips"></div><script>globalThis.Plumbline = {{}};</script>{scripts}
<script>
globalThis.plots = new Plumbline.LivePlots(
  document.getElementById("signals"), document.getElementById("strips"));
</script>"""
SCRIPTS = ("vendor/uplot.min.js", "live_plots.js")


@pytest.fixture
def page(browser: Browser, tmp_path: Path) -> Browser:
    path = tmp_path / "plots.html"
    path.write_text(PAGE.format(scripts="".join(f"<script>{asset(name)}</script>" for name in SCRIPTS)))
    browser.open(path.as_uri())
    return browser


@pytest.mark.parametrize("tension", [0.0, 1e-9, 4e-4, 0.02, 0.83, 1234.5])
def test_ticks_of_a_plot_differ_from_each_other(page: Browser, tension: float) -> None:
    ticks = page.run(
        f"""const samples = [];
        for (let i = 0; i < 50; i++) {{
          const sample = new Array(11).fill(null);
          sample[Plumbline.SAMPLE_AT.time] = 0.1 * i;
          sample[Plumbline.SAMPLE_AT.tension] = {tension} * (1 + 1e-3 * (i % 2));
          samples.push(sample);
        }}
        plots.setSamples(samples);
        await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
        return plots.plots.get("tension").axes[1]._values"""
    )
    shown = [text for text in ticks if text]
    assert len(shown) >= 2
    assert all(float(before) < float(after) for before, after in pairwise(shown)), shown
    assert max(map(len, shown)) <= 6, "as wide as the axis"
