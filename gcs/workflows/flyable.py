"""Whether the vehicle that is to fly a mission can fly it, before it is uploaded."""

from __future__ import annotations

from autopilot.trajectory.feasibility import VehicleLimits, Violation, check
from autopilot.vehicle.parameters import autopilot_parameters, shapes_paths
from gcs.errors import GcsError
from gcs.foreign_mission import home_of
from gcs.mission_files import load
from gcs.mission_items import in_file_terms, items_of
from gcs.workflows.flight_options import Settings
from gcs.workflows.flyable_marks import mark_flyable
from gcs.workflows.vehicle_limits import load_limits, with_settings
from missions.model import Mission


def violations(
    mission: Mission,
    vehicle: str,
    limits: VehicleLimits,
    follows_shaped: bool = True,
    settings: Settings = (),
) -> list[Violation]:
    """What the vehicle with these limits, which `settings` have set, cannot fly of the mission.
    `follows_shaped`: with a law for which its autopilot shapes paths by default.

    InputError if no vehicle would accept its items.
    """
    items_of(mission, home_of(mission))
    table = with_settings(autopilot_parameters(limits.vehicle), settings)
    found = check(mission, limits, shapes_paths(table, follows_shaped))
    if not found:
        mark_flyable(mission, vehicle, follows_shaped, settings)
    return found


def load_checked(name_or_path: str, vehicle: str, force: bool) -> Mission:
    """The mission; GcsError unless the vehicle can fly it, which is not checked with `force`."""
    mission = load(name_or_path)
    if force:
        return mission
    require_flyable(mission, vehicle)
    return mission


def require_flyable(
    mission: Mission, vehicle: str, follows_shaped: bool = True, settings: Settings = ()
) -> None:
    """GcsError unless the vehicle can fly the mission, with these parameters of missions (MIS_) and of the
    assumed vehicle (VEH_)."""
    found = violations(mission, vehicle, load_limits(vehicle, settings), follows_shaped, settings)
    if found:
        changed = ", ".join(f"{name}={value:g}" for name, value in settings if name.startswith("VEH_"))
        which = f"{vehicle} with {changed}" if changed else vehicle
        summary = f"{mission.name} cannot be flown by vehicle {which}; --force tries:"
        texts = [in_file_terms(str(one), mission) for one in found]
        raise GcsError(*([f"{summary} {texts[0]}"] if len(texts) == 1 else [summary, *texts]))
