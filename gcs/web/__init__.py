"""Scripts and styles of Plumbline's pages, our own and (in `vendor/`) third-party ones.

All are plain scripts, not modules: a page may load them from a server or contain their text. Ours define one
global, `Plumbline`.
"""

from __future__ import annotations

from importlib.resources import files

PLOT_SCRIPTS = ("vendor/uplot.min.js",)
PLOT_STYLES = ("vendor/uplot.min.css",)
SCENE_SCRIPTS = (  # in the order in which they are loaded
    "vendor/three.min.js",
    "scene_theme.js",
    "scene_craft.js",
    "scene_track.js",
    "scene_places.js",
    "scene.js",
)
LIVE_PAGE = "live.html"
LIVE_FILES = (  # that the live page loads from its server
    *PLOT_STYLES,
    "live.css",
    *PLOT_SCRIPTS,
    *SCENE_SCRIPTS,
    "live_plots.js",
    "live_panels.js",
    "live_controls.js",
    "live.js",
)


def asset(name: str) -> str:
    """The text of a file of this folder, e.g. "scene.js" or "vendor/three.min.js"."""
    return files("gcs.web").joinpath(name).read_text(encoding="utf-8")
