"""One look for all pictures: colours for the colour-blind too, phases as bands, thinned lines."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.axes import Floats
from gcs.analysis.samples import PHASE_NAMES
from gcs.analysis.tracks import Ints
from gcs.report.missing import NOT_IN_LOG

# Okabe and Ito's palette
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE = "#CC79A7"
INK, GREY, PALE, SHADOW = "#22272e", "#7b838c", "#c9ced4", "#d5dae0"

FAINT = "#a9b2bb"  # a line behind another

AXES = ("x east", "y north", "z up")
_ROTORS = (BLUE, ORANGE, GREEN, PURPLE, "#56B4E9", "#B8A800", "#7A5230", INK)


def rotor_colour(i: int) -> str:
    """Colour of the rotor with this index; beyond eight rotors the colours repeat."""
    return _ROTORS[i % len(_ROTORS)]


_EARTH, _CALM, _BUSY, _HOME, _ALARM = "#faf2e2", "#f1f3f5", "#eef5fb", "#eaf5ee", "#fbe6e2"
_BANDS = {
    mavlink.PLUMBLINE_PHASE_TAUTEN: _EARTH,
    mavlink.PLUMBLINE_PHASE_LIFT: _EARTH,
    mavlink.PLUMBLINE_PHASE_HOLD: _CALM,
    mavlink.PLUMBLINE_PHASE_MISSION: _BUSY,
    mavlink.PLUMBLINE_PHASE_RETURN: _HOME,
    mavlink.PLUMBLINE_PHASE_LOWER: _EARTH,
    mavlink.PLUMBLINE_PHASE_SET_DOWN: _EARTH,
    mavlink.PLUMBLINE_PHASE_FAILSAFE: _ALARM,
    mavlink.PLUMBLINE_PHASE_GUIDED: _BUSY,
}
_STYLE: Any = {
    "axes.axisbelow": True,
    "axes.edgecolor": PALE,
    "axes.facecolor": "white",
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 10,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titley": 1.0,  # where it is anyway: matplotlib would look for ticks above the axes each time
    "figure.facecolor": "white",
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "grid.color": "#dfe3e7",
    "grid.linewidth": 0.6,
    "pdf.fonttype": 42,  # letters that other programs can edit and search
    "svg.hashsalt": "plumbline",  # else its identifiers are random
    "legend.borderpad": 0.0,
    "legend.columnspacing": 1.2,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "text.color": INK,
    "xtick.color": GREY,
    "xtick.labelcolor": INK,
    "xtick.labelsize": 9,
    "ytick.color": GREY,
    "ytick.labelcolor": INK,
    "ytick.labelsize": 9,
}
DPI = 120
_MAX_POINTS = 4000  # of a line: more than twice the pixels across a picture
_PHASE_LABEL_CHAR = 0.0095  # width of a character of a phase's name, as a part of the width of the axes
_HEADROOM = 0.09  # of the height of the axes, for those names


@contextmanager
def style() -> Iterator[None]:
    """The look, for figures that are made and saved inside."""
    import matplotlib as mpl

    with mpl.rc_context(_STYLE), warnings.catch_warnings():
        # a title may have letters that the font lacks: they are boxes in the picture
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def new_figure(width_in: float, height_in: float) -> Any:
    """A new figure, independent of pyplot and its global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


Target = Path | BinaryIO  # of a picture
# what matplotlib would write about itself and the time
_DATED = {".png": ("Software",), ".pdf": ("CreationDate", "Creator", "Producer"), ".svg": ("Date", "Creator")}


def save(figure: Any, path: Target) -> None:
    """Write a PNG, or to a path what its ending says, without date or version in it, so that the same flight
    gives the same bytes."""
    ending = path.suffix if isinstance(path, Path) else ".png"
    pixels: Any = {"pil_kwargs": {"compress_level": 6}} if ending == ".png" else {}
    figure.savefig(path, dpi=DPI, metadata=dict.fromkeys(_DATED[ending]), **pixels)


def new_axes_grid(
    width_in: float, height_in: float, count: int, columns: int = 1, *, share_y: bool = False
) -> Any:
    """A figure and its (count, columns) axes over one time axis."""
    figure = new_figure(width_in, height_in)
    axes = figure.subplots(count, columns, sharex=True, sharey=share_y, squeeze=False)
    figure.subplots_adjust(
        left=0.82 / width_in,
        right=1.0 - 0.22 / width_in,
        bottom=0.5 / height_in,
        top=1.0 - 0.45 / height_in,
        hspace=0.16 if columns == 1 else 0.2,
        wspace=0.22 if not share_y else 0.06,
    )
    for ax in axes[-1]:
        ax.set_xlabel("vehicle clock (s)")
    return figure, axes


def draw(ax: Any, time_s: Floats, values: Floats, **line_style: Any) -> None:
    """Draw a thinned line of the finite values; no line if there are none."""
    t, v = thinned(time_s, np.where(np.isfinite(values), values, np.nan))
    if np.isfinite(v).any():
        ax.plot(t, v, **line_style)


def thinned(time_s: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Least and greatest value of each of many short spans: the line looks the same, with fewer points."""
    n = len(time_s)
    width = -(-2 * n // _MAX_POINTS)
    if width <= 2:
        return time_s, values
    spans = n // width
    block = values[: spans * width].reshape(spans, width)
    known = np.isfinite(block)
    low = np.argmin(np.where(known, block, np.inf), axis=1)
    high = np.argmax(np.where(known, block, -np.inf), axis=1)
    first = np.arange(spans) * width
    index = np.sort(np.stack((first + low, first + high), axis=1), axis=1).ravel()
    return time_s[index], values[index]


def length_scale(values_m: Floats) -> tuple[float, str]:
    """The factor for lengths, and the unit: mm, or m if a length reaches a metre (a lost flight)."""
    finite = values_m[np.isfinite(values_m)]
    return (1.0, "m") if finite.size and np.abs(finite).max() >= 1.0 else (1e3, "mm")


def note_if_empty(ax: Any, text: str = NOT_IN_LOG) -> None:
    """Write `text` into axes in which nothing was drawn."""
    if not ax.lines and not ax.collections:
        note(ax, text)


def note(ax: Any, text: str) -> None:
    """Write `text` into the middle of the axes."""
    pad = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.5}
    ax.text(
        *(0.5, 0.5, text), transform=ax.transAxes, ha="center", va="center", color=GREY, bbox=pad, zorder=6
    )


def draw_legend(ax: Any, columns: int = 4) -> None:
    """Draw the legend above the right end of the axes, where it hides no data."""
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.25)


def phase_spans(time_s: Floats, phase: Ints) -> list[tuple[float, float, int]]:
    """(begin, end, phase) of each stretch of one phase; a stretch ends where the next one begins."""
    if len(time_s) == 0:
        return []
    starts = np.flatnonzero(np.append(True, phase[1:] != phase[:-1]))
    ends = np.append(starts[1:], len(time_s) - 1)
    return [(float(time_s[b]), float(time_s[e]), int(phase[b])) for b, e in zip(starts, ends, strict=True)]


def draw_phase_bands(
    axes: list[Any], spans: list[tuple[float, float, int]], limits: tuple[float, float]
) -> None:
    """Draw phases as shaded bands behind all axes; the first show their names above the data, if they fit."""
    low, high = axes[0].get_ylim()
    axes[0].set_ylim(low, high + _HEADROOM * (high - low))
    for ax in axes:
        ax.set_xlim(*limits)
    width = limits[1] - limits[0]
    for begin, end, phase in spans:
        left, right = max(begin, limits[0]), min(end, limits[1])
        if phase not in _BANDS or right <= left:
            continue
        for ax in axes:
            ax.axvspan(left, right, color=_BANDS[phase], linewidth=0.0, zorder=0, antialiased=False)
        name = PHASE_NAMES[phase].replace("_", " ")
        if len(name) * _PHASE_LABEL_CHAR * width < right - left:
            axes[0].text(
                0.5 * (left + right),
                0.985,
                name,
                transform=axes[0].get_xaxis_transform(),
                ha="center",
                va="top",
                fontsize=8,
                color=GREY,
                zorder=5,
            )


def draw_failure(axes: list[Any], time_s: float) -> None:
    """Mark the time of a failure in all axes; the first name it, below the names of the phases."""
    for ax in axes:
        ax.axvline(time_s, color=RED, linewidth=1.2, zorder=4)
    begin, end = axes[0].get_xlim()
    side = 1 if time_s < 0.5 * (begin + end) else -1  # of the line, on which there is room
    axes[0].annotate(
        "failure",
        (time_s, 0.9),
        xycoords=axes[0].get_xaxis_transform(),
        xytext=(4 * side, 0),
        textcoords="offset points",
        ha="left" if side > 0 else "right",
        va="top",
        fontsize=8,
        color=RED,
        zorder=5,
        annotation_clip=True,
    )


def flagged_spans(time_s: Floats, flags: NDArray[np.bool_], min_width_s: float) -> list[tuple[float, float]]:
    """(begin, width) of each stretch of set flags, at least `min_width_s` wide so that one is visible."""
    if not flags.any():
        return []
    edges = np.diff(np.concatenate(([False], flags, [False])).astype(np.int8))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    last = len(time_s) - 1
    return [
        (float(time_s[b]), max(float(time_s[int(e) if e < last else last] - time_s[b]), min_width_s))
        for b, e in zip(starts, ends, strict=True)
    ]
