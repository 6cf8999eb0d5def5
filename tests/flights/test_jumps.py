"""Items that jump: what is flown if another item is made the present one, and which item is then reported."""

from __future__ import annotations

from math import nan

import pytest

from autopilot.onboard.snapshot import CoreSnapshot
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from missions.model import Delay, Land, Step, Takeoff, Waypoint
from tests.doubles.craft import ACCEPTED, Craft, OfFlight, at_phase

SET_CURRENT = mavlink.MAV_CMD_DO_SET_MISSION_CURRENT
HEIGHT_M = 1.0
LAP: tuple[Step, ...] = (Takeoff(HEIGHT_M), Waypoint(1.0, 0.0, HEIGHT_M), Waypoint(0.0, 0.0, HEIGHT_M))
FIRST, SECOND, JUMP, BEHIND = range(1, 5)  # items: the two waypoints, the jump, what follows it


def jump(times: float) -> WireItem:
    return WireItem(
        mavlink.MAV_FRAME_MISSION, mavlink.MAV_CMD_DO_JUMP, 0, 1, FIRST, times, nan, nan, 0, 0, 0.0
    )


def current(craft: Craft) -> int:
    """The item of MISSION_CURRENT, which is the one that is flown."""
    seen = craft.onboard.log_sample().snapshot
    assert isinstance(seen, CoreSnapshot)
    mission = craft.flight.mission
    assert seen.mission_current == mission.plan.sequence[mission.step]
    return seen.mission_current


def waiting(times: float, step: int = 1) -> Craft:
    """A craft with this jump in its mission, which flies this step of it."""
    craft = Craft(*LAP, jump(times), Delay(1.0), Land())
    craft.begin()
    craft.run(OfFlight(lambda flight: flight.phase == Phase.MISSION and flight.mission.step == step))
    return craft


def rest_of(craft: Craft) -> list[int]:
    """The items that are reached until the landing."""
    craft.heard.clear()
    craft.run(at_phase(Phase.DISARMED), 120.0)
    reached = [m.seq for m in craft.heard if m.get_type() == "MISSION_ITEM_REACHED"]
    return reached[: reached.index(BEHIND + 1) + 1]


@pytest.mark.parametrize("message", [False, True])
def test_a_jump_that_becomes_the_present_item_is_taken(message: bool) -> None:
    craft = waiting(1.0)
    if message:
        craft.send(mavlink.MAVLink_mission_set_current_message(1, 1, JUMP))
        craft.tick()
    else:
        assert craft.command(SET_CURRENT, JUMP) == ACCEPTED
    assert (current(craft), craft.flight.mission.step) == (FIRST, 3)
    assert rest_of(craft) == [FIRST, SECOND, BEHIND, BEHIND + 1]


def test_one_that_was_taken_as_often_as_it_says_leads_to_the_item_behind_it() -> None:
    craft = waiting(1.0, step=3)
    assert craft.command(SET_CURRENT, JUMP) == ACCEPTED
    assert current(craft) == BEHIND


def test_one_without_end_leads_back() -> None:
    craft = waiting(-1.0, step=2)
    assert craft.command(SET_CURRENT, JUMP) == ACCEPTED
    assert (current(craft), craft.flight.mission.step) == (FIRST, 1)


@pytest.mark.parametrize("message", [False, True])
def test_one_without_end_is_left_for_the_items_behind_it(message: bool) -> None:
    craft = waiting(-1.0, step=2)
    craft.run(OfFlight(lambda flight: flight.mission.step == 1))
    if message:
        craft.send(mavlink.MAVLink_mission_set_current_message(1, 1, BEHIND))
        craft.tick()
    else:
        assert craft.command(SET_CURRENT, BEHIND) == ACCEPTED
    assert current(craft) == BEHIND
    assert rest_of(craft) == [BEHIND, BEHIND + 1]
    assert craft.flight.mission.done


def test_the_jumps_that_were_taken_stay_taken_unless_the_mission_is_reset() -> None:
    craft = waiting(1.0, step=4)
    assert craft.command(SET_CURRENT, FIRST) == ACCEPTED
    assert (current(craft), craft.flight.mission.step) == (FIRST, 3)
    assert craft.command(SET_CURRENT, FIRST, 1.0) == ACCEPTED
    assert (current(craft), craft.flight.mission.step) == (FIRST, 1)
    craft.run(OfFlight(lambda flight: flight.mission.step == 4))
    assert craft.command(SET_CURRENT, -1.0, 1.0) == ACCEPTED
    assert (current(craft), craft.flight.mission.step) == (SECOND, 2)
    assert rest_of(craft) == [SECOND, FIRST, SECOND, BEHIND, BEHIND + 1]


def test_behind_a_loop_its_items_are_those_of_the_last_lap() -> None:
    craft = waiting(1.0, step=5)
    assert current(craft) == BEHIND
    assert craft.command(SET_CURRENT, SECOND) == ACCEPTED
    assert rest_of(craft) == [SECOND, BEHIND, BEHIND + 1]


def test_a_mission_that_is_started_from_an_item_takes_all_its_jumps() -> None:
    craft = waiting(1.0, step=4)
    assert craft.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_MISSION_START, SECOND) == ACCEPTED
    assert (current(craft), craft.flight.mission.step) == (SECOND, 2)
