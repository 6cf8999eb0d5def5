"""Whether the vehicle that is to fly a mission can fly it, before it is uploaded."""

from __future__ import annotations

from collections.abc import Sequence

from autopilot.trajectory.feasibility import VehicleLimits, Violation, check
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import WireItem, decode_items
from gcs.errors import GcsError
from gcs.formats.missions import CheckedPlan
from gcs.mission_items import items_of
from gcs.workflows.flyable_marks import mark_flyable
from gcs.workflows.mission_file import load
from gcs.workflows.vehicle_limits import load_limits
from missions.model import Mission


def violations(mission: Mission, vehicle: str, limits: VehicleLimits, shaped: bool = True) -> list[Violation]:
    """What the vehicle with these limits cannot fly of the mission, with paths `shaped` by the autopilot or
    as requested.

    InputError if no vehicle would accept its items.
    """
    items_of(mission, Home())
    found = check(mission, limits, shaped)
    if not found:
        mark_flyable(mission, vehicle, shaped)
    return found


def load_checked(name_or_path: str, vehicle: str, force: bool) -> Mission:
    """The mission; GcsError unless the vehicle can fly it, which is not checked with `force`."""
    mission = load(name_or_path)
    if force:
        return mission
    require_flyable(mission, vehicle)
    return mission


def check_plan_items(name: str, checked: CheckedPlan, home: Home, vehicle: str) -> None:
    """GcsError unless the vehicle can fly the items of this file of another ground station."""
    try:
        require_flyable(mission_of(name, checked.items, home), vehicle)
    except GcsError as error:
        raise GcsError(*map(checked.numbers.in_step_text, error.lines)) from None


def mission_of(name: str, items: Sequence[WireItem], home: Home) -> Mission:
    """The mission of these items, at this home."""
    return Mission(name, name, "", (), decode_items(items, home))


def require_flyable(mission: Mission, vehicle: str, shaped: bool = True) -> None:
    """GcsError unless the vehicle can fly the mission."""
    found = violations(mission, vehicle, load_limits(vehicle), shaped)
    if found:
        summary = f"{mission.name} cannot be flown by vehicle {vehicle}; --force tries:"
        raise GcsError(*([f"{summary} {found[0]}"] if len(found) == 1 else [summary, *map(str, found)]))
