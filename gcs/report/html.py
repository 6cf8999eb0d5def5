"""report.html: a flight as replay, plots, figures and texts, in one file that loads no other."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

from gcs.analysis.definitions import HEADLINE, METRICS, Metric, covers_mission, is_lost, known_groups
from gcs.analysis.record import FlightMeta, Record
from gcs.report.plots import PICTURES, headline
from gcs.report.replay import Json
from gcs.report.settings import Setting
from gcs.web import PLOT_SCRIPTS, PLOT_STYLES, SCENE_SCRIPTS
from gcs.web.page import render

_MOODS = {"completed": "good", "diverged": "bad", "lost": "bad"}
SCRIPTS = (
    *PLOT_SCRIPTS,
    *SCENE_SCRIPTS,
    "charts.js",
    "flight_data.js",
    "transport.js",
    "stage.js",
    "plots.js",
    "replay.js",
)
STYLES = (*PLOT_STYLES, "page.css", "charts.css", "transport.css", "stage.css")


def render_page(
    record: Record, meta: FlightMeta, replay: Json, settings: list[Setting], directory: Path
) -> str:
    """The page of a flight; the picture that replaces the scene in print is read from `directory`."""
    outcome = str(record["outcome"])
    return render(
        "gcs.report",
        "report.html",
        SCRIPTS,
        STYLES,
        replay,
        headline=headline(meta),
        outcome=outcome,
        mood=outcome_mood(outcome),
        reason=meta.reason,
        truth_missing=meta.truth_missing,
        subtitle=_subtitle(record),
        figures=_figures(record, replay),
        groups=_groups(record),
        settings=settings,
        still=_picture(directory, PICTURES[0].file, PICTURES[0].caption),
        has_texts=bool(replay["texts"]),
        steps=bool(replay["steps"]),
        has_worst=replay["worst"] is not None,
        shows_estimate=replay["source"] == "estimate",
        command=meta.command,
        version=meta.version,
    )


def outcome_mood(outcome: str) -> str:
    """The style of an outcome: good, bad or wait."""
    return _MOODS.get(outcome, "wait")


def _subtitle(record: Record) -> str:
    names = ("mission", "law", "sensors", "vehicle", "seed")
    return " · ".join(f"{name} {record[name]}" for name in names if record[name] is not None)


def _figures(record: Record, replay: Json) -> list[Json]:
    """The main figures; `time` is that of the greatest load error, None for the other figures."""
    worst = replay["worst"]
    return [
        {
            "label": label + _until(METRICS[name], record),
            "value": METRICS[name].formatted(record),
            "time": worst["time"] if worst and name == "load_error_max_m" else None,
        }
        for name, label in HEADLINE.items()
        if record[name] is not None
    ]


def _until(metric: Metric, record: Record) -> str:
    """For a figure over the mission window of a flight that failed or was lost: where it ends."""
    over_mission = covers_mission(metric) and metric.name != "slack_events"
    if over_mission and record["failure_s"] is not None:
        return " until the failure"
    return " until the loss" if over_mission and is_lost(record) else ""


def _groups(record: Record) -> list[dict[str, Any]]:
    """The groups of figures, each with the figures that are known."""
    return [
        {
            "title": group.title,
            "window": group.window_of(record),
            "rows": [_row(metric, record) for metric in metrics],
        }
        for group, metrics in known_groups(record)
    ]


def _row(metric: Metric, record: Record) -> dict[str, str]:
    definition = f"{metric.name}: {metric.text}"
    return {"label": metric.label, "value": metric.formatted(record), "definition": definition}


def _picture(directory: Path, file: str, caption: str) -> dict[str, str]:
    return {"caption": caption, "data": base64.b64encode((directory / file).read_bytes()).decode("ascii")}
