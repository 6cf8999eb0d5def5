"""Control inputs (A-2 ... A-5): total force and rotor forces, moments about the body axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from gcs.experiments.figures.canvas import (
    COMPONENTS,
    TIME_LABEL,
    Scene,
    draw_heading,
    draw_line,
    set_margins,
    set_min_range,
    set_time_axis,
)
from gcs.experiments.figures.canvas import draw_title as _draw_title
from gcs.report.style import GREY, INK, new_figure, rotor_colour

_MOMENTS = (r"M_\phi", r"M_\theta", r"M_\psi")


def control_inputs(number: str, scene: Scene) -> Any:
    """On the left the total force and the commanded force of each rotor, on the right the moments."""
    flight = scene.ngc
    cascade, rotors = flight.telemetry.cascade, flight.telemetry.rotors_commanded
    figure = new_figure(13.0, 6.6)
    grid = figure.add_gridspec(6, 2)
    total, each = figure.add_subplot(grid[:3, 0]), figure.add_subplot(grid[3:, 0])
    moments = [figure.add_subplot(grid[2 * i : 2 * i + 2, 1]) for i in range(3)]
    draw_line(total, flight, cascade.time_s, cascade.thrust_n, color=INK, linewidth=1.4)
    total.set_ylabel("$f$ (N)")
    set_min_range(total, 2.0)
    _draw_title(total, "(a) total force", legend=False)
    for i in range(rotors.force_n.shape[1]):
        draw_line(
            each,
            flight,
            rotors.time_s,
            rotors.force_n[:, i],
            color=rotor_colour(i),
            linewidth=1.1,
            label=f"$F_{i + 1}$",
        )
    each.set_ylabel("rotor forces (N)")
    set_min_range(each, 1.0)
    _draw_title(each, "(b) forces per rotor", columns=4)
    window = flight.signal_window(rotors.time_s)
    for limit in (rotors.force_min_n[window], rotors.force_max_n[window]):
        if len(limit) and np.isfinite(limit[0]):
            each.axhline(float(limit[0]), color=GREY, linewidth=0.9, linestyle=":")
    for i, (ax, symbol) in enumerate(zip(moments, _MOMENTS, strict=True)):
        draw_line(ax, flight, cascade.time_s, cascade.moment_n_m[:, i], color=COMPONENTS[i], linewidth=1.2)
        ax.set_ylabel(f"${symbol}$ (N m)")
        set_min_range(ax, 0.02)
    _draw_title(moments[0], "(c) moments", legend=False)
    for ax in (total, *moments[:2]):
        ax.tick_params(labelbottom=False)
    for ax in (each, moments[2]):
        ax.set_xlabel(TIME_LABEL)
    set_time_axis([total, each, *moments], (flight,))
    set_margins(figure, hspace=1.1, wspace=0.2)
    draw_heading(figure, number, "Control inputs, NGC", scene.case, scene.vehicle, (flight,))
    return figure
