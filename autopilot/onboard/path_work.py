"""The paths of a mission as work that another process can do, and its result in the core of a flight."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from autopilot.core.flight_core import FlightCore
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.own.own_code import OwnSetup
from autopilot.own.planning import plan_function_for
from autopilot.supervisor.requests.mission_checks import mission_begin, remaining_timeline
from autopilot.trajectory.prepare import AT_HOME, MissionBegin, PathLimits, PreparedPaths, prepare
from missions.model import Step


class PathWork(NamedTuple):
    """Paths of a mission to be prepared, as plain data, so that another process can do it."""

    steps: tuple[Step, ...]
    sequence: tuple[int, ...]
    limits: PathLimits
    home: Vec3 = ZERO  # destination of a return
    planner: OwnSetup | None = None  # custom planner
    begin: MissionBegin = AT_HOME

    def run(self) -> PreparedPaths:
        """The result; takes from a millisecond to some seconds."""
        planner = plan_function_for(self.planner)
        return prepare(self.steps, self.sequence, self.limits, self.home, planner, self.begin)

    def failure(self, why: str) -> PreparedPaths:
        """The result if the work failed."""
        return PreparedPaths(refusal=why, notes=(why,))


def path_work(core: FlightCore, now_us: int) -> PathWork:
    """The work for the mission of this flight: from where it would begin now if it waits for its paths, else
    from home."""
    flight, setup = core.flight, core.setup
    plan = flight.mission.plan
    begin = begin_now(core, now_us) if flight.mission.waiting else AT_HOME
    return PathWork(plan.steps, plan.sequence, setup.settings.limits, flight.area.home, setup.planner, begin)


def begin_now(core: FlightCore, now_us: int) -> MissionBegin:
    """Where the mission would begin now."""
    ahead = remaining_timeline(core.flight, core.view(now_us), core.settings)
    return mission_begin(core.flight, ahead, core.settings)


def use_paths(core: FlightCore, prepared: PreparedPaths) -> None:
    """Use the result of the work."""
    flight = core.flight
    plan = replace(flight.mission.plan, prepared=prepared)
    core.replace_flight(replace(flight, mission=replace(flight.mission, plan=plan)))
