"""The record of a flight: the keys of `metrics.toml`, filled from telemetry."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from gcs.analysis import metrics
from gcs.analysis.definitions import METRICS
from gcs.analysis.samples import Samples, samples_of
from gcs.analysis.tracks import Telemetry

Record = dict[str, Any]

_DIGITS = 9  # wire values are single precision: further digits are noise of the conversion


@dataclass(frozen=True)
class FlightMeta:
    """What telemetry does not contain about a flight; stored as meta.json beside the log. None: not known."""

    mission: str | None = None
    title: str | None = None  # of the mission, for display
    law: str | None = None
    estimator: str | None = None  # custom estimator
    planner: str | None = None
    sensors: str | None = None
    vehicle: str | None = None
    seed: int | None = None
    outcome: str | None = None  # reported by the client that flew it; else judged from telemetry
    reason: str | None = None  # of that outcome, one line
    truth_missing: str | None = None  # why the log has no truth of the simulator, one line
    wall_s: float | None = None  # wall time over which the log was recorded
    command: str | None = None  # command line that repeats the flight
    version: str | None = None  # of Plumbline
    # name and hash of the file of each custom class: law, estimator, planner
    sources: dict[str, str] = field(default_factory=dict)
    settings: dict[str, float | str] = field(default_factory=dict)  # parameters that were changed

    def to_json(self) -> Record:
        """Plain JSON values, NaN as null."""
        return jsonable(asdict(self))

    @classmethod
    def from_json(cls, values: Record) -> FlightMeta:
        """The known keys of `values`; unknown keys, of later versions, are ignored."""
        known = {f.name for f in fields(cls)}
        return cls(**{name: value for name, value in values.items() if name in known and value is not None})


def flight_record(telemetry: Telemetry, meta: FlightMeta, samples: Samples | None = None) -> Record:
    """Every key of METRICS, in that order, then report_dir (None here); None for unknown values."""
    samples = samples_of(telemetry) if samples is None else samples
    outcome = meta.outcome or metrics.outcome_of(telemetry, samples)
    found: Record = {
        "mission": meta.mission,
        "law": meta.law,
        "estimator": meta.estimator,
        "planner": meta.planner,
        "sensors": meta.sensors,
        "vehicle": meta.vehicle,
        "seed": meta.seed,
        "outcome": outcome,
        **metrics.time_numbers(telemetry, meta.wall_s, outcome == "diverged"),
        **metrics.tracking_numbers(samples),
        **metrics.failure_numbers(telemetry, samples),
        **metrics.step_numbers(samples),
        **metrics.cascade_numbers(telemetry),
        **metrics.cable_numbers(telemetry, samples),
        **metrics.snap_numbers(telemetry),
        **metrics.gust_numbers(telemetry, samples),
        **metrics.rotor_numbers(telemetry),
        **metrics.battery_numbers(telemetry),
        **metrics.estimator_numbers(samples),
        **metrics.clock_numbers(telemetry),
        **metrics.coverage_numbers(samples),
    }
    return jsonable({**{name: found[name] for name in METRICS}, "report_dir": None})


def jsonable(values: Record) -> Record:
    """The values restricted to JSON: None for numbers that are not finite; floats rounded to nine digits."""
    return {name: _plain(value) for name, value in values.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return jsonable(value)
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
    return value
