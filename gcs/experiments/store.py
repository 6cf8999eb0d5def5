"""flights/CASE-LAW-VEHICLE of the experiments: whether a flight stored there can be reused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from gcs.batch.reuse import Origin, origin_of
from gcs.experiments.plan import SEED, SENSORS, Experiment
from gcs.folders import TLOG_FILE
from gcs.report.build import META_FILE, ReportError, load_meta

MARK_FILE = "flown.json"  # written when a flight is complete; says which code flew it
_RESULT_OUTCOMES = ("completed", "diverged", "timeout")  # outcomes that are results of the experiment
# entry points of the code that flies an experiment: `gcs fly` from reading the mission file on, and the
# programs that it starts
ENTRIES = (
    "gcs.workflows.started_flight",
    "missions.fileformat",
    "sitl.shell.command",
    "autopilot.shell.command",
)


def experiment_origin(experiment: Experiment) -> Origin:
    """The origin of the result of an experiment that is flown now."""
    case, law, vehicle = experiment
    return origin_of(_settings(case, law, vehicle, SENSORS, SEED, {}), ENTRIES)


def is_flown(directory: Path, origin: Origin) -> bool:
    """True if `directory` contains a complete flight of this origin, with its telemetry."""
    try:
        mark = json.loads((directory / MARK_FILE).read_text(encoding="utf-8"))
        meta = load_meta(directory / META_FILE)
    except (OSError, json.JSONDecodeError, UnicodeDecodeError, ReportError):
        return False
    # settings and version are read from meta.json: another flight may have been flown into the directory
    settings = _settings(meta.mission, meta.law, meta.vehicle, meta.sensors, meta.seed, meta.settings)
    code = mark.get("code") if isinstance(mark, dict) else None
    stored = {"settings": settings, "version": meta.version, "code": code}
    return (
        not origin.differences(stored)
        and meta.outcome in _RESULT_OUTCOMES
        and (directory / TLOG_FILE).is_file()
    )


def prepare(directory: Path) -> None:
    """Prepare a flight: create `directory`, and invalidate an earlier flight in it."""
    directory.mkdir(parents=True, exist_ok=True)
    (directory / MARK_FILE).unlink(missing_ok=True)


def mark_complete(directory: Path, origin: Origin) -> None:
    """Mark a flight that has ended as reusable."""
    (directory / MARK_FILE).write_text(json.dumps({"code": origin.code}) + "\n", encoding="utf-8")


def _settings(
    mission: str | None,
    law: str | None,
    vehicle: str | None,
    sensors: str | None,
    seed: int | None,
    settings: dict[str, Any],
) -> dict[str, Any]:
    return {
        "mission": mission,
        "law": law,
        "vehicle": vehicle,
        "sensors": sensors,
        "seed": seed,
        "settings": settings,
    }
