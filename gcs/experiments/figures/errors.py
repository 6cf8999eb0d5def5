"""Error functions of the cascade (4-8, 4-14, 4-22) and the configuration errors (4-9, 4-15, 4-23)."""

from __future__ import annotations

from typing import Any

import numpy as np

from gcs.experiments.figures.canvas import (
    Scene,
    draw_components,
    draw_heading,
    draw_line,
    draw_title,
    panels,
    set_time_axis,
)
from gcs.experiments.results import ERROR_FUNCTIONS, decays, error_values
from gcs.report.style import BLUE, GREY, RED, draw

_FLOOR = 1e-12  # of a logarithmic axis

# column: title, (field, symbol, unit, least range) above and below
_FAMILIES = (
    ("(a) vehicle attitude", ("e_R", "e_R", "", 1e-3), ("e_Omega", r"e_\Omega", "(rad/s)", 0.1)),
    ("(b) load attitude", ("e_q", "e_q", "", 1e-2), ("e_q_dot", r"e_{\dot{q}}", "(1/s)", 0.1)),
    ("(c) load position", ("e_x", "e_x", "(m)", 0.02), ("e_v", "e_v", "(m/s)", 0.02)),
)


def error_functions(number: str, scene: Scene) -> Any:
    """e_R, e_Omega; e_q, e_q_dot; e_x, e_v, each with its three components."""
    figure, axes = panels(14.0, 6.2, 2, 3)
    flight, cascade = scene.ngc, scene.ngc.telemetry.cascade
    for column, (title, *pair) in enumerate(_FAMILIES):
        for ax, (field, symbol, unit, min_range) in zip(axes[:, column], pair, strict=True):
            labels = ["x", "y", "z"] if column else ["1", "2", "3"]
            draw_components(ax, flight, cascade.time_s, getattr(cascade, field), labels, min_range)
            ax.set_ylabel(f"${symbol}$ {unit}", fontsize=12)
        draw_title(axes[0, column], title)
    set_time_axis(axes, (flight,))
    draw_heading(figure, number, "Error functions, NGC", scene.case, scene.vehicle, (flight,))
    return figure


def configuration_errors(number: str, scene: Scene) -> Any:
    """Psi_R and Psi_q; below, on a logarithmic axis, with the fitted bound of (3-26) and (3-39)."""
    figure, axes = panels(12.0, 6.2, 2, 2)
    flight = scene.ngc
    found = decays(flight)
    for column, (name, symbol, title) in enumerate(
        (("psi_R", r"\Psi_R", "(a) vehicle attitude"), ("psi_q", r"\Psi_q", "(b) load attitude"))
    ):
        time_s, values = error_values(flight, name)
        above, below = axes[:, column]
        for ax in (above, below):
            ax.set_ylabel(f"${symbol}$")
            draw_line(ax, flight, time_s, values, color=BLUE, linewidth=1.4, label=f"${symbol}$")
        above.set_ylim(bottom=0.0)
        positive = values[values > _FLOOR]
        if positive.size:
            below.set_yscale("log")
            below.set_ylim(
                max(_FLOOR, 0.3 * float(np.percentile(positive, 0.5))), 5.0 * float(positive.max())
            )
        decay = found[name]
        if decay.rate_1_s is not None and decay.scale is not None:
            after = time_s >= flight.rest_s
            bound = decay.scale * np.exp(-decay.rate_1_s * (time_s[after] - flight.rest_s))
            # drawn only in the range in which it is fitted
            bound[bound < ERROR_FUNCTIONS[name][2] * values[after].max()] = np.nan
            label = rf"$\alpha e^{{-\beta t}}$, $\beta$ = {decay.rate_1_s:.2f} 1/s"
            draw(
                below,
                flight.since_start(time_s[after]),
                bound,
                color=RED,
                linewidth=1.2,
                linestyle="--",
                label=label,
            )
        below.axvline(flight.rest_s - flight.start_s, color=GREY, linewidth=0.8, linestyle=":")
        draw_title(above, title, legend=False)
        draw_title(below, "", columns=2)
    set_time_axis(axes, (flight,))
    draw_heading(figure, number, "Tracking error functions, NGC", scene.case, scene.vehicle, (flight,))
    return figure
