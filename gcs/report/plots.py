"""The pictures of a report: those that the thesis shows of a flight in 4-4, drawn from telemetry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcs.analysis.axes import Floats, cable_angles, roll_pitch_yaw
from gcs.analysis.definitions import METRICS
from gcs.analysis.failure import after_failure
from gcs.analysis.record import FlightMeta, Record
from gcs.analysis.samples import CARRIED, Samples
from gcs.analysis.tracks import Telemetry
from gcs.report.missing import no_attitude_error_reason, no_error_reason
from gcs.report.replay import layout_of
from gcs.report.style import (
    AXES,
    BLUE,
    FAINT,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    RED,
    Target,
    draw,
    draw_failure,
    draw_legend,
    draw_phase_bands,
    flagged_spans,
    length_scale,
    new_axes_grid,
    new_figure,
    note,
    note_if_empty,
    phase_spans,
    rotor_colour,
    save,
)
from gcs.report.track import draw_track

_MIN_MARK_SHARE = (
    0.004  # of the width of the axes: the least width of a mark, so that a single sample is visible
)


@dataclass(frozen=True)
class View:
    """What the pictures are drawn from."""

    telemetry: Telemetry
    samples: Samples
    record: Record
    meta: FlightMeta

    @property
    def whole_flight(self) -> tuple[float, float]:
        """The time axis of the whole flight."""
        begin, end = self.telemetry.span_s or (0.0, 1.0)
        return begin, max(end, begin + 1e-3)

    @property
    def window(self) -> tuple[float, float]:
        """The time axis around the mission window, and after a failure to the end; the whole flight if it has
        no mission window."""
        inside = self.samples.time_s[self.samples.in_mission]
        if len(inside) < 2:
            return self.whole_flight
        # with some of the hold on both sides, but without lifting and lowering, which would set the scale
        margin = max(0.5, 0.03 * float(inside[-1] - inside[0]))
        time_s = self.samples.time_s
        near = (time_s >= inside[0] - margin) & (time_s <= inside[-1] + margin)
        carried = time_s[near & np.isin(self.samples.phase, CARRIED)]
        failed = self.record["failure_s"] is not None
        return float(carried[0]), self.whole_flight[1] if failed else float(carried[-1])

    @property
    def shown(self) -> NDArray[np.bool_]:
        """(n,) the mission window, and after a failure the flight until the load is set down; all of a flight
        without a mission window."""
        in_mission = self.samples.in_mission
        return self._until_set_down | in_mission if in_mission.any() else np.ones_like(in_mission)

    @property
    def _until_set_down(self) -> NDArray[np.bool_]:
        """(n,) after a failure, until the load is set down."""
        failed_s = self.record["failure_s"]
        return (
            np.zeros_like(self.samples.in_mission)
            if failed_s is None
            else after_failure(self.samples, failed_s)
        )

    @property
    def error_m(self) -> Floats:
        """(n, 3) true minus requested load position; NaN once the load was set down after a failure."""
        failed_s = self.record["failure_s"]
        if failed_s is None:
            return self.samples.error_m
        known = self.samples.in_mission | self._until_set_down | (self.samples.time_s < failed_s)
        return np.where(known[:, None], self.samples.error_m, np.nan)

    def note_if_unknown(self, ax: Any, errors: Floats) -> None:
        """Write into axes why they show no error of the load, if none of `errors` is known."""
        if not np.isfinite(errors).any():
            note(ax, no_error_reason(self.telemetry, self.samples))

    @property
    def rotors(self) -> Floats:
        """(n, 2) positions of the vehicle's rotors, forward and left."""
        return np.array(
            [(x, -y) for x, y, _ in (r["position"] for r in layout_of(self.meta.vehicle)["rotors"])]
        )

    def shade(self, axes: Any, limits: tuple[float, float] | None = None) -> None:
        """Draw the phases and a failure, and set the limits of the time axis, for axes above each other."""
        spans = phase_spans(self.telemetry.setpoint.time_s, self.telemetry.setpoint.phase)
        draw_phase_bands(list(axes), spans, limits or self.window)
        if self.record["failure_s"] is not None:
            draw_failure(list(axes), self.record["failure_s"])

    def visible(self, time_s: Floats) -> slice:
        """The samples inside the window, so that axes scale to what is visible."""
        begin, end = self.window
        return slice(int(np.searchsorted(time_s, begin)), int(np.searchsorted(time_s, end, side="right")))


def track(view: View, path: Target) -> None:
    """Load track in three dimensions."""
    figure = new_figure(9.0, 6.4)
    draw_track(
        figure, view.samples, view.shown, view.rotors, (0.0, 0.0, 0.88, 0.92), (0.925, 0.22, 0.014, 0.5)
    )
    figure.text(0.03, 0.945, "Load track", fontsize=12, weight="bold")
    lines = "dashed: desired · grey: cable, shadow, and the load while no position is asked for"
    if not view.samples.attached.all():
        lines += " · dotted: the vehicle after the release"
    figure.text(0.03, 0.908, lines, fontsize=9)
    save(figure, path)


def position(view: View, path: Target) -> None:
    """Desired and true position and velocity of the load per axis."""
    figure, axes = new_axes_grid(11.0, 6.2, 3, 2)
    s = view.samples
    visible = view.visible(s.time_s)
    columns = (
        ("position (m)", s.actual_m, s.desired_m),
        ("velocity (m/s)", s.actual_m_s, s.desired_m_s),
    )
    for column, (what, actual, desired) in enumerate(columns):
        for i, axis in enumerate(AXES):
            ax = axes[i, column]
            draw(ax, s.time_s[visible], actual[visible, i], color=BLUE, linewidth=1.8, label="true")
            draw(
                ax,
                s.time_s[visible],
                desired[visible, i],
                color=INK,
                linewidth=1.0,
                linestyle=(0, (4, 3)),
                label="desired",
            )
            ax.set_ylabel(f"{axis[0]} {what}" if column else f"{axis} (m)")
            _set_min_range(ax, 0.1)
            note_if_empty(ax)
        axes[0, column].set_title("Load " + what.split(" ")[0])
        view.shade(axes[:, column])
        draw_legend(axes[0, column])
    save(figure, path)


def error(view: View, path: Target) -> None:
    """Position and velocity error of the load per axis."""
    figure, axes = new_axes_grid(11.0, 6.2, 3, 2)
    s = view.samples
    visible = view.visible(s.time_s)
    # a load that was released is not followed by estimator and filter
    actual_m = np.where(s.attached[:, None], s.actual_m, np.nan)
    errors_m = view.error_m[visible]
    scale, unit = length_scale(
        errors_m if np.isfinite(errors_m).any() else (s.estimated_m - actual_m)[visible]
    )
    estimate_error, filtered = scale * (s.estimated_m - actual_m), scale * (s.filtered_m - actual_m)
    has_filter = bool(np.isfinite(filtered).any())  # a custom estimator flies, the built-in filter beside it
    columns = (
        ("position error", unit, scale * view.error_m),
        ("velocity error", f"{unit}/s", scale * s.error_m_s),
    )
    for column, (what, shown_unit, values) in enumerate(columns):
        for i, axis in enumerate(AXES):
            ax = axes[i, column]
            if column == 0:
                draw(
                    ax,
                    s.time_s[visible],
                    estimate_error[visible, i],
                    color=ORANGE,
                    linewidth=0.8,
                    alpha=0.8,
                    label="estimate − true",
                )
            if column == 0 and has_filter:
                shown = filtered[visible, i]
                draw(ax, s.time_s[visible], shown, color=GREEN, linewidth=0.8, label="built-in filter − true")
            draw(ax, s.time_s[visible], values[visible, i], color=BLUE, label="true − desired")
            if i == 0 or not ax.lines:  # once over the errors of the estimate
                view.note_if_unknown(ax, values[visible, i])
            ax.axhline(0.0, color=GREY, linewidth=0.7, zorder=1)
            ax.set_ylabel(f"{axis} ({shown_unit})")
            _set_min_range(ax, 1e-3 * scale)
        axes[0, column].set_title("Load " + what)
        view.shade(axes[:, column])
        draw_legend(axes[0, column])
    save(figure, path)


def angles(view: View, path: Target) -> None:
    """Cable angles and attitude of the vehicle, both true."""
    figure, axes = new_axes_grid(10.0, 5.6, 2)
    cable, vehicle = axes[:, 0]
    load, attitude = view.telemetry.load_truth, view.telemetry.attitude_truth
    visible = view.visible(load.time_s)
    cable_deg = np.degrees(cable_angles(load.q_cable[visible]))
    for i, (name, colour) in enumerate((("φ_L (towards y)", BLUE), ("θ_L (towards −x)", RED))):
        draw(cable, load.time_s[visible], cable_deg[:, i], color=colour, label=_math_text(name))
    visible = view.visible(attitude.time_s)
    vehicle_deg = np.degrees(roll_pitch_yaw(attitude.quat_wxyz[visible]))
    for i, (name, colour) in enumerate((("roll", BLUE), ("pitch", RED), ("yaw", GREEN))):
        draw(vehicle, attitude.time_s[visible], vehicle_deg[:, i], color=colour, label=name)
    for ax, title in ((cable, "Cable from vertical"), (vehicle, "Vehicle attitude")):
        ax.set_title(title)
        ax.set_ylabel("angle (°)")
        _set_min_range(ax, 1.0)
        note_if_empty(ax)
        draw_legend(ax)
    figure.subplots_adjust(hspace=0.3)
    view.shade((cable, vehicle))
    save(figure, path)


def psi(view: View, path: Target) -> None:
    """Error functions of vehicle attitude and load attitude."""
    figure, axes = new_axes_grid(10.0, 5.0, 2)
    cascade = view.telemetry.cascade
    visible = view.visible(cascade.time_s)
    for ax, values, name, what, colour in (
        (axes[0, 0], cascade.psi_R, "Ψ_R", "vehicle", BLUE),
        (axes[1, 0], cascade.psi_q, "Ψ_q", "load", RED),
    ):
        draw(ax, cascade.time_s[visible], values[visible], color=colour)
        ax.set_title(f"{what.capitalize()} attitude error function")
        ax.set_ylabel(_math_text(name))
        ax.set_ylim(bottom=0.0)
        note_if_empty(ax, no_attitude_error_reason(view.telemetry, what))
    figure.subplots_adjust(hspace=0.34)
    view.shade(axes[:, 0])
    save(figure, path)


def rotors(view: View, path: Target) -> None:
    """Commanded and true force of each rotor, its limits, and where a limit cut the command."""
    count = view.telemetry.rotors_truth.force_n.shape[1]
    lines = -(-count // 2)
    figure, axes = new_axes_grid(11.0, 2.9 * lines, lines, 2, share_y=True)
    for i, ax in enumerate(axes.flat):
        if i >= count:
            ax.set_visible(False)
            continue
        _rotor(view, ax, i)
        ax.set_title(f"Rotor {i + 1}")
    for ax in axes[:, 0]:
        ax.set_ylabel("force (N)")
    figure.subplots_adjust(hspace=0.26)
    view.shade(axes[:, 0])
    view.shade(axes[: count // 2, 1])
    draw_legend(axes[0, 1])
    save(figure, path)


def _rotor(view: View, ax: Any, i: int) -> None:
    true, commanded = view.telemetry.rotors_truth, view.telemetry.rotors_commanded
    visible = view.visible(commanded.time_s)
    t = commanded.time_s[visible]
    draw(ax, t, commanded.force_n[visible, i], color=FAINT, linewidth=0.8, label="command")
    of_truth = view.visible(true.time_s)
    draw(
        ax,
        true.time_s[of_truth],
        true.force_n[of_truth, i],
        color=rotor_colour(i),
        linewidth=1.2,
        label="true",
    )
    note_if_empty(ax)
    _limits(view, ax)
    cut = (commanded.saturated[visible] >> i & 1) == 1
    min_width_s = _MIN_MARK_SHARE * (view.window[1] - view.window[0])
    spans = flagged_spans(t, cut, min_width_s)
    if spans:
        ax.broken_barh(
            spans,
            (0.0, 1.0),
            transform=ax.get_xaxis_transform(),
            color=RED,
            alpha=0.35,
            linewidth=0.0,
            zorder=1.5,
            label="saturated",
        )


def _limits(view: View, ax: Any) -> None:
    """Draw the limits of a rotor, if there are any."""
    track = view.telemetry.rotors_commanded
    if not len(track.time_s):
        track = view.telemetry.rotors_truth
    ends = (track.force_min_n[-1:], track.force_max_n[-1:])
    limits = [float(limit) for limit in np.concatenate(ends) if np.isfinite(limit)]
    for limit, label in zip(limits, ("limit", None), strict=False):  # the legend needs one of them
        ax.axhline(limit, color=RED, linewidth=1.0, linestyle=(0, (5, 3)), zorder=2, label=label)


def tension(view: View, path: Target) -> None:
    """Cable tension over the whole flight, slack marked."""
    figure, axes = new_axes_grid(10.0, 3.6, 1)
    ax = axes[0, 0]
    load, s = view.telemetry.load_truth, view.samples
    draw(ax, load.time_s, load.tension_n, color=PURPLE, label="tension")
    begin, end = view.whole_flight
    slack = flagged_spans(load.time_s, load.taut == 0, _MIN_MARK_SHARE * (end - begin))
    if slack:
        ax.broken_barh(
            slack,
            (0.0, 0.035),
            transform=ax.get_xaxis_transform(),
            color=INK,
            alpha=0.75,
            linewidth=0.0,
            label="slack",
        )
    went_slack = np.append(False, np.diff(load.slack_events) != 0) & np.isin(s.phase, CARRIED)
    if went_slack.any():
        ax.plot(
            load.time_s[went_slack],
            np.full(int(went_slack.sum()), 0.08),
            transform=ax.get_xaxis_transform(),
            linestyle="",
            marker="v",
            color=RED,
            markersize=7,
            label="went slack while carried",
        )
    ax.set_title("Cable tension")
    ax.set_ylabel("tension (N)")
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    note_if_empty(ax)
    draw_legend(ax)
    view.shade((ax,), view.whole_flight)
    save(figure, path)


def overview(view: View, path: Target) -> None:
    """Track, error and rotors in one picture, as a summary."""
    figure = new_figure(13.0, 6.2)
    draw_track(
        figure, view.samples, view.shown, view.rotors, (0.0, 0.0, 0.475, 0.89), (0.503, 0.22, 0.009, 0.5)
    )
    s = view.samples
    above = figure.add_axes((0.605, 0.51, 0.38, 0.32))
    below = figure.add_axes((0.605, 0.095, 0.38, 0.32), sharex=above)
    visible = view.visible(s.time_s)
    error_m = view.error_m[visible]
    scale, unit = length_scale(error_m)
    for i, colour in enumerate((RED, BLUE, GREEN)):
        draw(above, s.time_s[visible], scale * error_m[:, i], color=colour, label=AXES[i][0])
    above.set_title("Load position error")
    above.set_ylabel(f"true − desired ({unit})")
    above.tick_params(labelbottom=False)
    true = view.telemetry.rotors_truth
    of_truth = view.visible(true.time_s)
    for i in range(true.force_n.shape[1]):
        draw(
            below,
            true.time_s[of_truth],
            true.force_n[of_truth, i],
            color=rotor_colour(i),
            linewidth=0.9,
            alpha=0.9,
            label=str(i + 1),
        )
    view.note_if_unknown(above, error_m)
    note_if_empty(below)
    for ax in (above, below):
        draw_legend(ax)
    _limits(view, below)
    below.set_title("Rotor forces and limits")
    below.set_ylabel("force (N)")
    below.set_xlabel("vehicle clock (s)")
    view.shade((above, below))
    figure.text(0.022, 0.93, headline(view.meta), fontsize=15, weight="bold")
    figure.text(0.022, 0.887, summary_line(view.record), fontsize=10, color=GREY)
    save(figure, path)


def headline(meta: FlightMeta) -> str:
    """The name of the flight."""
    return meta.title or meta.mission or "Flight"


def summary_line(record: Record) -> str:
    """The flight in one line."""
    parts = [str(record["outcome"])]
    parts += [
        f"{name} {record[name]}" for name in ("law", "vehicle", "sensors", "seed") if record[name] is not None
    ]
    worst, rms, failure, after = (
        METRICS[name].formatted(record)
        for name in ("load_error_max_m", "load_error_rms_m", "failure_s", "failure_error_max_m")
    )
    failed = record["failure_s"] is not None
    if record["load_error_max_m"] is not None:
        until = f" until the failure at {failure}" if failed else ""
        parts.append(f"load error{until} max {worst}, RMS {rms}")
    if record["failure_error_max_m"] is not None:
        parts.append(f"after it max {after}")
    if record["saturated_fraction"] is not None and not failed:
        parts.append(f"rotors saturated {100.0 * record['saturated_fraction']:.1f} %")
    return "  ·  ".join(parts)


def _math_text(name: str) -> str:
    """A letter with its subscript, Ψ_R, in the notation of matplotlib."""
    letters = {"Ψ": r"\Psi", "φ": r"\varphi", "θ": r"\theta"}
    symbol, _, rest = name.partition(" ")
    letter, _, index = symbol.partition("_")
    return f"${letters[letter]}_{index}$" + (f" {rest}" if rest else "")


def _set_min_range(ax: Any, min_range: float) -> None:
    """Make an axis span at least `min_range`, so that rounding noise does not fill the picture."""
    low, high = ax.get_ylim()
    if high - low < min_range:
        middle = 0.5 * (low + high)
        ax.set_ylim(middle - 0.5 * min_range, middle + 0.5 * min_range)


PICTURE_FORMATS = ("png", "pdf", "svg")


class Picture:
    """A picture's name, file name and caption, and the function that draws it in the format of its file."""

    def __init__(
        self, name: str, caption: str, draw_it: Callable[[View, Target], None], picture_format: str = "png"
    ) -> None:
        self.name = name
        self.file = f"{name}.{picture_format}"
        self.caption = caption
        self.draw = draw_it

    def as_format(self, picture_format: str) -> Picture:
        """The same picture as a file of one of `PICTURE_FORMATS`."""
        return Picture(self.name, self.caption, self.draw, picture_format)


PICTURES: tuple[Picture, ...] = (
    Picture("overview", "Track, load position error and rotor forces.", overview),
    Picture("track", "The load's path, coloured by its distance from the desired path.", track),
    Picture("position", "Position and velocity of the load, desired and true.", position),
    Picture("error", "Error of the load, and how far the autopilot's estimate is from the truth.", error),
    Picture(
        "angles",
        "Cable angles and vehicle attitude (truth); roll, pitch and yaw turn FLU into ENU.",
        angles,
    ),
    Picture("psi", "Error functions of the cascade, as the autopilot computes them; 0 to 2.", psi),
    Picture("rotors", "Rotor forces with their limits; red where a limit cut the command.", rotors),
    Picture("tension", "Cable tension over the whole flight; black where the cable is slack.", tension),
)
