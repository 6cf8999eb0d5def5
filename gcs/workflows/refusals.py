"""What the vehicle would refuse of a mission, above all because of a fence: its supervisor is asked.

The supervisor decides, as before a flight, whether to arm, to take over the mission, and to start it. The
vehicle stands at home. Whether it can fly the mission is another question (`gcs.workflows.flyable`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, islice
from math import cos, pi, sin
from typing import NamedTuple

from autopilot.geometry.linear import ZERO
from autopilot.services.requests import Arm, ReplaceMission, StartMission
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.requests.decide import decide
from autopilot.supervisor.requests.mission_checks import forbidden_rally_text
from autopilot.supervisor.requests.verdicts import ACCEPTED
from autopilot.supervisor.settings import Settings, settings_from
from autopilot.supervisor.state import Area, Flight, MissionPlan, View, has_fence
from autopilot.trajectory.prepare import UNPREPARED, prepare
from autopilot.trajectory.route import Planner
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.wire.items import MissionItemError, endless_loops, located_steps
from gcs.foreign_mission import home_of
from gcs.mission_items import areas_of, items_of
from missions.model import Mission

# beside its path a load may be by this much, and the vehicle that swings it by a share of the cable more
_FENCE_MARGIN_M = 0.1
_LEAST_M = 1e-3  # of a fence, which with 0 there is none
_SIDES = 8
_STANDS_AT_HOME = View(0, ZERO, ZERO, ZERO, ZERO, False, 0.0, ())


class Answer(NamedTuple):
    """What the vehicle would refuse, and what it would warn of, in its words."""

    refusals: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def ask_supervisor(
    mission: Mission, table: AutopilotParameters, shaped: bool = True, planner: Planner | None = None
) -> Answer:
    """The answer of a vehicle with these parameters, whose law follows `shaped` paths or not; `planner` makes
    those through waypoints."""
    home = home_of(mission)
    items = items_of(mission, home)
    try:
        area = Area.of(areas_of(mission), home)
    except MissionItemError as error:
        return Answer((str(error),))
    settings = settings_from(table, ramp_lag_s=0.0, supports_reeling=True, follows_shaped=shaped)
    located = tuple(located_steps(items, home))
    steps, sequence = tuple(one.step for one in located), tuple(one.last for one in located)
    fenced = has_fence(Flight(area=area), settings)
    # a fence may forbid a curve
    loops = endless_loops(located)
    prepared = UNPREPARED
    if fenced:
        prepared = prepare(steps, sequence, settings.limits, planner=planner, loop_ends=loops)
    count = len(items)
    plan = MissionPlan(steps, sequence, count, prepared, loops=loops)
    flight = with_plan(Flight(area=area), plan)

    def refusals(flight: Flight, settings: Settings, *requests: object) -> Iterator[str]:
        """The texts of those requests that would be refused."""
        for request in requests:
            _, verdict = decide(flight, request, _STANDS_AT_HOME, settings)
            if verdict.result != ACCEPTED.result:
                yield verdict.text or ""

    # what is wrong with the mission at upload usually also prevents its start: it is told once
    of_mission = (ReplaceMission(count, located), StartMission(None))
    found = (
        *refusals(flight, settings, Arm(True, False)),
        *islice(refusals(flight, settings, *of_mission), 1),
    )
    warnings = [forbidden_rally_text(flight, settings)]
    if not found and fenced and settings.fence.action:
        margin_m = (
            _FENCE_MARGIN_M + settings.cable_length_m * settings.limits.accel_m_s2 / table["VEH_GRAVITY"]
        )
        nearer = (refusals(*near, *of_mission) for near in _nearer_fences(flight, settings, margin_m))
        way, leads, _ = next(chain.from_iterable(nearer), "").partition(" leads ")
        if leads:
            way = way.removeprefix("Mission denied: ")
            warnings.append(
                f"{way} leads within {margin_m:.1f} m of the fence: wind, or the vehicle that swings the "
                "load, may breach it, which interrupts the flight (GF_ACTION)"
            )
    return Answer(found, tuple(filter(None, warnings)))


def _nearer_fences(flight: Flight, settings: Settings, margin_m: float) -> Iterator[tuple[Flight, Settings]]:
    """The flight with its fence nearer by a distance from one side, from each of eight."""
    fence = settings.fence
    nearer = replace(
        fence,
        radius_m=fence.radius_m and max(fence.radius_m - margin_m, _LEAST_M),
        height_m=fence.height_m and max(fence.height_m - _FENCE_MARGIN_M, _LEAST_M),
    )
    for side in range(_SIDES):
        angle = 2.0 * pi * side / _SIDES
        moved = flight.area.fence.moved(margin_m * cos(angle), margin_m * sin(angle))
        yield replace(flight, area=replace(flight.area, fence=moved)), replace(settings, fence=nearer)
