"""Comparison of several flights: what differed, figures with the best marked, tracks drawn in one scene."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gcs.analysis.definitions import GROUPS, METRICS, UNKNOWN, Group, Metric
from gcs.analysis.record import FlightMeta, Record, flight_record
from gcs.analysis.samples import AIRBORNE, MISSION, Samples, samples_of
from gcs.analysis.telemetry import load_telemetry
from gcs.analysis.tracks import Telemetry
from gcs.report.html import outcome_mood
from gcs.report.replay import Json, replay_of
from gcs.report.settings import changed_settings, unchanged_settings
from gcs.report.steps import step_texts
from gcs.web import PLOT_SCRIPTS, PLOT_STYLES, SCENE_SCRIPTS
from gcs.web.page import render

if TYPE_CHECKING:
    from rich.table import Table

_CONDITIONS = (
    "mission",
    "law",
    "estimator",
    "planner",
    "sensors",
    "vehicle",
    "seed",
)  # keys of the record that state how it was flown
_FILES = {f"{kind} file": kind for kind in ("law", "estimator", "planner")}  # rows: `FlightMeta.sources`
_MACHINE_DEPENDENT = {"wall_s", "real_time_factor"}  # depend on the machine, not on the flight: no best
STAR = "*: the best of the completed flights, and what is within 1 % of it."
DEFAULT = "default"  # shown for an unchanged parameter whose default is not known, as with a custom law
_LAW_PARAMETER = "CTL_LAW"  # the parameter that holds the law
_TOLERANCE = 0.01  # as a share of the best value: a smaller difference counts as none
_MAX_PARTS = 3  # of a label; further differences are in the table
STEPS = "mission steps"
_NOT_IN_LABELS = {STEPS}  # differences that labels do not mention
_HEADING = 14  # characters in a line of the name of a flight, in the terminal
_UNLIMITED = 10_000  # characters, more than any table has
_DRAWN_COLUMNS = {
    "load",
    "vehicle",
    "asked",
    "quat",
    "cable",
    "tension",
    "rotor",
    "taut",
    "attached",
    "scored",
}
SCRIPTS = (
    *PLOT_SCRIPTS,
    *SCENE_SCRIPTS,
    "charts.js",
    "flight_data.js",
    "transport.js",
    "stage.js",
    "compare.js",
)
STYLES = (*PLOT_STYLES, "page.css", "charts.css", "transport.css", "stage.css")


@dataclass(frozen=True)
class Run:
    """One of the flights."""

    name: str
    meta: FlightMeta
    telemetry: Telemetry
    samples: Samples
    record: Record


@dataclass(frozen=True)
class Difference:
    """Something that differs between the runs: its value in each run, and whether that is unchanged there."""

    name: str
    values: tuple[str, ...]
    unchanged: tuple[bool, ...]


@dataclass(frozen=True)
class Figure:
    """A figure as displayed for each run, and which runs have the best value; none if all are equal."""

    metric: Metric
    values: tuple[str, ...]
    best: tuple[int, ...]


def load_run(name: str, tlog: Path, meta: FlightMeta) -> Run:
    """A flight from its log."""
    telemetry = load_telemetry(tlog)
    samples = samples_of(telemetry)
    return Run(name, meta, telemetry, samples, flight_record(telemetry, meta, samples))


def differences(runs: Sequence[Run]) -> list[Difference]:
    """What differs in how the runs were flown, as far as it is known: first the given settings, then the
    parameters that followed from them."""
    rows: dict[str, list[str]] = {
        name: [_displayed(run.record[name]) for run in runs] for name in _CONDITIONS
    }
    for name, kind in _FILES.items():
        rows[name] = [_displayed(run.meta.sources.get(kind)) for run in runs]
    settings = [{s.name: s.value for s in changed_settings(run.telemetry, run.meta)} for run in runs]
    given = {name for run in runs for name in run.meta.settings}
    names = sorted(set().union(*settings), key=lambda name: (name not in given, name))
    defaults = [_unchanged(run, names) for run in runs]
    for name in names:
        rows[name] = [
            found.get(name, default[name]) for found, default in zip(settings, defaults, strict=True)
        ]
    if len(set(rows["law"])) > 1 and UNKNOWN not in rows["law"]:
        rows.pop(_LAW_PARAMETER, None)
    rows[STEPS] = _different_steps(runs)
    rows["version"] = [_displayed(run.meta.version) for run in runs]
    return [
        Difference(name, tuple(values), tuple(name in names and name not in found for found in settings))
        for name, values in rows.items()
        if len(set(values)) > 1
    ]


def _unchanged(run: Run, names: Sequence[str]) -> dict[str, str]:
    """The displayed values of these parameters in a run that did not change them. A vehicle that reported its
    parameters has no others: the value of any other is unknown."""
    if not (run.meta.command or run.telemetry.parameters):
        return dict.fromkeys(names, UNKNOWN)
    otherwise = UNKNOWN if run.telemetry.parameters else DEFAULT
    return {**dict.fromkeys(names, otherwise), **unchanged_settings(names, run.telemetry, run.meta)}


def figures(runs: Sequence[Run]) -> list[tuple[Group, list[Figure]]]:
    """The figures by group, without those that are unknown or 0 in all runs or state how it was flown. All
    lengths are in metres if one of them is a metre or more."""
    found = []
    same_mission = _are_of_one_mission(runs)
    in_metres = any(metric.needs_metres(run.record) for metric in METRICS.values() for run in runs)
    for group, metrics in GROUPS:
        rows = []
        for metric in metrics:
            if metric.name in _CONDITIONS or not any(run.record[metric.name] for run in runs):
                continue
            values = tuple(metric.formatted_alike(run.record, in_metres) for run in runs)
            rows.append(Figure(metric, values, _best(metric, runs, values) if same_mission else ()))
        if rows:
            found.append((group, rows))
    return found


def _are_of_one_mission(runs: Sequence[Run]) -> bool:
    """Whether the missions have one name or, where one file was named by different paths, the same steps."""
    names = {run.record["mission"] for run in runs}
    return len(names) == 1 or set(_different_steps(runs)) == {UNKNOWN}


def _best(metric: Metric, runs: Sequence[Run], displayed: Sequence[str]) -> tuple[int, ...]:
    """The runs with the best value or one that counts as equal (`_TOLERANCE` or the same when displayed),
    among the completed flights if there are any. Empty if all of these are equal."""
    completed = [i for i, run in enumerate(runs) if run.record["outcome"] == "completed"]
    rated = {
        i: value for i in completed or range(len(runs)) if (value := runs[i].record[metric.name]) is not None
    }
    if metric.better is None or metric.name in _MACHINE_DEPENDENT or not rated:
        return ()
    best = min(rated.values()) if metric.better == "less" else max(rated.values())
    best_texts = {displayed[i] for i, value in rated.items() if value == best}
    good = [
        i
        for i, value in rated.items()
        if abs(value - best) <= _TOLERANCE * abs(best) or displayed[i] in best_texts
    ]
    return tuple(good) if len(good) < len(rated) else ()


def given_conditions(runs: Sequence[Run]) -> set[str]:
    """The names of what was given for the flights; other parameters that differ follow from it."""
    return {*_CONDITIONS, *given_settings(runs)}


def given_settings(runs: Sequence[Run]) -> set[str]:
    """The names of the parameters that were set in at least one of the flights."""
    return {name for run in runs for name in run.meta.settings}


def labels(runs: Sequence[Run]) -> list[str]:
    """The label of each flight on the page, from what differs: `thesis, SIM_ACT_DELAY_MS=72`. The differences
    that tell the flights apart come first. If several flights have the same label, or none, the flight's name
    is added, which is that of its folder."""
    given = given_conditions(runs)
    all_differences = [one for one in differences(runs) if one.name not in _NOT_IN_LABELS]
    # the given settings, without the parameters that follow from them; if none differ, as with captured
    # flights, what the vehicle reported
    different = [one for one in all_differences if one.name in given] or all_differences
    rows = [
        tuple(
            _label_part(one.name, value, unchanged)
            for value, unchanged in zip(one.values, one.unchanged, strict=True)
        )
        for one in different
    ]
    telling = _telling_apart(rows)
    rows = telling + [row for row in rows if row not in telling]
    max_parts = max(_MAX_PARTS, len(telling))
    found = []
    for i in range(len(runs)):
        parts = [row[i] for row in rows if row[i]]
        more = f" and {len(parts) - max_parts} more" if len(parts) > max_parts else ""
        found.append(", ".join(parts[:max_parts]) + more)
    titles = [label or ("default settings" if different else "") for label in found]
    return [
        label if titles.count(label) == 1 else ", ".join(filter(None, (label, run.name)))
        for label, run in zip(titles, runs, strict=True)
    ]


def _telling_apart(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Those of the rows, a value for each flight, by which the flights are told apart, in the given order: at
    each turn the row is taken that tells the most of them apart."""
    chosen: list[tuple[str, ...]] = []

    def told_apart(taken: Sequence[tuple[str, ...]]) -> int:
        return len(set(zip(*taken, strict=True)))

    while others := [row for row in rows if row not in chosen]:
        best = max(others, key=lambda row: told_apart([*chosen, row]))
        if chosen and told_apart([*chosen, best]) == told_apart(chosen):
            break
        chosen.append(best)
    return [row for row in rows if row in chosen]


def _label_part(name: str, value: str, unchanged: bool) -> str:
    """A difference as part of a label; empty if the value is unchanged or unknown."""
    if unchanged or value == UNKNOWN:
        return ""
    if name in _FILES:
        return value
    if name in _CONDITIONS and name != "seed":
        return value.rsplit("/", 1)[-1]  # of a file, its name without the folder
    return f"{name} {value}" if name in ("seed", "version") else f"{name}={value}"


def comparison(runs: Sequence[Run]) -> Json:
    """As `gcs compare --json` prints it; `best` contains the indices of the best runs, from 0."""
    return {
        "runs": [
            {"name": run.name, "label": label, **{k: v for k, v in run.record.items() if k != "report_dir"}}
            for run, label in zip(runs, labels(runs), strict=True)
        ],
        "differences": {one.name: list(one.values) for one in differences(runs)},
        "best": {row.metric.name: list(row.best) for _, rows in figures(runs) for row in rows if row.best},
    }


def fits_in_columns(runs: Sequence[Run], width: int) -> bool:
    """Whether a terminal of this width, in characters, has room for a column for each flight."""
    from rich.console import Console

    return Console(width=_UNLIMITED).measure(comparison_table(runs)).maximum <= width


def comparison_table(runs: Sequence[Run]) -> Table:
    """For the terminal: differences first, then the figures, with a star at the best (see `STAR`)."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    for run in runs:
        table.add_column(Text(heading(run.name)), justify="right", no_wrap=True)
    different = differences(runs)
    for one in different:
        cells = [Text(heading(_shortened(value))) for value in one.values]
        table.add_row(Text(one.name), *cells, end_section=one is different[-1])
    for group, rows in figures(runs):
        table.add_row(Text(group.title, style="bold"))
        for row in rows:
            cells = [cell(value, i in row.best) for i, value in enumerate(row.values)]
            table.add_row(f"  {row.metric.label}", *cells, end_section=row is rows[-1])
    return table


def heading(name: str, max_chars: int = _HEADING) -> str:
    """A name broken between its parts into lines of up to `max_chars` characters; longer parts stay whole."""
    lines = [""]
    for part in re.findall(r"[^-_/. ]*[-_/. ]?", name):
        if lines[-1] and len(lines[-1] + part) > max_chars:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def cell(value: str, best: bool) -> Any:
    """A value in the terminal, with a star if it is the best."""
    from rich.text import Text

    return Text(f"* {value}", style="bold green") if best else Text(value)


def comparison_page(runs: Sequence[Run]) -> str:
    """The page: tables, all tracks in one scene, all errors in one plot."""
    start_name, times = common_start(runs)
    titles = labels(runs)
    found = figures(runs)
    return render(
        "gcs.report",
        "compare.html",
        SCRIPTS,
        STYLES,
        [_embedded(run, *one) for run, one in zip(runs, zip(times, titles, strict=True), strict=True)],
        start_name=start_name,
        runs=[
            {"name": run.name, "label": label, **_outcome_entry(run)}
            for run, label in zip(runs, titles, strict=True)
        ],
        differences=differences(runs),
        groups=[(group.title, rows) for group, rows in found],
        has_best=any(row.best for _, rows in found for row in rows),
    )


def _outcome_entry(run: Run) -> dict[str, str]:
    outcome = str(run.record["outcome"])
    return {"outcome": outcome, "mood": outcome_mood(outcome), "reason": run.meta.reason or ""}


def _embedded(run: Run, begin_s: float, label: str) -> Json:
    """The flight, and the time in it that is aligned with that of the other flights."""
    replay = replay_of(run.telemetry, run.samples, run.meta, _DRAWN_COLUMNS)
    return {**replay, "name": run.name, "label": label, "begin": begin_s}


def common_start(runs: Sequence[Run]) -> tuple[str, list[float]]:
    """The latest stage that all have begun (mission, flight or log), and the time when each began it."""
    for name, phases in (("mission", (MISSION,)), ("flight", AIRBORNE)):
        found = [_phase_start(run, phases) for run in runs]
        if all(time is not None for time in found):
            return name, [time for time in found if time is not None]
    return "log", [(run.telemetry.span_s or (0.0, 0.0))[0] for run in runs]


def _phase_start(run: Run, phases: tuple[int, ...]) -> float | None:
    setpoint = run.telemetry.setpoint
    times = setpoint.time_s[np.isin(setpoint.phase, phases)]
    return float(times[0]) if len(times) else None


def _different_steps(runs: Sequence[Run]) -> list[str]:
    """The steps of each mission without those at its beginning and end that are the same in all."""
    missions = [[step.text for step in step_texts(run.telemetry.mission, run.telemetry.home)] for run in runs]
    first = _common_length(missions)
    last = _common_length([list(reversed(steps[first:])) for steps in missions])
    return [
        "; ".join(f"{i + 1}. {steps[i]}" for i in range(first, len(steps) - last)) or UNKNOWN
        for steps in missions
    ]


def _common_length(lists: Sequence[Sequence[str]]) -> int:
    """The number of entries at the beginning that are the same in all lists."""
    return sum(1 for _ in takewhile(lambda entries: len(set(entries)) == 1, zip(*lists, strict=False)))


def _shortened(text: str, max_length: int = 60) -> str:
    return text if len(text) <= max_length else text[: max_length - 1] + "…"


def _displayed(value: Any) -> str:
    return UNKNOWN if value is None else str(value)
