"""What the vehicle would refuse of a mission, above all because of a fence: its supervisor is asked.

The supervisor decides, as before a flight, whether to arm, to take over the mission, and to start it. The
vehicle stands at home. Whether it can fly the mission is another question (`gcs.workflows.flyable`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from autopilot.geometry.linear import ZERO
from autopilot.services.requests import Arm, ReplaceMission, StartMission
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.requests.decide import decide
from autopilot.supervisor.requests.mission_checks import forbidden_rally_text
from autopilot.supervisor.requests.verdicts import ACCEPTED
from autopilot.supervisor.settings import settings_from
from autopilot.supervisor.state import Area, Flight, MissionPlan, View
from autopilot.trajectory.prepare import UNPREPARED, prepare
from autopilot.trajectory.route import Planner
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.wire.items import MissionItemError, located_steps
from gcs.foreign_mission import home_of
from gcs.mission_items import areas_of, items_of
from missions.model import Mission

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
    prepared = UNPREPARED
    if area.fence.zones or settings.fence.radius_m or settings.fence.height_m:  # may forbid a curve
        prepared = prepare(steps, sequence, settings.limits, planner=planner)
    count = len(items)
    flight = with_plan(Flight(area=area), MissionPlan(steps, sequence, count, prepared))

    def refusals(*requests: object) -> Iterator[str]:
        """The texts of those requests that would be refused."""
        for request in requests:
            _, verdict = decide(flight, request, _STANDS_AT_HOME, settings)
            if verdict.result != ACCEPTED.result:
                yield verdict.text or ""

    # what is wrong with the mission at upload usually also prevents its start: it is told once
    of_mission = next(refusals(ReplaceMission(count, located), StartMission(None)), None)
    found = (*refusals(Arm(True, False)), *([of_mission] if of_mission else []))
    warning = forbidden_rally_text(flight, settings)
    return Answer(found, (warning,) if warning else ())
