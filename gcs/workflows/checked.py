"""Which missions were found flyable before: to find that takes longer than all else before a flight.

It follows from the sources, the mission and the vehicle alone. A mark of it is kept beside those of what is
compiled; nothing heavy is imported here.
"""

from __future__ import annotations

import hashlib

from autopilot.geometry.machine_code import ROOT, is_marked, mark_ready
from autopilot.vehicle.file import belief_of
from autopilot.vehicle.shipped import VEHICLES
from missions.model import Mission
from missions.toml_files import FileError

_CHECK = ROOT / "gcs" / "workflows" / "check_mission.py"  # which imports all that decides


def known_flyable(mission: Mission, vehicle: str, shaped: bool) -> bool:
    """True if a check of this mission by this vehicle, its paths shaped or not, has found nothing."""
    try:
        return is_marked(_CHECK, _part(mission, vehicle, shaped))
    except FileError:  # of the vehicle, which the check will tell
        return False


def note_flyable(mission: Mission, vehicle: str, shaped: bool) -> None:
    """Let later flights know."""
    mark_ready(_CHECK, (_part(mission, vehicle, shaped),))


def _part(mission: Mission, vehicle: str, shaped: bool) -> str:
    texts = [VEHICLES.read(one).text for one in (vehicle, belief_of(vehicle))]
    what = (mission.steps, texts, shaped)
    return f"flies-{hashlib.sha256(repr(what).encode()).hexdigest()[:16]}"
