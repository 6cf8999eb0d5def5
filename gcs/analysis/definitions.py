"""The figures of a flight record as `metrics.toml` defines them: their meaning, and their display."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

FILE = "metrics.toml"
UNKNOWN = "–"
_LOST = ("diverged", "lost")  # outcomes
_ONE_METRE = 1.0  # lengths of this or more are shown in metres, not in millimetres
_SIGNIFICANT, _MAX_DECIMALS = 3, 8


class _StrictModel(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Metric(_StrictModel):
    """One key of the record."""

    name: str
    group: str
    label: str = Field(min_length=1)
    text: str = Field(min_length=1)
    unit: str = ""
    shown: str | None = None
    scale: float = Field(1.0, gt=0.0)
    decimals: int | None = Field(None, ge=0)
    better: Literal["less", "more"] | None = None

    def formatted(self, record: Mapping[str, Any]) -> str:
        """The recorded value as displayed, with its unit; an en dash if it is not known."""
        value = record.get(self.name)
        if value is None:
            return UNKNOWN
        if self.needs_metres(record):
            return f"{value:.2f} m"
        return self._with_unit(
            f"{value * self.scale:.{self.decimals}f}" if self.decimals is not None else str(value)
        )

    def formatted_alike(self, record: Mapping[str, Any], in_metres: bool) -> str:
        """The recorded value as displayed in a table of several flights: with at least three significant
        digits, lengths in metres if `in_metres`, else in millimetres."""
        value = record.get(self.name)
        if value is None or self.decimals is None:
            return self.formatted(record)
        if self._displayed_unit == "mm" and in_metres:
            return f"{_with_digits(value, 3)} m"
        return self._with_unit(_with_digits(value * self.scale, self.decimals))

    def needs_metres(self, record: Mapping[str, Any]) -> bool:
        """Whether the value is a length of a metre or more that is otherwise displayed in millimetres."""
        value = record.get(self.name)
        return self._displayed_unit == "mm" and value is not None and abs(value) >= _ONE_METRE

    def _with_unit(self, text: str) -> str:
        unit = self._displayed_unit
        return f"{text} {unit}".rstrip() if unit != "°" else f"{text}{unit}"

    @property
    def _displayed_unit(self) -> str:
        return self.unit if self.shown is None else self.shown


def _with_digits(value: float, decimals: int) -> str:
    """The value with this many decimals, or with more if it needs them for three significant digits."""
    if value == 0.0:
        return f"{value:.{decimals}f}"
    needed = max(decimals, _SIGNIFICANT - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{needed}f}" if needed <= _MAX_DECIMALS else f"{value:.{_SIGNIFICANT - 1}e}"


def is_lost(record: Mapping[str, Any]) -> bool:
    """Whether the mission ended with the loss of the vehicle or its load, after which no path is followed."""
    return record.get("outcome") in _LOST


class Group(_StrictModel):
    """Figures that are shown together. `window` is the part of the flight that they cover, `window_if_failed`
    and `window_if_lost` that of a flight that failed or was lost, if it is another; `note` is for the
    documentation."""

    title: str
    window: str = ""
    window_if_failed: str = ""
    window_if_lost: str = ""
    note: str = ""

    def window_of(self, record: Mapping[str, Any]) -> str:
        """The part of this flight that the figures cover."""
        if record.get("failure_s") is not None:
            return self.window_if_failed or self.window
        return (self.window_if_lost if is_lost(record) else "") or self.window


class MetricFile(_StrictModel):
    """The whole file."""

    groups: dict[str, Group]
    headline: dict[str, str]
    metrics: dict[str, Metric]

    @model_validator(mode="before")
    @classmethod
    def _add_names(cls, document: dict[str, Any]) -> dict[str, Any]:
        metrics = {name: {"name": name, **table} for name, table in document["metrics"].items()}
        return {**document, "metrics": metrics}

    @model_validator(mode="after")
    def _check_references(self) -> MetricFile:
        for name, metric in self.metrics.items():
            if metric.group not in self.groups:
                raise ValueError(f"{name}.group = {metric.group}; must be one of {', '.join(self.groups)}")
        for name in self.headline:
            if name not in self.metrics:
                raise ValueError(f"headline.{name}: no such metric")
        return self

    def metrics_of(self, group: str) -> tuple[Metric, ...]:
        """The metrics of a group, in order."""
        return tuple(metric for metric in self.metrics.values() if metric.group == group)


_FILE = MetricFile.model_validate(tomllib.loads((files(__package__) / FILE).read_text(encoding="utf-8")))
METRICS: dict[str, Metric] = _FILE.metrics  # by key, in the order of the record
GROUPS: tuple[tuple[Group, tuple[Metric, ...]], ...] = tuple(
    (group, _FILE.metrics_of(name)) for name, group in _FILE.groups.items()
)
HEADLINE: dict[str, str] = _FILE.headline  # key: label at the top of the report


def covers_mission(metric: Metric) -> bool:
    """Whether the metric is one over the mission window, which a loss or a failure ends."""
    return bool(_FILE.groups[metric.group].window_if_lost)


def known_groups(record: Mapping[str, Any]) -> list[tuple[Group, list[Metric]]]:
    """The groups that a report shows, each with its known metrics. A group in which nothing happened (for
    example if no gust blew) is left out."""
    return [
        (group, [metric for metric in metrics if record.get(metric.name) is not None])
        for group, metrics in GROUPS
        if any(record.get(metric.name) for metric in metrics)
    ]
