"""The common parts of all figures: panels over one time axis, line styles of both controllers, headings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gcs.analysis.axes import Floats
from gcs.experiments.flight import ExperimentFlight
from gcs.experiments.plan import CASE_NAMES, VEHICLE_NAMES
from gcs.report.style import BLUE, GREEN, GREY, INK, ORANGE, RED, draw, draw_legend, new_figure

AXES = "xyz"
COMPONENTS = (BLUE, ORANGE, GREEN)  # x, y, z
DESIRED: Any = {"color": INK, "linewidth": 1.1, "linestyle": (0, (4, 3)), "label": "desired"}
ACTUAL: Any = {"color": BLUE, "linewidth": 1.8, "label": "actual"}
# from figure 4-10 on: solid NGC, dash-dot LQR
NGC: Any = {"color": BLUE, "linewidth": 1.7, "label": "NGC"}
LQR: Any = {"color": RED, "linewidth": 1.5, "linestyle": (0, (6, 2, 1.2, 2)), "label": "LQR"}
TIME_LABEL = "time (s)"
_HEADING_IN = 0.72  # for title and subtitle


class Scene(NamedTuple):
    """The two flights of one case with one vehicle."""

    case: str
    vehicle: str
    ngc: ExperimentFlight
    lqr: ExperimentFlight

    @property
    def pair(self) -> tuple[tuple[ExperimentFlight, Any], tuple[ExperimentFlight, Any]]:
        """Each flight with its line style."""
        return (self.ngc, NGC), (self.lqr, LQR)


def panels(width_in: float, height_in: float, count: int, columns: int, *, wspace: float = 0.26) -> Any:
    """A figure with room for a heading, and its (count, columns) axes over one time axis."""
    figure = new_figure(width_in, height_in)
    axes = figure.subplots(count, columns, sharex=True, squeeze=False)
    set_margins(figure, hspace=0.2 if count > 1 else 0.0, wspace=wspace)
    for ax in axes[-1]:
        ax.set_xlabel(TIME_LABEL)
    return figure, axes


def set_margins(figure: Any, *, hspace: float, wspace: float) -> None:
    """Set the margins, which are fixed in inches, whatever the size of the figure."""
    width, height = figure.get_size_inches()
    figure.subplots_adjust(
        left=0.82 / width,
        right=1.0 - 0.25 / width,
        bottom=0.52 / height,
        top=1.0 - (_HEADING_IN + 0.3) / height,
        hspace=hspace,
        wspace=wspace,
    )


def draw_heading(
    figure: Any, number: str, title: str, case: str, vehicle: str, flights: Sequence[ExperimentFlight]
) -> None:
    """Draw the heading: number and title as in the thesis, case and vehicle, and when a flight was lost."""
    width, height = figure.get_size_inches()
    figure.text(
        0.25 / width, 1.0 - 0.26 / height, f"{number}  {title}", fontsize=12.5, weight="bold", va="center"
    )
    words = [CASE_NAMES[case], VEHICLE_NAMES[vehicle]] if vehicle else [CASE_NAMES[case]]
    figure.text(0.25 / width, 1.0 - 0.52 / height, " · ".join(words), fontsize=9.5, color=GREY, va="center")
    lost = [
        f"{controller_name(flight)} lost after {flight.duration_s:.1f} s" for flight in flights if flight.lost
    ]
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


def controller_name(flight: ExperimentFlight) -> str:
    """NGC or LQR."""
    return "NGC" if flight.experiment.law == "thesis" else "LQR"


def draw_line(ax: Any, flight: ExperimentFlight, time_s: Floats, values: Floats, **line_style: Any) -> None:
    """Draw the values recorded between the beginning of the signals and the end."""
    window = flight.signal_window(time_s)
    draw(ax, flight.since_start(time_s[window]), values[window], **line_style)


def draw_components(
    ax: Any, flight: ExperimentFlight, time_s: Floats, values: Floats, labels: Sequence[str], min_range: float
) -> None:
    """Draw the x, y and z component of a vector in one panel."""
    for i, label in enumerate(labels):
        draw_line(ax, flight, time_s, values[:, i], color=COMPONENTS[i], linewidth=1.4, label=label)
    set_min_range(ax, min_range)


def set_min_range(ax: Any, min_range: float) -> None:
    """Make the vertical axis span at least `min_range`, so that rounding errors do not fill the panel."""
    low, high = ax.get_ylim()
    if high - low < min_range:
        middle = 0.5 * (low + high) if abs(low + high) > 0.2 * min_range else 0.0
        ax.set_ylim(middle - 0.5 * min_range, middle + 0.5 * min_range)


def set_time_axis(axes: Any, flights: Sequence[ExperimentFlight]) -> None:
    """Set the time axis from the beginning of the signals to the end of the longest flight."""
    longest = max(flight.duration_s for flight in flights)
    for ax in np.ravel(axes):
        ax.set_xlim(0.0, max(longest, 1e-3))


def draw_title(ax: Any, text: str, *, columns: int = 3, legend: bool = True) -> None:
    """Draw a panel's title, and its legend at the other end of the same line."""
    ax.set_title(text, fontsize=10.5)
    if legend:
        draw_legend(ax, columns)
