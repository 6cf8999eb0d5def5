"""The load track in three dimensions, with cable and vehicle at some instants."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcs.analysis.axes import Floats, body_axes
from gcs.analysis.samples import Samples
from gcs.report.missing import NOT_IN_LOG
from gcs.report.style import GREY, INK, PALE, SHADOW, length_scale

_SNAPSHOTS = 7
_MIN_DISTANCE = 0.1  # of the diagonal of the box: least distance between two snapshots
_ARM = 0.05  # of the longest side of the box: length of the arms as drawn, longer than they are
_POINTS = 1500  # of a line in space: each segment is projected and coloured separately
_MAX_ASPECT = (
    3.5  # greatest ratio of the longest to the shortest side of the box; beyond, axes are not to scale
)
_MIN_SIDE_M = 1.2  # least side of the box
_NEAR_GROUND = 0.25  # of the height of the box: a box that is closer to the ground extends to it
_FAR_M = 2e4  # a flight that was lost may end anywhere; points farther away are not drawn
_SIDE_MARGIN, _TOP_MARGIN, _BOTTOM_MARGIN = (
    0.07,
    0.03,
    0.12,
)  # of a rectangle: the space around the box, for ticks and labels

Indices = NDArray[np.intp]
Rectangle = tuple[float, float, float, float]  # left, bottom, width, height, as parts of the figure


def snapshots(position: Floats, min_distance: float) -> list[int]:
    """Indices of positions (n, 3) more than `min_distance` apart: each the farthest from all before it."""
    if len(position) == 0:
        return []
    chosen = [0]
    distance = np.linalg.norm(position - position[0], axis=1)
    while len(chosen) < _SNAPSHOTS:
        farthest = int(np.argmax(distance))
        if distance[farthest] <= min_distance:
            break
        chosen.append(farthest)
        distance = np.minimum(distance, np.linalg.norm(position - position[farthest], axis=1))
    return chosen


def draw_track(
    figure: Any,
    samples: Samples,
    shown: NDArray[np.bool_],
    rotors: Floats,
    rectangle: Rectangle,
    bar_rectangle: Rectangle,
) -> None:
    """Desired and true path of the load, coloured by error; rectangles are shares of the figure.

    `shown` (n,) are the samples that fill the picture. `rotors` (m, 2) are the positions of the vehicle's
    rotors, forward and left; only their shape matters.
    """
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    ax = figure.add_axes(rectangle, projection="3d")
    known = np.asarray((np.abs(samples.actual_m) < _FAR_M).all(axis=1))  # false for NaN
    mission = known & shown
    if not known.any():
        ax.set_axis_off()
        ax.text2D(0.5, 0.5, NOT_IN_LOG, transform=ax.transAxes, ha="center", color=GREY)
        return
    is_tracked = mission & (np.abs(samples.desired_m) < _FAR_M).all(axis=1)
    central = mission if mission.any() else known
    places = (samples.actual_m[central], samples.vehicle_m[central], samples.desired_m[is_tracked])
    low, high = _set_limits(ax, np.concatenate(places))
    _fill_rectangle(figure, ax, rectangle, low, high)

    whole = _thin(np.flatnonzero(known))
    # matplotlib does not cut lines in space at the box
    whole_path = samples.actual_m[whole]
    outside = np.any((whole_path < low) | (whole_path > high), axis=1, keepdims=True)
    ax.plot(*np.where(outside, np.nan, whole_path).T, color=GREY, linewidth=0.9, alpha=0.7)
    path = samples.actual_m[_thin(np.flatnonzero(mission))]
    ax.plot(path[:, 0], path[:, 1], np.full(len(path), low[2]), color=SHADOW, linewidth=1.6, zorder=0)
    tracked = _thin(np.flatnonzero(is_tracked))
    # no line between two stretches, for example before and after an attitude run
    stretch = np.cumsum(~is_tracked)[tracked]
    joined = stretch[1:] == stretch[:-1]
    if joined.any():
        error_m = np.linalg.norm(samples.error_m[tracked], axis=1)
        scale, unit = length_scale(error_m)
        error = scale * error_m
        path = samples.actual_m[tracked]
        desired = np.insert(samples.desired_m[tracked], np.flatnonzero(~joined) + 1, np.nan, axis=0)
        ax.plot(*desired.T, color=INK, linewidth=0.8, linestyle=(0, (4, 4)), zorder=4)
        coloured = Line3DCollection(
            np.stack((path[:-1], path[1:]), axis=1)[joined],
            cmap="viridis_r",
            norm=Normalize(0.0, max(float(error.max()), 1e-6)),
            linewidths=2.6,
            zorder=3,
        )
        coloured.set_array(0.5 * (error[:-1] + error[1:])[joined])
        ax.add_collection3d(coloured, autolim=False)
        bar = figure.colorbar(coloured, cax=figure.add_axes(bar_rectangle))
        bar.set_label(f"load position error ({unit})", fontsize=9)
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=8, length=0)
    _draw_vehicles(ax, samples, rotors, np.flatnonzero(central), low, high)
    # the box is turned: its corners may be outside the rectangle of the axes, at which Matplotlib would cut
    for artist in (*ax.lines, *ax.collections):
        artist.set_clip_on(False)


def _thin(index: Indices) -> Indices:
    return index[:: max(1, len(index) // _POINTS)]


def _set_limits(ax: Any, points: Floats) -> tuple[Floats, Floats]:
    """Set the limits around the points (n, 3), to scale unless the scene is very long; return the least and
    the greatest corner."""
    points = points[(np.abs(points) < _FAR_M).all(axis=1)]
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(1.1 * (high - low), _MIN_SIDE_M)
    middle = 0.5 * (low + high)
    low, high = middle - 0.5 * size, middle + 0.5 * size
    if 0.0 < low[2] < _NEAR_GROUND * size[2]:
        low[2] = 0.0
    size = high - low
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_zlim(low[2], high[2])
    ax.set_box_aspect(_box(size))
    ax.view_init(elev=17, azim=-38)
    named = zip((ax.xaxis, ax.yaxis, ax.zaxis), ("x east (m)", "y north (m)", "z up (m)"), strict=True)
    for (axis, name), shortened in zip(named, size > _box(size), strict=True):
        axis.set_label_text(name + ", shortened" * bool(shortened), fontsize=9)
        axis.set_pane_color((0.965, 0.97, 0.975, 1.0))
        axis.line.set_color(PALE)
        axis.set_major_locator(_ticks())
        axis.labelpad = 1
    ax.tick_params(pad=-1, labelsize=8)
    return low, high


def _ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=5, steps=[1, 2, 5, 10])


def _fill_rectangle(figure: Any, ax: Any, rectangle: Rectangle, low: Floats, high: Floats) -> None:
    """Zoom and move the axes so that the box, whatever its shape, fills its rectangle except for labels."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    corners = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)]).T

    def extent() -> tuple[Floats, Floats]:
        """Least and greatest corner of the box, as fractions of the figure."""
        ax.apply_aspect()
        flat = np.stack(proj_transform(*corners, ax.get_proj())[:2], axis=-1)
        placed = figure.transFigure.inverted().transform(ax.transData.transform(flat))
        return placed.min(axis=0), placed.max(axis=0)

    least, greatest = extent()
    target_size = np.array(rectangle[2:]) * (1.0 - 2.0 * _SIDE_MARGIN, 1.0 - _TOP_MARGIN - _BOTTOM_MARGIN)
    ax.set_box_aspect(ax._box_aspect, zoom=float((target_size / (greatest - least)).min()))
    # set_box_aspect normalises again: the shape stays the same, the size changes
    least, greatest = extent()
    middle = np.array(rectangle[:2]) + 0.5 * np.array(rectangle[2:]) * (
        1.0,
        1.0 + _BOTTOM_MARGIN - _TOP_MARGIN,
    )
    x, y = middle - 0.5 * (least + greatest)
    ax.set_position((rectangle[0] + x, rectangle[1] + y, rectangle[2], rectangle[3]))


def _draw_vehicles(
    ax: Any, samples: Samples, rotors: Floats, mission: Indices, low: Floats, high: Floats
) -> None:
    """Draw vehicle, cable and load at some instants; after a release, the vehicle and its path."""
    box = _box(high - low)
    stretch = (high - low) / box
    mission = mission[np.isfinite(samples.vehicle_m[mission]).all(axis=1)]
    min_distance = _MIN_DISTANCE * float(np.linalg.norm(box))
    carried, released = mission[samples.attached[mission]], mission[~samples.attached[mission]]
    hanging = carried[snapshots(samples.actual_m[carried] / stretch, min_distance)]
    for index in hanging:
        load, vehicle = samples.actual_m[index], samples.vehicle_m[index]
        ax.plot(*np.stack((load, vehicle)).T, color=GREY, linewidth=0.9, zorder=5)
        ax.plot(*load[:, None], marker="o", markersize=5, color=INK, zorder=6)
    ax.plot(*samples.vehicle_m[_thin(released)].T, color=GREY, linewidth=0.9, linestyle=(0, (1, 2)))
    chosen = np.concatenate(
        (hanging, released[snapshots(samples.vehicle_m[released] / stretch, min_distance)])
    )
    # arms keep their shape in the picture if the axes are not to scale
    reach = _ARM * float(box.max()) * stretch
    arms = rotors / np.linalg.norm(rotors, axis=1).max()
    forward, left = body_axes(samples.quat_wxyz[chosen])
    for index, *axes in zip(chosen, forward, left, strict=True):
        vehicle = samples.vehicle_m[index]
        if not np.isfinite(axes).all():
            continue
        for arm in arms @ np.array(axes):
            ends = np.stack((vehicle, vehicle + reach * arm))
            ax.plot(*ends.T, color=INK, linewidth=1.8, marker="o", markevery=[1], markersize=2.8, zorder=6)


def _box(size: Floats) -> Floats:
    """(3,) sides of the box as drawn: those of the scene, the longest shortened."""
    return np.asarray(np.minimum(size, _MAX_ASPECT * size.min()))
