"""Load position tracking (4-7, 4-13, 4-21): desired and actual motion, and their difference."""

from __future__ import annotations

from typing import Any

import numpy as np

from gcs.experiments.figures.canvas import (
    ACTUAL,
    AXES,
    COMPONENTS,
    DESIRED,
    Scene,
    draw_heading,
    draw_line,
    draw_title,
    panels,
    set_min_range,
    set_time_axis,
)


def tracking(number: str, scene: Scene) -> Any:
    """(a) position, (b) velocity and acceleration, desired and actual; (c) position and velocity error."""
    figure, axes = panels(13.0, 10.5, 5, 3, wspace=0.3)
    flight, samples, setpoint = scene.ngc, scene.ngc.samples, scene.ngc.telemetry.setpoint
    origin = samples.desired_m[flight.signal_window(samples.time_s)][:1]
    t = samples.time_s
    # the true acceleration is not sent; the true velocity has no noise, so it can be differentiated
    rate = np.gradient(samples.actual_m_s, t, axis=0)
    compared = (
        ("x_L", "(m)", t, samples.desired_m - origin, samples.actual_m - origin, 0.1),
        ("v_L", "(m/s)", t, samples.desired_m_s, samples.actual_m_s, 0.1),
    )
    for i, axis in enumerate(AXES):
        column = axes[:, i]
        for ax, (letter, unit, time_s, desired, actual, min_range) in zip(column[:2], compared, strict=True):
            draw_line(ax, flight, time_s, actual[:, i], **ACTUAL)
            draw_line(ax, flight, time_s, desired[:, i], **DESIRED)
            ax.set_ylabel(f"${letter}$ {axis} {unit}")
            set_min_range(ax, min_range)
        draw_line(column[2], flight, t, rate[:, i], **ACTUAL)
        draw_line(column[2], flight, setpoint.time_s, setpoint.acceleration_m_s2[:, i], **DESIRED)
        column[2].set_ylabel(f"$a_L$ {axis} (m/s²)")
        set_min_range(column[2], 1.0)
        for ax, values, letter, unit in (
            (column[3], samples.error_m, "e_x", "(m)"),
            (column[4], samples.error_m_s, "e_v", "(m/s)"),
        ):
            draw_line(ax, flight, t, values[:, i], color=COMPONENTS[1], linewidth=1.4)
            ax.set_ylabel(f"${letter}$ {axis} {unit}")
            set_min_range(ax, 0.02)
    for ax, text in zip(
        axes[:, 0],
        ("(a) position", "(b) velocity", "(b) acceleration", "(c) position error", "(c) velocity error"),
        strict=True,
    ):
        draw_title(ax, text, legend=False)
    draw_title(axes[0, 2], "", columns=2)
    set_time_axis(axes, (flight,))
    draw_heading(figure, number, "Load position tracking, NGC", scene.case, scene.vehicle, (flight,))
    return figure
