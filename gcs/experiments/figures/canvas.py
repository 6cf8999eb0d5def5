"""The common parts of all figures: panels over one time axis, line styles of both controllers, headings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gcs.analysis.axes import Floats
from gcs.experiments.flown import Flown
from gcs.experiments.plan import CASE_NAMES, VEHICLE_NAMES
from gcs.report.style import BLUE, GREEN, GREY, INK, ORANGE, RED, draw, key, new_figure

AXES = "xyz"
COMPONENTS = (BLUE, ORANGE, GREEN)  # x, y, z
DESIRED: Any = {"color": INK, "linewidth": 1.1, "linestyle": (0, (4, 3)), "label": "desired"}
ACTUAL: Any = {"color": BLUE, "linewidth": 1.8, "label": "actual"}
# from figure 4-10 on: solid NGC, dash-dot LQR
NGC: Any = {"color": BLUE, "linewidth": 1.7, "label": "NGC"}
LQR: Any = {"color": RED, "linewidth": 1.5, "linestyle": (0, (6, 2, 1.2, 2)), "label": "LQR"}
TIME = "time (s)"
_HEAD_IN = 0.72  # for title and subtitle


class Scene(NamedTuple):
    """The two flights of one case with one vehicle."""

    case: str
    vehicle: str
    ngc: Flown
    lqr: Flown

    @property
    def pair(self) -> tuple[tuple[Flown, Any], tuple[Flown, Any]]:
        """Each flight with its line style."""
        return (self.ngc, NGC), (self.lqr, LQR)


def panels(width_in: float, height_in: float, count: int, columns: int, *, wide: float = 0.26) -> Any:
    """A figure with room for a heading, and its (count, columns) axes over one time axis."""
    figure = new_figure(width_in, height_in)
    axes = figure.subplots(count, columns, sharex=True, squeeze=False)
    place(figure, hspace=0.2 if count > 1 else 0.0, wspace=wide)
    for ax in axes[-1]:
        ax.set_xlabel(TIME)
    return figure, axes


def place(figure: Any, *, hspace: float, wspace: float) -> None:
    """Set the margins, which are fixed in inches, whatever the size of the figure."""
    width, height = figure.get_size_inches()
    figure.subplots_adjust(
        left=0.82 / width,
        right=1.0 - 0.25 / width,
        bottom=0.52 / height,
        top=1.0 - (_HEAD_IN + 0.3) / height,
        hspace=hspace,
        wspace=wspace,
    )


def heading(figure: Any, number: str, title: str, case: str, vehicle: str, flights: Sequence[Flown]) -> None:
    """Draw the heading: number and title as in the thesis, case and vehicle, and when a flight was lost."""
    width, height = figure.get_size_inches()
    figure.text(
        0.25 / width, 1.0 - 0.26 / height, f"{number}  {title}", fontsize=12.5, weight="bold", va="center"
    )
    words = [CASE_NAMES[case], VEHICLE_NAMES[vehicle]] if vehicle else [CASE_NAMES[case]]
    figure.text(0.25 / width, 1.0 - 0.52 / height, " · ".join(words), fontsize=9.5, color=GREY, va="center")
    lost = [f"{name(flight)} lost after {flight.length_s:.1f} s" for flight in flights if flight.lost]
    if lost:
        figure.text(
            1.0 - 0.25 / width,
            1.0 - 0.52 / height,
            ", ".join(lost),
            fontsize=9.5,
            color=RED,
            weight="bold",
            ha="right",
            va="center",
        )


def name(flight: Flown) -> str:
    """NGC or LQR."""
    return "NGC" if flight.experiment.law == "thesis" else "LQR"


def line(ax: Any, flight: Flown, time_s: Floats, values: Floats, **how: Any) -> None:
    """Draw the values recorded between the beginning of the signals and the end."""
    seen = flight.seen(time_s)
    draw(ax, flight.clock(time_s[seen]), values[seen], **how)


def components(
    ax: Any, flight: Flown, time_s: Floats, values: Floats, labels: Sequence[str], least: float
) -> None:
    """Draw the x, y and z component of a vector in one panel."""
    for i, label in enumerate(labels):
        line(ax, flight, time_s, values[:, i], color=COMPONENTS[i], linewidth=1.4, label=label)
    least_range(ax, least)


def least_range(ax: Any, least: float) -> None:
    """Make the vertical axis span at least `least`, so that rounding errors do not fill the panel."""
    low, high = ax.get_ylim()
    if high - low < least:
        middle = 0.5 * (low + high) if abs(low + high) > 0.2 * least else 0.0
        ax.set_ylim(middle - 0.5 * least, middle + 0.5 * least)


def span(axes: Any, flights: Sequence[Flown]) -> None:
    """Set the time axis from the beginning of the signals to the end of the longest flight."""
    longest = max(flight.length_s for flight in flights)
    for ax in np.ravel(axes):
        ax.set_xlim(0.0, max(longest, 1e-3))


def titled(ax: Any, text: str, *, columns: int = 3, legend: bool = True) -> None:
    """Draw a panel's title, and its legend at the other end of the same line."""
    ax.set_title(text, fontsize=10.5)
    if legend:
        key(ax, columns)
