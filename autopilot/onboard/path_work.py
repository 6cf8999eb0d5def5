"""The paths of a mission as work that another process can do, and its result in the core of a flight."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from autopilot.core.flight_core import FlightCore
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.own.own_code import OwnSetup
from autopilot.own.planning import plan_function_for
from autopilot.supervisor.requests.mission_checks import curve_exit_problem, mission_begin, remaining_timeline
from autopilot.supervisor.state import Flight
from autopilot.supervisor.step_legs import following_legs
from autopilot.trajectory.prepare import AT_HOME, MissionBegin, PathLimits, PreparedPaths, prepare
from autopilot.trajectory.waypoint_path import PathSegment
from missions.model import LoadPath, Step


class PathWork(NamedTuple):
    """Paths of a mission to be prepared, as plain data, so that another process can do it."""

    steps: tuple[Step, ...]
    sequence: tuple[int, ...]
    limits: PathLimits
    home: Vec3 = ZERO  # destination of a return
    planner: OwnSetup | None = None  # custom planner
    begin: MissionBegin = AT_HOME
    loop_ends: tuple[int, ...] = ()

    def run(self) -> PreparedPaths:
        """The result; takes from a millisecond to some seconds."""
        planner = plan_function_for(self.planner)
        return prepare(self.steps, self.sequence, self.limits, self.home, planner, self.begin, self.loop_ends)

    def failure(self, why: str) -> PreparedPaths:
        """The result if the work failed."""
        return PreparedPaths(refusal=why, notes=(why,))


def path_work(core: FlightCore, now_us: int) -> PathWork:
    """The work for the mission of this flight: from where it would begin now if it waits for its paths, else
    from home."""
    return _path_work(core, begin_now(core, now_us) if core.flight.mission.waiting else AT_HOME)


def later_path_work(core: FlightCore, begin: MissionBegin) -> PathWork:
    """The work for a mission under way whose paths were prepared from `begin`, with the present setup."""
    state, usual_m_s = begin.state, core.setup.settings.limits.speed_m_s
    if state is not None:
        keeps_speed = state.speed_m_s != state.usual_speed_m_s
        speed_m_s = state.speed_m_s if keeps_speed else usual_m_s
        state = replace(state, speed_m_s=speed_m_s, usual_speed_m_s=usual_m_s)
    return _path_work(core, MissionBegin(begin.step, state))


def _path_work(core: FlightCore, begin: MissionBegin) -> PathWork:
    flight, setup = core.flight, core.setup
    plan, limits, home = flight.mission.plan, setup.settings.limits, flight.area.home
    return PathWork(plan.steps, plan.sequence, limits, home, setup.planner, begin, tuple(plan.loops))


def begin_now(core: FlightCore, now_us: int) -> MissionBegin:
    """Where the mission would begin now."""
    ahead = remaining_timeline(core.flight, core.view(now_us), core.settings)
    return mission_begin(core.flight, ahead, core.settings)


def use_paths(core: FlightCore, prepared: PreparedPaths) -> None:
    """Use the result of the work."""
    flight = core.flight
    plan = replace(flight.mission.plan, prepared=prepared)
    core.replace_flight(replace(flight, mission=replace(flight.mission, plan=plan)))


def use_later_paths(core: FlightCore, prepared: PreparedPaths, now_us: int) -> str:
    """Use the result for the other steps of a mission under way, whose present path is flown to its end;
    return a text for the operator."""
    flight, settings = core.flight, core.settings
    plan, kept = flight.mission.plan, _kept_steps(flight)
    if prepared.refusal:
        return f"Mission keeps its paths: {prepared.refusal}"
    pairs = enumerate(zip(plan.prepared.paths, prepared.paths, strict=True))
    paths = tuple(before if step in kept else after for step, (before, after) in pairs)
    changed_plan = replace(plan, prepared=replace(prepared, paths=paths))
    changed = replace(flight, mission=replace(flight.mission, plan=changed_plan))
    ahead = remaining_timeline(changed, core.view(now_us), settings)
    problem = curve_exit_problem(changed, ahead, settings)
    if problem:
        return f"Mission keeps its paths: {problem}"
    core.replace_flight(replace(changed, following=following_legs(changed, settings)))
    after = plan.next_step(max(kept))
    if after is None:
        return "Changed parameters apply to the next mission"
    return f"Changed parameters apply from mission item {plan.sequence[after]} on"


def _kept_steps(flight: Flight) -> set[int]:
    """The steps whose paths are kept while the present one is flown: the present one, those on the same path
    through waypoints, and signals that follow, for which its end is made."""
    mission = flight.mission
    steps, paths, loops = mission.plan.steps, mission.plan.prepared.paths, mission.plan.loops
    kept, path = {mission.step}, paths[mission.step]
    if isinstance(path, PathSegment):
        kept |= {i for i, one in enumerate(paths) if isinstance(one, PathSegment) and one.table is path.table}
    last = max(kept)
    while last not in loops and last + 1 < len(steps) and isinstance(steps[last + 1], LoadPath):
        last += 1
        kept.add(last)
    return kept
