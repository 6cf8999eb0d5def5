"""The pictures of a sweep: maps of success and error over two parameters, curves over one."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from gcs.analysis.axes import Floats
from gcs.report.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    RED,
    draw_legend,
    new_figure,
    save,
    style,
)
from gcs.sweep.plan import SweepPlan
from gcs.sweep.results import Cells, Flights, cells

_BUILT_IN_COLOURS = {"plumbline": BLUE, "thesis": ORANGE, "lqr": GREEN}
_CUSTOM_COLOURS = (PURPLE, RED, INK, GREY)
# of the first law, the second ...: where curves coincide, the marker of a later law leaves the earlier one
# visible
_MARKERS = (("o", 7.0), ("s", 5.0), ("D", 3.5), ("o", 2.0))
_MAX_NUMBERED_CELLS = 144  # cells of a map; with more, the values are not written into the cells
_ERROR_LIMITS_MM = (1.0, 1000.0)  # of the colour scale


def draw_map(
    path: Path, flights: Flights, plan: SweepPlan, names: tuple[str, str], units: dict[str, str]
) -> None:
    """Draw the share of success, and the median and worst error, of one law over two parameters."""
    from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize

    found = cells(flights, plan, names)
    success = LinearSegmentedColormap.from_list("success", [RED, "#f6e3c5", BLUE])
    panels: tuple[tuple[str, Floats, Any, Any, float], ...] = (
        ("flights completed (%)", 100.0 * found.success, Normalize(0.0, 100.0), success, 1.0),
        (
            "greatest load error, median (mm)",
            found.error_median_m,
            LogNorm(*_ERROR_LIMITS_MM),
            "viridis_r",
            1e3,
        ),
        (
            "greatest load error, worst (mm)",
            found.error_worst_m,
            LogNorm(*_ERROR_LIMITS_MM),
            "viridis_r",
            1e3,
        ),
    )
    with style():
        figure = new_figure(14.4, 4.3)
        for ax, (title, values, norm, colours, scale) in zip(figure.subplots(1, 3), panels, strict=True):
            _draw_cells(ax, found, scale * values, norm, colours)
            ax.set_title(title)
            ax.set_xlabel(_label(names[0], units))
            ax.set_ylabel(_label(names[1], units))
        figure.subplots_adjust(left=0.05, right=0.985, bottom=0.13, top=0.88, wspace=0.2)
        title = f"law {flights.law}{pooled_text(plan, names)}; errors of completed flights"
        figure.suptitle(title, x=0.012, ha="left", fontsize=11, color=INK)
        save(figure, path)


def _draw_cells(ax: Any, found: Cells, values: Floats, norm: Any, colours: Any) -> None:
    x, y = found.axes
    masked = np.ma.masked_invalid(values.T)
    ax.grid(False)
    ax.set_facecolor(PALE)
    image = ax.imshow(masked, origin="lower", aspect="auto", norm=norm, cmap=colours, interpolation="nearest")
    for ticks, labels, centres in (
        (ax.set_xticks, ax.set_xticklabels, x),
        (ax.set_yticks, ax.set_yticklabels, y),
    ):
        stride = max(1, -(-len(centres) // 12))
        ticks(range(0, len(centres), stride))
        labels([f"{value:.4g}" for value in centres[::stride]])
    if values.size > _MAX_NUMBERED_CELLS:
        ax.figure.colorbar(image, ax=ax)
        return
    for (i, j), value in np.ndenumerate(values):
        if not np.isfinite(value):
            ax.text(i, j, "–", ha="center", va="center", fontsize=8, color=GREY)
            continue
        red, green, blue, _ = image.cmap(norm(value))
        dark = 0.3 * red + 0.59 * green + 0.11 * blue < 0.5
        text = f"{value:.0f}" if value >= 10.0 or value == 0.0 else f"{value:.1f}"
        ax.text(i, j, text, ha="center", va="center", fontsize=8, color="white" if dark else INK)


def draw_curve(path: Path, laws: list[Flights], plan: SweepPlan, name: str, units: dict[str, str]) -> None:
    """Draw the share of success and the error over one parameter, for all laws. The errors are of the flights
    that completed: where others were lost, the marker is hollow."""
    with style():
        figure = new_figure(11.0, 3.7)
        left, right = figure.subplots(1, 2, sharex=True)
        colours = law_colours([flights.law for flights in laws])
        any_lost = False
        for flights, colour, (marker, size) in zip(laws, colours, cycle(_MARKERS), strict=False):
            found = cells(flights, plan, (name,))
            x, line = found.axes[0], {"color": colour, "marker": marker, "markersize": size}
            left.plot(x, 100.0 * found.success, label=flights.law, **line)
            median = 1e3 * found.error_median_m
            right.plot(x, median, **line)
            right.plot(x, 1e3 * found.error_worst_m, "--", color=colour, linewidth=1.0)
            lost = (found.success < 1.0) & np.isfinite(median)
            right.plot(x[lost], median[lost], linestyle="", markerfacecolor="white", **line)
            any_lost = any_lost or bool(lost.any())
        right.plot([], [], "o-", color=GREY, markersize=4, label="median")
        right.plot([], [], "--", color=GREY, linewidth=1.0, label="worst")
        if any_lost:
            hollow = {"markersize": 4, "markerfacecolor": "white", "label": "some lost"}
            right.plot([], [], "o", color=GREY, **hollow)
        left.set_ylim(-4.0, 104.0)
        left.set_title("completed (%)")
        right.set_title("greatest load error")
        right.set_ylabel("of completed flights (mm)")
        right.set_yscale("log")
        label_errors(right)
        for ax in (left, right):
            ax.set_xlabel(_label(name, units))
            draw_legend(ax)
        figure.subplots_adjust(left=0.06, right=0.985, bottom=0.15, top=0.84, wspace=0.2)
        title = f"{name}{pooled_text(plan, (name,))}"
        figure.suptitle(title, x=0.012, ha="left", fontsize=11, color=INK)
        save(figure, path)


def pooled_text(plan: SweepPlan, names: tuple[str, ...]) -> str:
    """What the figures over these parameters are taken over: the other varied parameters and the seeds. Empty
    if there is none of these."""
    others = [v.name for v in plan.varied if v.name not in names and len(set(v.values)) > 1]
    parts = [f"all values of {', '.join(others)}"] if others else []
    parts += [f"{len(plan.seeds)} seeds"] if len(plan.seeds) > 1 else []
    return f": over {' and '.join(parts)}" if parts else ""


def label_errors(ax: Any) -> None:
    """Label the logarithmic axis of the errors: at 1, 2 and 5 of each decade, and over less than a decade,
    where few of these lie, at round numbers an equal distance apart."""
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

    low, high = ax.get_ylim()
    evenly = MaxNLocator(nbins=8, steps=(1, 2, 2.5, 5, 10))
    ax.yaxis.set_major_locator(evenly if high < 10.0 * low else LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter(NullFormatter())


def law_colours(laws: list[str]) -> list[str]:
    """A colour for each law: custom laws take those that no built-in law has, in turn."""
    custom = cycle(_CUSTOM_COLOURS)
    return [_BUILT_IN_COLOURS[law] if law in _BUILT_IN_COLOURS else next(custom) for law in laws]


def _label(name: str, units: dict[str, str]) -> str:
    unit = units.get(name, "")
    return f"{name} ({unit})" if unit else name
