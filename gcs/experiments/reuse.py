"""Which flights need not be flown again: same command, same settings, same version, same code."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from gcs.experiments.plan import SEED, SENSORS, Experiment
from gcs.report.build import META_FILE, ReportError, load_meta

MARK_FILE = "flown.json"  # written when a flight is whole; says which code flew it
TLOG_FILE = "flight.tlog"
_WHOLE = ("completed", "diverged", "timeout")  # outcomes that say something about the experiment
_FLIES = ("autopilot", "sitl", "missions", "gcs.clients")  # packages that decide what happens in a flight
_SOURCES = (".py", ".toml", ".xml")


def code_fingerprint() -> str:
    """A hash of every source and data file that decides what happens in a flight."""
    digest = hashlib.sha256()
    for package in _FLIES:
        for root in _roots(package):
            for path in sorted(p for p in root.rglob("*") if p.suffix in _SOURCES and p.is_file()):
                digest.update(f"{package}/{path.relative_to(root).as_posix()}\0".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _roots(package: str) -> Iterator[Path]:
    spec = find_spec(package)
    yield from (Path(place) for place in (spec.submodule_search_locations or () if spec else ()))


def is_flown(directory: Path, experiment: Experiment, code: str) -> bool:
    """True if `directory` holds this very flight, whole, flown by this version and this code."""
    try:
        mark = json.loads((directory / MARK_FILE).read_text(encoding="utf-8"))
        meta = load_meta(directory / META_FILE)
    except (OSError, json.JSONDecodeError, UnicodeDecodeError, ReportError):
        return False
    same = (
        (meta.mission, meta.law, meta.vehicle) == experiment
        and (meta.sensors, meta.seed, meta.settings) == (SENSORS, SEED, {})
        and meta.version == version("plumbline")
        and isinstance(mark, dict)
        and mark.get("code") == code
    )
    return same and meta.outcome in _WHOLE and (directory / TLOG_FILE).is_file()


def begin(directory: Path) -> None:
    """Before a flight: what lies there from an earlier one no longer counts."""
    directory.mkdir(parents=True, exist_ok=True)
    (directory / MARK_FILE).unlink(missing_ok=True)


def finish(directory: Path, code: str) -> None:
    """After a flight that came to an end: it may be reused."""
    (directory / MARK_FILE).write_text(json.dumps({"code": code}) + "\n", encoding="utf-8")
