"""Desired paths (4-1 ... 4-4, 4-18) as sent by the autopilot, and the signals that they consist of (A-1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from autopilot.trajectory.signals import evaluate, signal_table
from gcs.analysis.axes import Floats
from gcs.experiments.figures.canvas import (
    AXES,
    COMPONENTS,
    TIME_LABEL,
    Scene,
    draw_heading,
    draw_line,
    draw_title,
    panels,
    set_margins,
    set_min_range,
    set_time_axis,
)
from gcs.report.style import BLUE, GREEN, INK, ORANGE, PURPLE, draw, new_figure
from missions.fileformat import load_mission
from missions.model import Signals, Sine, Term

_QUANTITIES = (
    ("position_m", "position (m)", 0.1),
    ("velocity_m_s", "velocity (m/s)", 0.1),
    ("acceleration_m_s2", "acceleration (m/s²)", 0.1),
)
_LETTERS = ("x_{L,d}", "v_{L,d}", "a_{L,d}")
_STEP_S = 0.01


def step_path(number: str, scene: Scene) -> Any:
    """4-1: position, velocity and acceleration along y."""
    figure, axes = panels(8.0, 6.4, 3, 1)
    _draw_along_y(axes[:, 0], scene)
    draw_heading(figure, number, "Desired load trajectory, y-direction", scene.case, "", ())
    return figure


def product_path(number: str, scene: Scene) -> Any:
    """4-2, 4-18: (a) two signals and their product, (b) position, velocity and acceleration along y."""
    figure, axes = panels(12.0, 6.4, 3, 2)
    _draw_along_y(axes[:, 1], scene)
    term = next(t for t in _signals(scene.case).terms if t.axis == "y")
    time_s = np.arange(0.0, scene.ngc.duration_s, _STEP_S)
    envelope = Term("y", 1.0, term.start_s, term.rise_s, term.hold_s, term.fall_s)
    first, *others = term.factors
    sine_step = Term("y", term.amplitude_m, *_term_timing(term), (first,))
    if others:
        parts = [
            ("C  Case B", _values(sine_step, time_s)),
            (f"D  sine of {_period(others[0])}", _sine(others[0], time_s)),
            ("E  product of C and D (m)", _values(term, time_s)),
        ]
    else:
        parts = [
            (f"A  sine of {_period(first)}", _sine(first, time_s)),
            ("B  smooth step up and down", _values(envelope, time_s)),
            ("C  product of A and B (m)", _values(sine_step, time_s)),
        ]
    for ax, (label, values), color in zip(axes[:, 0], parts, (ORANGE, GREEN, BLUE), strict=True):
        draw(ax, time_s, values, color=color, linewidth=1.4)
        draw_title(ax, f"Signal {label}", legend=False)
    axes[0, 1].set_title("Desired trajectory", fontsize=10.5)
    set_time_axis(axes, (scene.ngc,))
    draw_heading(figure, number, "Desired load trajectory, y-direction", scene.case, "", ())
    return figure


def position_in_space(number: str, scene: Scene) -> Any:
    """4-3: desired position over time, and in three dimensions."""
    figure = new_figure(12.0, 5.6)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.25))
    flight, setpoint = scene.ngc, scene.ngc.telemetry.setpoint
    window = flight.signal_window(setpoint.time_s)
    path = _relative_to_start(setpoint.position_m, window)
    for i, axis in enumerate(AXES):
        ax = figure.add_subplot(grid[i, 0])
        draw(ax, flight.since_start(setpoint.time_s[window]), path[:, i], color=COMPONENTS[i], linewidth=1.4)
        ax.set_ylabel(f"${axis}_{{L,d}}$ (m)")
        ax.set_xlim(0.0, flight.duration_s)
        if i < 2:
            ax.tick_params(labelbottom=False)
        else:
            ax.set_xlabel(TIME_LABEL)
    space = figure.add_subplot(grid[:, 1], projection="3d")
    space.plot(*path[::5].T, color=BLUE, linewidth=1.0)
    space.set_xlabel("x (m)", labelpad=14)
    space.set_ylabel("y (m)")
    space.set_zlabel("z (m)")
    space.set_zlim(-0.5, 0.5)
    space.set_box_aspect((3.2, 1.3, 0.9), zoom=1.15)
    space.view_init(elev=24, azim=-62)
    space.locator_params(axis="z", nbins=4)
    space.locator_params(axis="y", nbins=5)
    for axis in (space.xaxis, space.yaxis, space.zaxis):
        axis.set_pane_color((0.965, 0.97, 0.975, 1.0))
    set_margins(figure, hspace=0.2, wspace=0.02)
    draw_heading(figure, number, "Desired load position", scene.case, "", ())
    return figure


def velocity_and_acceleration(number: str, scene: Scene) -> Any:
    """4-4: desired velocity and acceleration in all directions."""
    figure, axes = panels(12.0, 6.4, 3, 2)
    setpoint = scene.ngc.telemetry.setpoint
    for column, (field, label, min_range) in enumerate(_QUANTITIES[1:]):
        values = getattr(setpoint, field)
        for i, axis in enumerate(AXES):
            ax = axes[i, column]
            draw_line(ax, scene.ngc, setpoint.time_s, values[:, i], color=COMPONENTS[i], linewidth=1.4)
            ax.set_ylabel(f"{axis} {label}")
            set_min_range(ax, min_range)
        draw_title(axes[0, column], f"Desired {label.split(' ', maxsplit=1)[0]}", legend=False)
    set_time_axis(axes, (scene.ngc,))
    draw_heading(figure, number, "Desired load velocity and acceleration", scene.case, "", ())
    return figure


def signals(number: str, scene: Scene) -> Any:
    """A-1: the signals of Case C, from which all trajectories are made."""
    figure, axes = panels(12.0, 5.2, 2, 2)
    terms: dict[str, Term] = {term.axis: term for term in _signals(scene.case).terms}
    x, y, z = (terms[axis] for axis in AXES)
    time_s = np.arange(0.0, scene.ngc.duration_s, _STEP_S)
    step_signal = Term("y", 1.0, *_term_timing(y))
    parts = (
        (f"A  x of Case C, half a period of {2.0 * x.rise_s:g} s (m)", _values(x, time_s), BLUE),
        (f"B  sine of {_period(y.factors[0])}", _sine(y.factors[0], time_s), ORANGE),
        (f"C  sine of {_period(z.factors[0])}", _sine(z.factors[0], time_s), GREEN),
        (f"D  up {y.rise_s:g} s, constant, down {y.fall_s:g} s", _values(step_signal, time_s), PURPLE),
    )
    for ax, (label, values, color) in zip(axes.flat, parts, strict=True):
        draw(ax, time_s, values, color=color, linewidth=1.2)
        draw_title(ax, f"Signal {label}", legend=False)
    set_time_axis(axes, (scene.ngc,))
    draw_heading(figure, number, "Signals for trajectory generation", scene.case, "", ())
    return figure


def _draw_along_y(axes: Sequence[Any], scene: Scene) -> None:
    flight, setpoint = scene.ngc, scene.ngc.telemetry.setpoint
    window = flight.signal_window(setpoint.time_s)
    time_s = flight.since_start(setpoint.time_s[window])
    for ax, letter, (field, label, _) in zip(axes, _LETTERS, _QUANTITIES, strict=True):
        values = getattr(setpoint, field)
        shown = _relative_to_start(values, window) if field == "position_m" else values[window]
        draw(ax, time_s, shown[:, 1], color=INK, linewidth=1.5)
        ax.set_ylabel(f"${letter}$ y {label[label.index('(') :]}")
    set_time_axis(axes, (flight,))


def _relative_to_start(position_m: Floats, window: slice) -> Floats:
    """Positions relative to the position when the signals began, as in the thesis."""
    shown = position_m[window]
    return shown - shown[:1]


def _signals(case: str) -> Signals:
    return next(step for step in load_mission(case).steps if isinstance(step, Signals))


def _term_timing(term: Term) -> tuple[float, float, float | None, float]:
    return term.start_s, term.rise_s, term.hold_s, term.fall_s


def _values(term: Term, time_s: Floats) -> Floats:
    table, axis = signal_table((term,)), AXES.index(term.axis)
    return np.array([evaluate(table, float(t))[0][axis] for t in time_s])


def _sine(sine: Sine, time_s: Floats) -> Floats:
    return np.asarray(np.sin(2.0 * np.pi * (time_s - sine.start_s) / sine.period_s + sine.phase_rad))


def _period(sine: Sine) -> str:
    return f"2π/{sine.period_s:g} rad/s"
