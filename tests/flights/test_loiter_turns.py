"""NAV_LOITER_TURNS in the simulated world: the load flies its turns and hangs in their centre again."""

from __future__ import annotations

import math

from autopilot.onboard.onboard import mission_plan
from autopilot.services.mission_store import StoredMission
from autopilot.supervisor.state import Phase
from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.items import WireItem
from tests.doubles.craft import Craft
from tests.doubles.sky import SETTINGS


def test_turns() -> None:
    lat, lon, _ = geodetic_from_enu((0.0, 0.0, 0.0), Home())
    items = (
        WireItem(6, m.MAV_CMD_NAV_TAKEOFF, 0, 1, 0.0, 0.0, 0.0, 0.0, lat, lon, 2.0),
        WireItem(2, m.MAV_CMD_DO_CHANGE_SPEED, 0, 1, 1.0, 1.0, -1.0, 0.0, 0, 0, 0.0),
        WireItem(6, m.MAV_CMD_NAV_LOITER_TURNS, 0, 1, 1.0, 0.0, 1.5, 0.0, lat, lon, 2.0),
    )
    mission = StoredMission(items)
    assert not mission_plan(mission, Home(), SETTINGS.limits).prepared.refusal
    craft = Craft(*items)
    craft.begin()
    widest = 0.0

    def done(craft: Craft) -> bool:
        nonlocal widest
        if craft.flight.phase == Phase.MISSION:
            widest = max(widest, math.hypot(craft.truth.x_load[0], craft.truth.x_load[1]))
        return craft.flight.mission.done

    craft.run(done, 90.0)
    # measured 1.503 m and 2 mm
    assert 1.48 < widest < 1.53
    assert math.hypot(craft.truth.x_load[0], craft.truth.x_load[1]) < 0.03
    craft.tick()
    reached = [message.seq for message in craft.heard if message.get_type() == "MISSION_ITEM_REACHED"]
    assert reached == [0, 1, 2], "when the turns are flown, not where they begin"
