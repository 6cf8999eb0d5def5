"""What the flight software does around its compiled tick."""

from __future__ import annotations

from math import nan

import pytest

from autopilot.core.flight_core import SETPOINTS_BRAKING
from autopilot.geometry.linear import norm
from autopilot.guidance.legs import Brake, PathStop
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import Land, Takeoff, Waypoint
from tests.doubles.craft import ACCEPTED, Craft


@pytest.mark.parametrize("command", ["hold", "return"])
def test_a_stop_is_laid_out_in_portions(command: str) -> None:
    """Stops that are commanded again and again must not cost the vehicle its ticks."""
    craft = Craft(Takeoff(1.5), Waypoint(6.0, 0.0, 1.5), Land(), sensors="ideal")
    craft.begin()
    craft.run(lambda c: c.flight.phase == Phase.MISSION and norm(c.truth.v_load) > 0.8)
    if command == "hold":
        assert craft.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    else:
        assert craft.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, nan) == ACCEPTED
    stop = craft.flight.legs[0]
    assert isinstance(stop, Brake | PathStop)
    portions = 0
    while craft.flight.legs[0] is stop:
        before = craft.onboard.core.rows.targets
        craft.tick()
        if craft.flight.legs[0] is stop:
            assert len(craft.onboard.core.rows.targets) <= SETPOINTS_BRAKING
            portions += craft.onboard.core.rows.targets is not before
    assert portions >= stop.duration_s / (SETPOINTS_BRAKING * 0.004) - 2.0
    assert norm(craft.truth.v_load) < 0.1
