"""Checks before any kind of flight: the options, and whether the vehicle can fly the mission."""

from __future__ import annotations

from autopilot.vehicle.shipped import VEHICLES
from gcs.shell.display import told_if_slow
from gcs.workflows.checked import known_flyable
from gcs.workflows.flight_options import FlightOptions, setting_of
from missions.model import Mission, Waypoint
from sitl.sensors.shipped import PROFILES

CHECKING = "checking whether the vehicle can fly it; paths that are hard to shape take a while"


def check_options(options: FlightOptions) -> list[str]:
    """GcsError if there is no such vehicle or sensor profile, if a parameter cannot have its value, or if
    custom code cannot fly; else a line for each option that may be unintended."""
    if _as_shipped(options):
        return []
    from gcs.workflows.flight_inputs import check_flight_inputs, doubts

    settings = list(map(setting_of, options.settings))
    check_flight_inputs(options.vehicle, options.sensors, settings, options.own)
    told = [f"--set {line}" for line in doubts(options.vehicle, settings)]
    if any(options.own):
        from autopilot.own.doubts import own_doubts

        told += own_doubts(options.own)
    return told


def planner_doubts(planner: str, mission: Mission) -> list[str]:
    """A line if the mission contains nothing for a custom planner to plan."""
    unused = without_planning(mission) if planner else ""
    return [f"--planner {planner}: {unused}"] if unused else []


def without_planning(mission: Mission) -> str:
    """The text for a planner that has nothing to plan in this mission; else empty."""
    if any(isinstance(step, Waypoint) for step in mission.steps):
        return ""
    return f"is not used: mission {mission.name} has no waypoints"


def _as_shipped(options: FlightOptions) -> bool:
    """Whether there is no option that could be refused; to check others, most of the simulator is loaded."""
    return (
        not any(options.own)
        and options.vehicle in VEHICLES.names()
        and options.sensors in PROFILES.names()
        and not options.settings
    )


def check_mission(mission: Mission, options: FlightOptions) -> None:
    """GcsError unless the vehicle can fly the mission, or the options waive this check."""
    if options.force or options.tries_anyway:
        return
    shaped = options.law == "plumbline"
    if not known_flyable(mission, options.vehicle, shaped):
        from gcs.workflows.check_mission import refuse_unflyable

        with told_if_slow(CHECKING, options.quiet):
            refuse_unflyable(mission, options.vehicle, shaped)
