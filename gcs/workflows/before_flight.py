"""What is looked at before a flight, however it is flown: the options, and whether the vehicle can fly it."""

from __future__ import annotations

from autopilot.vehicle.shipped import VEHICLES
from gcs.shell.display import told_if_slow
from gcs.workflows.checked import known_flyable
from gcs.workflows.flight_options import FlightOptions, setting_of
from missions.model import Mission, Waypoint
from sitl.sensors.shipped import PROFILES

CHECKING = "checking whether the vehicle can fly it; paths that are hard to shape take a while"


def check_options(options: FlightOptions) -> list[str]:
    """GcsError if there is no such vehicle or sensor profile, if a parameter cannot be set so, or if what
    somebody brings cannot fly; else a line for each option that may not be meant so."""
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
    """A line if the mission gives a planner of somebody's own nothing to plan."""
    unused = without_planning(mission) if planner else ""
    return [f"--planner {planner}: {unused}"] if unused else []


def without_planning(mission: Mission) -> str:
    """What is to be said of a planner for this mission if it has nothing to plan in it; else empty."""
    if any(isinstance(step, Waypoint) for step in mission.steps):
        return ""
    return f"is not used: mission {mission.name} has no waypoints"


def _as_shipped(options: FlightOptions) -> bool:
    """Nothing is asked for that could be refused; to know more, most of the simulator would be loaded."""
    return (
        not any(options.own)
        and options.vehicle in VEHICLES.names()
        and options.sensors in PROFILES.names()
        and not options.settings
    )


def check_mission(mission: Mission, options: FlightOptions) -> None:
    """GcsError unless the vehicle can fly it, or need not."""
    if options.force or options.tries_anyway:
        return
    shaped = options.law == "plumbline"
    if not known_flyable(mission, options.vehicle, shaped):
        from gcs.workflows.check_mission import refuse_unflyable

        with told_if_slow(CHECKING, options.quiet):
            refuse_unflyable(mission, options.vehicle, shaped)
