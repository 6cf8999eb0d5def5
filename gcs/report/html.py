"""report.html: one page with everything in it, pictures included, that asks for nothing from elsewhere."""

from __future__ import annotations

import base64
from importlib.resources import files
from pathlib import Path
from typing import Any

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.definitions import GROUPS, HEADLINE, METRICS, Metric
from gcs.analysis.record import FlightMeta, Record
from gcs.analysis.tracks import StatusText
from gcs.report.plots import PICTURES, headline

_TEMPLATE = "report.html"
_MOODS = {"completed": "good", "diverged": "bad", "lost": "bad"}
_LEVELS = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")


def render_page(record: Record, meta: FlightMeta, texts: tuple[StatusText, ...], directory: Path) -> str:
    """The page, from the pictures that lie in `directory`."""
    from jinja2 import Environment

    # the template is ours, every value is not: escape them all
    environment = Environment(autoescape=True, trim_blocks=False)
    source = files("gcs.report").joinpath(_TEMPLATE).read_text(encoding="utf-8")
    outcome = str(record["outcome"])
    return environment.from_string(source).render(
        headline=headline(meta),
        outcome=outcome,
        mood=_MOODS.get(outcome, "wait"),
        reason=meta.reason,
        subtitle=_subtitle(record),
        figures=_figures(record),
        groups=[{"title": group.title, "rows": _rows(metrics, record)} for group, metrics in GROUPS],
        settings=sorted(meta.settings.items()),
        pictures=[_picture(directory, picture.file, picture.caption) for picture in PICTURES],
        texts=[_text(text) for text in texts],
        command=meta.command,
        version=meta.version,
    )


def _subtitle(record: Record) -> str:
    names = ("mission", "law", "sensors", "vehicle", "seed")
    return " · ".join(f"{name} {record[name]}" for name in names if record[name] is not None)


def _figures(record: Record) -> list[dict[str, str]]:
    return [
        {"label": label, "value": METRICS[name].read(record)}
        for name, label in HEADLINE.items()
        if record[name] is not None
    ]


def _rows(metrics: tuple[Metric, ...], record: Record) -> list[dict[str, str]]:
    return [
        {"label": metric.label, "value": metric.read(record), "definition": f"{metric.name}: {metric.text}"}
        for metric in metrics
    ]


def _picture(directory: Path, file: str, caption: str) -> dict[str, str]:
    return {"caption": caption, "data": base64.b64encode((directory / file).read_bytes()).decode("ascii")}


def _text(text: StatusText) -> dict[str, Any]:
    known = 0 <= text.severity < len(_LEVELS)
    return {
        "time": f"{text.time_s:.2f} s",
        "level": _LEVELS[text.severity] if known else str(text.severity),
        "text": text.text,
        "loud": text.severity <= mavlink.MAV_SEVERITY_WARNING,
    }
