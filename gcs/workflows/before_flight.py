"""Checks before any kind of flight: the options, and whether the vehicle can fly the mission."""

from __future__ import annotations

from autopilot.vehicle.shipped import VEHICLES
from gcs.errors import GcsError
from gcs.foreign_mission import ForeignMission
from gcs.shell.display import notify_if_slow
from gcs.workflows.flight_options import FlightOptions, parse_setting
from gcs.workflows.flyable_marks import is_known_flyable
from missions.model import Mission, Waypoint, Winch
from sitl.sensors.shipped import PROFILES

_FIXED_CABLE_LAW = "lqr"  # flies one length of the cable
CHECKING_TEXT = "checking whether the vehicle can fly it; paths that are hard to shape take a while"


def check_options(options: FlightOptions) -> list[str]:
    """GcsError if there is no such vehicle or sensor profile, if a parameter cannot have its value, or if
    custom code cannot fly; else a line for each option that may be unintended."""
    if _only_shipped_inputs(options):
        return []
    from gcs.workflows.flight_inputs import (
        check_flight_inputs,
        sensor_warnings,
        setting_warnings,
        vehicle_warnings,
    )
    from gcs.workflows.unused_settings import unused_settings

    settings = list(map(parse_setting, options.settings))
    check_flight_inputs(options.vehicle, options.sensors, settings, options.own, options.ignored)
    warnings = [f"--set {line}" for line in setting_warnings(options.vehicle, settings)]
    unused = unused_settings(options.vehicle, options.sensors, (options.law,), settings)
    warnings += [f"--set {line}" for line in unused.values()]
    warnings += vehicle_warnings(options.vehicle) + sensor_warnings(options.sensors)
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


def wind_warnings(mission: Mission, options: FlightOptions) -> list[str]:
    """A line for each thing that the vehicle lacks in the wind of the flight, which is flown nevertheless."""
    if options.firmware is not None or not any(s.startswith("SIM_WIND_") for s in options.settings):
        return []
    from gcs.workflows.check_mission import wind_problems  # loads much

    return wind_problems(mission, options)


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


def law_problem(mission: Mission, law: str) -> str:
    """Why every vehicle refuses to fly the mission with this law; an empty string if it does not."""
    winch = next((i for i, step in enumerate(mission.steps) if isinstance(step, Winch)), None)
    if law != _FIXED_CABLE_LAW or winch is None:
        return ""
    from gcs.mission_items import problem_in_file  # loads much

    text = f"items[{winch}] (winch): the law {law} flies one length of the cable; fly it with another law"
    return problem_in_file(winch, text, mission)


def check_law(mission: Mission, options: FlightOptions) -> None:
    """GcsError if the law cannot fly the mission, whether or not another check is waived."""
    if problem := law_problem(mission, options.law):
        raise GcsError(problem)


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
