"""flights/CASE-LAW-VEHICLE of the experiments: what lies there, and whether it need not be flown again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from gcs.batch.reuse import Origin, origin_of
from gcs.experiments.plan import SEED, SENSORS, Experiment
from gcs.folders import TLOG_FILE
from gcs.report.build import META_FILE, ReportError, load_meta

MARK_FILE = "flown.json"  # written when a flight is whole; says which code flew it
_WHOLE = ("completed", "diverged", "timeout")  # outcomes that say something about the experiment
# of the code that flies an experiment: `gcs fly` once it has read a mission file, and what it starts
ENTRIES = ("gcs.workflows.own_flight", "missions.fileformat", "sitl.__main__", "autopilot.__main__")


def experiment_origin(experiment: Experiment) -> Origin:
    """What an experiment follows from when it is flown now."""
    case, law, vehicle = experiment
    return origin_of(_settings(case, law, vehicle, SENSORS, SEED, {}), ENTRIES)


def is_flown(directory: Path, origin: Origin) -> bool:
    """True if `directory` holds a whole flight of this origin, with its telemetry."""
    try:
        mark = json.loads((directory / MARK_FILE).read_text(encoding="utf-8"))
        meta = load_meta(directory / META_FILE)
    except (OSError, json.JSONDecodeError, UnicodeDecodeError, ReportError):
        return False
    # settings and version are those of the record: another flight may have been flown into the directory
    settings = _settings(meta.mission, meta.law, meta.vehicle, meta.sensors, meta.seed, meta.settings)
    code = mark.get("code") if isinstance(mark, dict) else None
    stored = {"settings": settings, "version": meta.version, "code": code}
    return not origin.differences(stored) and meta.outcome in _WHOLE and (directory / TLOG_FILE).is_file()


def begin(directory: Path) -> None:
    """Before a flight: what lies there from an earlier one no longer counts."""
    directory.mkdir(parents=True, exist_ok=True)
    (directory / MARK_FILE).unlink(missing_ok=True)


def finish(directory: Path, origin: Origin) -> None:
    """After a flight that came to an end: it may be reused."""
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
