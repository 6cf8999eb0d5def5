"""Draws a scene: vehicle, cable and load above the ground, and the desired position of the load.

Matplotlib draws it. Its artists are made once, and moved for each picture.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from matplotlib.text import Text
from matplotlib.transforms import IdentityTransform

from plumbline.learning.camera import Camera, camera_at
from plumbline.learning.scene import (
    CIRCLE,
    GAP,
    Frame,
    Scene,
    VehicleShape,
    cable_shape,
    on_ground,
    ring_and_cross,
    vehicle_shape,
)
from sitl.world import Floats

COLOURS = {  # as in the light theme of the replay, gcs/web/scene_theme.js
    "background": "#f4f6f8",
    "gridMajor": "#c3cdd6",
    "shadow": "#2c3a48",
    "asked": "#7b8b9a",  # the whole path
    "hull": "#2c3a48",
    "nose": "#d9541e",
    "arm": "#516273",
    "rotor": "#3a7ab5",
    "rotorFull": "#d9541e",
    "cable": "#22303d",
    "slack": "#b86e00",
    "load": "#d99a00",
}
_DESIRED, _TEXT = "#1464b4", "#22303d"

_UNIT_PIXELS = 480  # shorter side of the picture for which widths of lines and sizes of letters are given
_MIN_TEXT_PIXELS = 200  # shorter side below which letters would be illegible
_MARGIN = 12.0  # of the texts
_LOAD_RADIUS = 5.0  # least radius of the load as drawn
_SHADOW_RADII = 2.5  # radius of the shadow of the load, in radii of the load
_DESIRED_M = 0.12  # radius of the ring around the desired position
_GRID_LINES = 14  # of the grid, on each side of its middle
_FADING = (0.2, 0.4, 0.6, 0.8, 1.0)  # opacities of the grid, from far to near
_FULL = 0.75  # share of its maximum force from which a rotor changes its colour

# what is drawn over what
_ON_GROUND, _VEHICLE_BEHIND, _CABLE_ORDER, _LOAD_ORDER, _VEHICLE_IN_FRONT, _TEXT_ORDER = range(6)
_STILL = IdentityTransform()  # positions are in pixels


class Painter:
    """Draws pictures of one size (width, height)."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._size, self._unit = size, min(size) / _UNIT_PIXELS
        dpi = 72.0 * self._unit  # so that a point is a unit
        width, height = ((pixels + 0.01) / dpi for pixels in size)  # above, as it is rounded down
        self._figure = Figure(figsize=(width, height), dpi=dpi, facecolor=COLOURS["background"])
        self._canvas: Any = FigureCanvasAgg(self._figure)
        self._grid = [self._line(_ON_GROUND, COLOURS["gridMajor"], alpha=alpha) for alpha in _FADING]
        self._shadows = self._polygons(_ON_GROUND, facecolors=COLOURS["shadow"], alpha=0.16, linewidths=0.0)
        self._path = self._line(_ON_GROUND, COLOURS["asked"], linewidth=1.6, alpha=0.6)
        dashes = {"linestyle": (0, (2, 3)), "alpha": 0.5}
        self._desired_drop = self._line(_ON_GROUND, _DESIRED, **dashes)
        self._load_drop = self._line(_ON_GROUND, COLOURS["shadow"], **dashes)
        self._metres = self._line(_ON_GROUND, COLOURS["shadow"], linestyle="none", marker="o", markersize=3.5)
        self._ahead = self._line(_ON_GROUND, _DESIRED, linewidth=2.0, alpha=0.6)
        self._desired = self._line(_ON_GROUND, _DESIRED, linewidth=1.5)
        self._error = self._line(_ON_GROUND, _DESIRED, alpha=0.6)
        self._cable = self._line(_CABLE_ORDER, COLOURS["cable"], linewidth=1.6)
        self._load = self._circle(_LOAD_ORDER, facecolor=COLOURS["load"], edgecolor=_TEXT, linewidth=1.0)
        self._gleam = self._circle(_LOAD_ORDER, facecolor="white", edgecolor="none", alpha=0.5)
        self._arms = self._line(_VEHICLE_IN_FRONT, COLOURS["arm"], linewidth=2.6)
        self._hull = self._add(
            _VEHICLE_IN_FRONT,
            Polygon(CIRCLE[:, :2], facecolor=COLOURS["hull"], edgecolor="none", transform=_STILL),
        )
        self._nose = self._line(_VEHICLE_IN_FRONT, COLOURS["nose"], linewidth=2.6)
        self._rotors = self._polygons(_VEHICLE_IN_FRONT, linewidths=1.2)
        self._numbers = self._text(_MARGIN * self._unit, _TEXT)
        self._slack = self._text(size[0] - _MARGIN * self._unit, COLOURS["slack"], text="slack", ha="right")

    def draw(self, scene: Scene) -> Frame:
        """(height, width, 3) the picture of a scene."""
        camera, shape = self.camera(scene), vehicle_shape(scene)
        self._draw_ground(scene, camera, shape)
        self._draw_desired(scene, camera)
        self._draw_vehicle(scene, camera, shape)
        self._draw_load(scene, camera)
        self._write(scene)
        self._canvas.draw()
        drawn = np.asarray(self._canvas.buffer_rgba())
        frame = np.empty((*drawn.shape[:2], 3), np.uint8)
        for channel in range(3):  # faster than all at once
            frame[..., channel] = drawn[..., channel]
        return frame

    def camera(self, scene: Scene) -> Camera:
        """The camera of the picture of a scene."""
        reach = scene.truth.cable_length + scene.truth.rotor_reach
        return camera_at(scene.desired, scene.plant.x_load, reach, self._size)

    # ---- parts

    def _draw_ground(self, scene: Scene, camera: Camera, shape: VehicleShape) -> None:
        for line, points in zip(self._grid, _grid(camera), strict=True):
            line.set_data(*points.T)
        load = np.array(scene.plant.x_load) + _SHADOW_RADII * scene.truth.load_radius * CIRCLE
        self._shadows.set_verts([camera.pixels(on_ground(each)) for each in (*shape.rims, shape.hull, load)])

    def _draw_desired(self, scene: Scene, camera: Camera) -> None:
        desired, load = np.array(scene.desired), np.array(scene.plant.x_load)
        heights = np.arange(camera.grid_m, load[2], camera.grid_m)[:, None]
        for line, points in (
            (self._path, scene.path),
            (self._ahead, scene.ahead),
            (self._desired, ring_and_cross(desired, _DESIRED_M)),
            (self._error, np.stack((desired, load))),
            (self._desired_drop, np.stack((desired, on_ground(desired)))),
            (self._load_drop, np.stack((load, on_ground(load)))),
            (self._metres, on_ground(load) + heights * (0.0, 0.0, 1.0)),
        ):
            line.set_data(*camera.pixels(points).T)

    def _draw_vehicle(self, scene: Scene, camera: Camera, shape: VehicleShape) -> None:
        middle = np.broadcast_to(shape.middle, shape.hubs.shape)
        gaps = np.broadcast_to(GAP, shape.hubs.shape)
        arms = np.stack((middle, shape.hubs, gaps), axis=1).reshape(-1, 3)
        self._arms.set_data(*camera.pixels(arms).T)
        self._nose.set_data(*camera.pixels(shape.nose).T)
        self._hull.set_xy(camera.pixels(shape.hull))
        self._rotors.set_verts(camera.pixels(shape.rims))
        share = np.clip(scene.shares, 0.0, 1.0)[:, None]
        warm = np.clip((share - _FULL) / (1.0 - _FULL), 0.0, 1.0)
        colours = (1.0 - warm) * to_rgb(COLOURS["rotor"]) + warm * to_rgb(COLOURS["rotorFull"])
        self._rotors.set_facecolor(np.concatenate((colours, 0.15 + 0.45 * share), axis=1))
        self._rotors.set_edgecolor(colours)
        # the rotor plane separates it from what is on the other side
        eye, load = ((point - shape.middle) @ shape.upward for point in (camera.eye, scene.plant.x_load))
        order = _VEHICLE_IN_FRONT if eye * load < 0.0 else _VEHICLE_BEHIND
        for part in (self._arms, self._hull, self._nose, self._rotors):
            part.set_zorder(order)

    def _draw_load(self, scene: Scene, camera: Camera) -> None:
        load = np.array(scene.plant.x_load)
        self._cable.set_data(*camera.pixels(cable_shape(scene)).T)
        self._cable.set_color(COLOURS["cable"] if scene.plant.taut != 0.0 else COLOURS["slack"])
        centre = camera.pixels(load)
        radius = max(scene.truth.load_radius * camera.scale(load), _LOAD_RADIUS * self._unit)
        self._load.set(center=centre, radius=radius)
        self._gleam.set(center=centre + 0.35 * radius * np.array([-1.0, 1.0]), radius=0.3 * radius)

    def _write(self, scene: Scene) -> None:
        load = np.array(scene.plant.x_load)
        error = np.linalg.norm(load - scene.desired)
        lines = (f"{scene.time_s:.2f} s", f"error {error:.3f} m", f"height {load[2]:.2f} m")
        self._numbers.set_text("\n".join(lines))
        self._slack.set_visible(scene.plant.taut == 0.0 and min(self._size) >= _MIN_TEXT_PIXELS)

    # ---- artists

    def _add(self, order: int, artist: Artist) -> Any:
        artist.set_zorder(order)
        return self._figure.add_artist(artist)

    def _line(self, order: int, colour: str, **style: Any) -> Any:
        style = {"linewidth": 1.0, "solid_capstyle": "round", **style}
        return self._add(order, Line2D([], [], color=colour, transform=_STILL, **style))

    def _polygons(self, order: int, **style: Any) -> Any:
        return self._add(order, PolyCollection([], transform=_STILL, **style))

    def _circle(self, order: int, **style: Any) -> Any:
        return self._add(order, Circle((0.0, 0.0), 1.0, transform=_STILL, **style))

    def _text(self, x: float, colour: str, text: str = "", **style: Any) -> Any:
        style = {"va": "top", "family": "DejaVu Sans", "fontsize": 12, "parse_math": False, **style}
        artist = Text(x, self._size[1] - _MARGIN * self._unit, text, color=colour, usetex=False, **style)
        artist.set(transform=_STILL, visible=min(self._size) >= _MIN_TEXT_PIXELS)
        return self._add(_TEXT_ORDER, artist)


def _grid(camera: Camera) -> list[Floats]:
    """For each opacity, points (n, 2) of the lines on the ground that have it."""
    spacing, middle = camera.grid_m, camera.ground()[:2]
    nearest = np.round(middle / spacing)
    steps = np.arange(-_GRID_LINES, _GRID_LINES + 1)
    corners = np.zeros((len(steps), len(steps), 3))
    corners[..., 0] = spacing * (nearest[0] + steps)[:, None]
    corners[..., 1] = spacing * (nearest[1] + steps)
    gaps = np.full((len(steps) - 1, len(steps), 1, 3), np.nan)
    pieces = np.concatenate(
        [
            np.concatenate((np.stack((lines[:-1], lines[1:]), axis=2), gaps), axis=2).reshape(-1, 3, 3)
            for lines in (corners, corners.swapaxes(0, 1))
        ]
    )
    away = np.linalg.norm(0.5 * (pieces[:, 0, :2] + pieces[:, 1, :2]) - middle, axis=1)
    fading = np.floor((1.0 - away / (_GRID_LINES * spacing)) * len(_FADING))
    seen = camera.pixels(pieces)
    first, last = seen[:, 0], seen[:, 1]
    inside = ((np.maximum(first, last) > 0.0) & (np.minimum(first, last) < camera.size)).all(axis=1)
    return [seen[inside & (fading == step)].reshape(-1, 2) for step in range(len(_FADING))]
