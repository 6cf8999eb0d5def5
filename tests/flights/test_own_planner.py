"""Custom path planners: their paths are flown, and what cannot be flown is reported beforehand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autopilot.own.own_code import OwnCode
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import Land, Takeoff, Waypoint
from plumbline.examples.minimum_snap import MinimumSnap
from plumbline.planners import Path as Planned
from plumbline.planners import Route, slower
from tests.doubles.craft import ACCEPTED, Craft, at_phase

CORNER = (Takeoff(1.0), Waypoint(1.5, 0.0, 1.0), Waypoint(1.5, 1.5, 1.5, hold_s=0.5), Land())
SLOW_DOWN = 1.0  # MIS_INFEASIBLE
TRACKED = 0.012  # m: measured 4 mm
NEAR = 0.05  # m of a waypoint


class Hasty(MinimumSnap):
    """Three times as fast as `MinimumSnap`, too fast for the vehicle."""

    def plan(self, route: Route) -> Planned:
        return slower(super().plan(route), 1.0 / 3.0)


class Fails(MinimumSnap):
    """Fails when it plans for this mission."""

    def plan(self, route: Route) -> Planned:
        if len(route.points) == 3 and abs(route.points[1][0] - 1.5) < NEAR:
            raise RuntimeError("no idea")
        return super().plan(route)


def craft(kind: type, **settings: Any) -> Craft:
    module = __file__ if kind.__module__ == __name__ else kind.__module__
    return Craft(*CORNER, own=OwnCode(planner=f"{module}:{kind.__name__}"), watched=True, **settings)


def test_its_path_is_flown_past_the_waypoint() -> None:
    flown = craft(MinimumSnap)
    flown.begin()
    passed: list[Any] = []

    def look(one: Craft) -> bool:
        passed.append(one.truth.x_load)
        return one.flight.phase == Phase.LOWER

    flown.run(look)
    beside = np.linalg.norm(np.array(passed) - (1.5, 0.0, 1.0), axis=1)
    assert beside.min() < NEAR
    assert flown.worst_error < TRACKED
    flown.run(at_phase(Phase.DISARMED))
    assert flown.texts[-1] == "Landed, disarmed"


@pytest.mark.parametrize(
    ("kind", "why"),
    [
        (Hasty, "item 1: a rotor would have to give "),
        (Fails, f"item 1: Planner Fails failed: RuntimeError: no idea ({Path(__file__).name}:"),
    ],
)
def test_what_cannot_be_flown_is_told_and_not_begun(kind: type, why: str) -> None:
    flown = craft(kind)
    flown.wait(3.0)
    flown.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    assert flown.command(mavlink.MAV_CMD_MISSION_START) != ACCEPTED
    assert why in "".join(flown.texts)
    assert flown.flight.phase in (Phase.DISARMED, Phase.ARMED)


def test_a_hasty_path_is_slowed_down_where_that_is_asked_for() -> None:
    flown = craft(Hasty, MIS_INFEASIBLE=SLOW_DOWN)
    prepared = flown.flight.mission.plan.prepared
    assert not prepared.refusal
    assert "Item 1 flown 2.20 times as long: a rotor would have to give " in "".join(prepared.notes)
