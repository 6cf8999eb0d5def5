"""Checks before any kind of flight: the options, and whether the vehicle can fly the mission."""

from __future__ import annotations

from autopilot.vehicle.shipped import VEHICLES
from gcs.foreign_mission import ForeignMission
from gcs.shell.display import notify_if_slow
from gcs.workflows.flight_options import FlightOptions, parse_setting
from gcs.workflows.flyable_marks import is_known_flyable
from missions.model import Mission, Waypoint
from sitl.sensors.shipped import PROFILES

CHECKING_TEXT = "checking whether the vehicle can fly it; paths that are hard to shape take a while"


def check_options(options: FlightOptions) -> list[str]:
    """GcsError if there is no such vehicle or sensor profile, if a parameter cannot have its value, or if
    custom code cannot fly; else a line for each option that may be unintended."""
    if _only_shipped_inputs(options):
        return []
    from gcs.workflows.flight_inputs import check_flight_inputs, setting_warnings, vehicle_warnings
    from gcs.workflows.unused_settings import unused_settings

    settings = list(map(parse_setting, options.settings))
    check_flight_inputs(options.vehicle, options.sensors, settings, options.own, options.ignored)
    warnings = [f"--set {line}" for line in setting_warnings(options.vehicle, settings)]
    unused = unused_settings(options.vehicle, options.sensors, (options.law,), settings)
    warnings += [f"--set {line}" for line in unused.values()]
    warnings += vehicle_warnings(options.vehicle)
    if any(options.own):
        from autopilot.own.misspellings import misspelling_warnings

        warnings += misspelling_warnings(options.own)
    return warnings


def mission_warnings(planner: str, mission: Mission) -> list[str]:
    """A line for each part of a mission that is not flown, and if it contains nothing for a custom planner to
    plan."""
    notes = mission.notes if isinstance(mission, ForeignMission) else ()
    lines = [f"{mission.name}: {note}" for note in notes]
    if planner and (unused := unused_planner_text(mission)):
        lines.append(f"--planner {planner}: {unused}")
    return lines


def unused_planner_text(mission: Mission) -> str:
    """The text for a planner that has nothing to plan in this mission; else empty."""
    if any(isinstance(step, Waypoint) for step in mission.steps):
        return ""
    return f"is not used: mission {mission.name} has no waypoints"


def _only_shipped_inputs(options: FlightOptions) -> bool:
    """Whether there is no option that could be refused; to check others, most of the simulator is loaded."""
    return (
        not any(options.own)
        and options.vehicle in VEHICLES.names()
        and options.sensors in PROFILES.names()
        and not options.settings
    )


def check_mission(mission: Mission, options: FlightOptions) -> None:
    """GcsError unless the vehicle can fly the mission, or the options waive this check."""
    if options.force or options.allows_infeasible:
        return
    follows_shaped = options.law == "plumbline"
    settings = options.mission_settings
    if not is_known_flyable(mission, options.vehicle, follows_shaped, settings):
        from gcs.workflows.flyable import require_flyable

        with notify_if_slow(CHECKING_TEXT, options.quiet):
            require_flyable(mission, options.vehicle, follows_shaped, settings)
