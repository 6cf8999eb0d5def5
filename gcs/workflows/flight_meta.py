"""The record of a flight beside its telemetry, which has no influence on the flight."""

from __future__ import annotations

import hashlib
from importlib.metadata import version
from typing import TYPE_CHECKING

from autopilot.own.estimator import load_estimator
from autopilot.own.law import law_name
from autopilot.own.planner import load_planner
from gcs.workflows.flight_options import FlightOptions, parse_setting

if TYPE_CHECKING:
    from gcs.analysis.record import FlightMeta
    from gcs.clients.flight import Outcome
    from missions.model import Mission


def _law_name(options: FlightOptions) -> str:
    return law_name(options.law) if options.firmware is None else options.firmware.kind


def _sources(options: FlightOptions) -> dict[str, str]:
    """Name and hash of the file of each custom class, by its kind: `my_law.py 1f0a3b9c`."""
    files = {loaded.role.lower(): loaded.path for loaded in options.own.load_classes()}
    return {
        role: f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()[:8]}"
        for role, path in files.items()
        if path is not None and path.is_file()
    }


def meta_of(
    mission: Mission, options: FlightOptions, outcome: Outcome, wall_s: float, truth_missing: str = ""
) -> FlightMeta:
    """The contents of meta.json: what is stored about a flight beside its telemetry."""
    from gcs.analysis.record import FlightMeta

    own = options.connect is None
    return FlightMeta(
        mission=options.mission,
        title=mission.title,
        law=_law_name(options) if own else None,
        estimator=load_estimator(options.estimator).name if options.estimator else None,
        planner=load_planner(options.planner).name if options.planner else None,
        sensors=options.sensors if own else None,
        vehicle=options.vehicle if own else None,
        seed=options.seed if own else None,
        outcome=outcome.name,
        reason=outcome.reason or None,
        truth_missing=truth_missing or None,
        wall_s=wall_s,
        command=options.command_line(),
        version=version("plumbline"),
        sources=_sources(options) if own else {},
        settings=dict(map(parse_setting, options.settings)),
    )
