"""NGC solid, LQR dash-dot: load position and error (4-10 ...), percentage (4-11), angles (4-12 ...)."""

from __future__ import annotations

from typing import Any

import numpy as np

from gcs.analysis.axes import Floats, cable_angles, roll_pitch_yaw
from gcs.analysis.step import Step, find_step
from gcs.experiments.figures.canvas import (
    AXES,
    DESIRED,
    Scene,
    draw_heading,
    draw_line,
    draw_title,
    panels,
    set_min_range,
    set_time_axis,
)
from gcs.experiments.flight import ExperimentFlight
from gcs.report.style import GREY, draw

_TITLE = "Controller comparison. Solid: NGC, dash-dot: LQR"
_VEHICLE_ANGLES = (r"\phi", r"\theta", r"\psi")
_LOAD_ANGLES = (r"\phi_L", r"\theta_L")


def position(number: str, scene: Scene) -> Any:
    """(a) load position, actual and desired, (b) load position error."""
    figure, axes = panels(12.0, 6.6, 3, 2)
    for flight, line_style in scene.pair:
        s = flight.samples
        origin = s.desired_m[flight.signal_window(s.time_s)][:1]
        for i, axis in enumerate(AXES):
            draw_line(axes[i, 0], flight, s.time_s, (s.actual_m - origin)[:, i], **line_style)
            draw_line(axes[i, 1], flight, s.time_s, s.error_m[:, i], **line_style)
            axes[i, 0].set_ylabel(f"$x_L$ {axis} (m)")
            axes[i, 1].set_ylabel(f"$e_x$ {axis} (m)")
    longest = max((scene.ngc, scene.lqr), key=lambda flight: flight.duration_s)
    s = longest.samples
    desired = s.desired_m - s.desired_m[longest.signal_window(s.time_s)][:1]
    for i in range(3):
        draw_line(axes[i, 0], longest, s.time_s, desired[:, i], **DESIRED)
        set_min_range(axes[i, 0], 0.1)
        set_min_range(axes[i, 1], 0.05)
    draw_title(axes[0, 0], "(a) load position")
    draw_title(axes[0, 1], "(b) load position error")
    set_time_axis(axes, (scene.ngc, scene.lqr))
    draw_heading(figure, number, _TITLE, scene.case, scene.vehicle, (scene.ngc, scene.lqr))
    return figure


def percentage(number: str, scene: Scene) -> Any:
    """4-11: distance from the end of the step along its line, in percent of its height."""
    figure, axes = panels(9.0, 5.0, 1, 1)
    ax = axes[0, 0]
    step = _step(scene)
    for flight, line_style in scene.pair:
        if step is not None:
            draw(ax, *_percentage(flight, step), **line_style)
    for level, text in ((10.0, "90 % of the step"), (5.0, "5 % bound")):
        ax.axhline(level, color=GREY, linewidth=0.9, linestyle=":")
        ax.annotate(
            text,
            (1.0, level),
            xycoords=("axes fraction", "data"),
            xytext=(-4, 2),
            textcoords="offset points",
            ha="right",
            fontsize=8,
            color=GREY,
        )
    ax.set_ylim(0.0, min(max(110.0, ax.get_ylim()[1]), 200.0))
    ax.set_ylabel("load position error (% of the step)")
    draw_title(ax, "")
    set_time_axis(axes, (scene.ngc, scene.lqr))
    draw_heading(
        figure,
        number,
        "Load position error percentage. Solid: NGC, dash-dot: LQR",
        scene.case,
        scene.vehicle,
        (scene.ngc, scene.lqr),
    )
    return figure


def angles(number: str, scene: Scene) -> Any:
    """(a) vehicle attitude, (b) load attitude, both with respect to the world."""
    figure, axes = panels(12.0, 6.6, 3, 2)
    for flight, line_style in scene.pair:
        s = flight.samples
        vehicle = np.degrees(roll_pitch_yaw(s.quat_wxyz))
        load = np.degrees(cable_angles(flight.telemetry.load_truth.q_cable))
        for i, symbol in enumerate(_VEHICLE_ANGLES):
            draw_line(axes[i, 0], flight, s.time_s, vehicle[:, i], **line_style)
            axes[i, 0].set_ylabel(f"${symbol}$ (°)")
        for i, symbol in enumerate(_LOAD_ANGLES):
            draw_line(axes[i, 1], flight, s.time_s, load[:, i], **line_style)
            axes[i, 1].set_ylabel(f"${symbol}$ (°)")
    for ax in axes.flat:
        set_min_range(ax, 2.0)
    axes[2, 1].set_visible(False)  # a direction has two angles
    axes[1, 1].tick_params(labelbottom=True)
    axes[1, 1].set_xlabel(axes[2, 0].get_xlabel())
    draw_title(axes[0, 0], "(a) vehicle angles")
    draw_title(axes[0, 1], "(b) load angles")
    set_time_axis(axes, (scene.ngc, scene.lqr))
    draw_heading(figure, number, _TITLE, scene.case, scene.vehicle, (scene.ngc, scene.lqr))
    return figure


def _step(scene: Scene) -> Step | None:
    """The step that both flights had to fly, taken from one that reached its end; None if none did."""
    for flight in (scene.ngc, scene.lqr):
        s = flight.samples
        # include half a second of rest before it, because a step must begin at rest
        shown = (s.time_s >= flight.start_s - 0.5) & (s.time_s <= flight.end_s)
        step = find_step(s.time_s[shown], s.desired_m[shown], s.desired_m_s[shown])
        if step is not None:
            return step
    return None


def _percentage(flight: ExperimentFlight, step: Step) -> tuple[Floats, Floats]:
    """Times since the signals began, and the distance from the step's end along its line, percent of its
    height."""
    s = flight.samples
    window = flight.signal_window(s.time_s)
    along = (s.actual_m[window] - step.origin_m) @ step.direction
    return flight.since_start(s.time_s[window]), 100.0 * np.abs(along / step.height_m - 1.0)
