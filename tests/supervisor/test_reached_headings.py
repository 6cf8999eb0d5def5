"""Items that turn the nose are reported as reached, beside the steps with which they begin."""

from __future__ import annotations

import pytest

from autopilot.onboard.onboard import mission_plan
from autopilot.services.mission_store import StoredMission
from autopilot.services.requests import Arm, SetCurrent, StartMission, TurnHeading
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.quiescence import next_stretch
from autopilot.supervisor.state import Phase
from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.items import WireItem, encode_steps
from missions.model import Delay, Land, Step, Takeoff
from tests.doubles.sky import ACCEPTED, SETTINGS, Sky

UP, DOWN = Takeoff(2.0), Land()


def item(command: int, *p: float, x: int = 0, y: int = 0) -> WireItem:
    frame = m.MAV_FRAME_GLOBAL_INT if x else m.MAV_FRAME_MISSION
    return WireItem(frame, command, 0, 1, *(*p, 0.0, 0.0, 0.0, 0.0)[:4], x, y, 0.0)


NORTH, EAST = (item(m.MAV_CMD_CONDITION_YAW, degrees) for degrees in (0.0, 90.0))  # it points east at first
THERE = item(
    m.MAV_CMD_DO_SET_ROI_LOCATION, **dict(zip("xy", geodetic_from_enu((9.0, 9.0, 0.0), Home()), strict=False))
)
NOWHERE = item(m.MAV_CMD_DO_SET_ROI_NONE)


def started(*parts: Step | WireItem) -> Sky:
    items = [part if isinstance(part, WireItem) else encode_steps((part,), Home())[0] for part in parts]
    sky = Sky()
    plan = mission_plan(StoredMission(tuple(items)), Home(), SETTINGS.limits)
    sky.flight = with_plan(sky.flight, plan)
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    return sky


def landed(sky: Sky) -> list[int]:
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    return sky.reached


def test_a_place_to_look_at_is_reached_at_once_and_a_turn_when_the_nose_has_turned() -> None:
    sky = started(UP, Delay(1.0), THERE, NORTH, Delay(30.0), NOWHERE, Delay(1.0), DOWN)
    sky.run(lambda s: 2 in s.reached)
    assert sky.reached == [0, 1, 2]
    sky.run(lambda s: len(s.reached) == 4)
    assert sky.flight.heading.is_settled
    sky.tick()
    assert (sky.reached[-1], sky.flight.mission.step) == (3, 2), "while the step behind it is flown"
    assert landed(sky) == [0, 1, 2, 3, 4, 5, 6, 7]


def test_a_turn_that_is_replaced_is_not_reached() -> None:
    assert landed(started(UP, Delay(1.0), NORTH, Delay(0.3), EAST, Delay(30.0), DOWN)) == [0, 1, 3, 4, 5, 6]
    sky = started(UP, Delay(1.0), NORTH, Delay(30.0), DOWN)
    sky.run(lambda s: 1 in s.reached)
    sky.wait(0.3)
    assert sky.ask(TurnHeading(-1.0)).result == ACCEPTED
    assert landed(sky) == [0, 1, 3, 4]


def test_a_turn_that_goes_on_is_reached() -> None:
    """No place was looked at: there is nothing that would end."""
    assert landed(started(UP, Delay(1.0), NORTH, NOWHERE, Delay(30.0), DOWN)) == [0, 1, 3, 2, 4, 5]
    assert landed(started(UP, Delay(1.0), NORTH, THERE, Delay(30.0), DOWN)) == [0, 1, 3, 4, 5]


def test_a_turn_to_where_the_nose_points_is_reached_at_once() -> None:
    sky = started(UP, Delay(1.0), EAST, Delay(30.0), DOWN)
    sky.run(lambda s: 1 in s.reached)
    assert sky.reached == [0, 1, 2]


def test_behind_a_step_without_duration_no_item_is_left_out() -> None:
    assert landed(started(UP, THERE, Delay(0.0), NORTH, Delay(30.0), DOWN)) == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize(("aims", "reached"), [((THERE, NORTH), [0, 1, 2, 3]), ((NORTH, THERE), [0, 1, 3])])
def test_the_last_item_is_reached_last_and_once(aims: tuple[WireItem, ...], reached: list[int]) -> None:
    """The place replaces the turn before it, which then does not end."""
    sky = started(UP, Delay(1.0), *aims)
    sky.run(lambda s: s.flight.mission.done)
    sky.wait(20.0)
    assert sky.reached == reached


def test_what_a_request_begins_is_reported_at_the_next_tick() -> None:
    sky = started(UP, Delay(30.0), NOWHERE, Delay(30.0), DOWN)
    sky.run(lambda s: s.flight.phase == Phase.MISSION)
    sky.wait(1.0)
    assert next_stretch(sky.flight, SETTINGS, sky.now_us, 1, 0.0).stop_us > sky.now_us
    assert sky.ask(SetCurrent(3)).result == ACCEPTED
    assert next_stretch(sky.flight, SETTINGS, sky.now_us, 1, 0.0).stop_us == sky.now_us
    sky.tick()
    assert sky.reached == [0, 2]
    assert next_stretch(sky.flight, SETTINGS, sky.now_us, 1, 0.0).stop_us > sky.now_us
