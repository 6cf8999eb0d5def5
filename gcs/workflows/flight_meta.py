"""What is kept of a flight beside its telemetry, and decides nothing in it."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING

from gcs.workflows.flight_options import FlightOptions, setting_of

if TYPE_CHECKING:
    from gcs.analysis.record import FlightMeta
    from gcs.clients.flight import Outcome
    from missions.model import Mission


def meta_of(mission: Mission, options: FlightOptions, outcome: Outcome, wall_s: float) -> FlightMeta:
    """What is kept of a flight beside its telemetry."""
    from gcs.analysis.record import FlightMeta

    own = options.connect is None
    return FlightMeta(
        mission=options.mission,
        title=mission.title,
        law=options.law if own else None,
        sensors=options.sensors if own else None,
        vehicle=options.vehicle if own else None,
        seed=options.seed if own else None,
        outcome=outcome.name,
        reason=outcome.reason or None,
        wall_s=wall_s,
        command=options.command_line(),
        version=version("plumbline"),
        settings=dict(map(setting_of, options.settings)),
    )
