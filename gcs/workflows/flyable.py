"""Whether the vehicle that is to fly a mission can fly it, before it is uploaded."""

from __future__ import annotations

from collections.abc import Iterator

from autopilot.trajectory.feasibility import VehicleLimits, Violation, check
from autopilot.trajectory.timeline import MissionState, TimelineEntry, cable_length_problem, timeline
from autopilot.vehicle.parameters import AutopilotParameters, autopilot_parameters, shapes_paths
from gcs.errors import GcsError
from gcs.foreign_mission import home_of
from gcs.mission_files import load
from gcs.mission_items import items_of, problem_in_file
from gcs.workflows.flight_options import Settings
from gcs.workflows.flyable_marks import mark_flyable
from gcs.workflows.slow_rotors import slow_rotor_violations
from gcs.workflows.vehicle_limits import load_limits, with_settings
from missions.model import Mission, Winch

CABLE_LENGTH = "cable length"  # the quantity of a violation


def winch_items(mission: Mission, table: AutopilotParameters) -> Iterator[tuple[TimelineEntry, Winch, float]]:
    """Each winch item, and the length of the cable after it."""
    usual_m_s = table["MIS_SPEED"]
    start = MissionState(cable_m=table["VEH_CABLE_LEN"], speed_m_s=usual_m_s, usual_speed_m_s=usual_m_s)
    for entry in timeline(mission.steps, start):
        if isinstance(entry.step, Winch) and entry.after.cable_m is not None:
            yield entry, entry.step, entry.after.cable_m


def winch_violations(mission: Mission, table: AutopilotParameters) -> Iterator[Violation]:
    """Winch items that request a cable length beyond the limits of the vehicle's winch; the vehicle would
    refuse the mission at its start."""
    min_m, max_m = table["WNC_LEN_MIN"], table["WNC_LEN_MAX"]
    for entry, _, length_m in winch_items(mission, table):
        problem = cable_length_problem(length_m, min_m, max_m)
        if problem:
            text = f"items[{entry.item}] (winch): {problem}: change length_m, or these of the vehicle"
            limit_m = min_m if length_m < min_m else max_m
            yield Violation(entry.item, CABLE_LENGTH, length_m, limit_m, entry.transfer_s, text)


def violations(
    mission: Mission,
    vehicle: str,
    limits: VehicleLimits,
    follows_shaped: bool = True,
    settings: Settings = (),
) -> list[Violation]:
    """What the vehicle with these limits, which `settings` have set, cannot fly of the mission, in the order
    of its steps. `follows_shaped`: with a law for which its autopilot shapes paths by default. Steps behind a
    winch that gives the cable an impossible length are not judged: what they break follows from it.

    InputError if no vehicle would accept its items.
    """
    items_of(mission, home_of(mission))
    table = with_settings(autopilot_parameters(limits.vehicle), settings)
    found = [
        *slow_rotor_violations(table),
        *check(mission, limits, shapes_paths(table, follows_shaped)),
        *list(winch_violations(mission, table))[:1],
    ]
    last = min((one.item for one in found if one.quantity == CABLE_LENGTH), default=len(mission.steps))
    found = sorted((one for one in found if one.item <= last), key=lambda one: one.item)
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
        texts = [problem_in_file(one.item, str(one), mission) for one in found]
        raise GcsError(*([f"{summary} {texts[0]}"] if len(texts) == 1 else [summary, *texts]))
