"""Missions that were found flyable before: this check takes longer than everything else before a flight.

Its result depends only on the sources, the mission and the vehicle. A mark of it is stored beside the marks
of what is compiled. Nothing heavy is imported here.
"""

from __future__ import annotations

import hashlib

from autopilot.geometry.machine_code import ROOT, is_marked, mark_ready
from autopilot.vehicle.file import belief_of
from autopilot.vehicle.shipped import VEHICLES
from gcs.workflows.flight_options import Settings
from missions.model import Mission
from missions.toml_files import FileError

_CHECK = ROOT / "gcs" / "workflows" / "flyable.py"  # imports all code that determines the result


def is_known_flyable(mission: Mission, vehicle: str, follows_shaped: bool, settings: Settings = ()) -> bool:
    """True if a check of this mission for this vehicle, with a law that follows shaped paths or not, and
    with these parameters of missions, has found no problem."""
    try:
        return is_marked(_CHECK, _mark_name(mission, vehicle, follows_shaped, settings))
    except FileError:  # of the vehicle's file, which the check will report
        return False


def mark_flyable(mission: Mission, vehicle: str, follows_shaped: bool, settings: Settings = ()) -> None:
    """Store for later flights that the check has found no problem."""
    mark_ready(_CHECK, (_mark_name(mission, vehicle, follows_shaped, settings),))


def _mark_name(mission: Mission, vehicle: str, follows_shaped: bool, settings: Settings) -> str:
    texts = [VEHICLES.read(one).text for one in (vehicle, belief_of(vehicle))]
    inputs = (mission.steps, mission.loop_ends, texts, follows_shaped, *settings)
    return f"flies-{hashlib.sha256(repr(inputs).encode()).hexdigest()[:16]}"
