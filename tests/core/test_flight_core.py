"""What the flight software does around its compiled tick."""

from __future__ import annotations

from math import nan

import numpy as np
import pytest

from autopilot.core.flight_core import SETPOINTS_BRAKING
from autopilot.geometry.linear import norm
from autopilot.guidance.legs import Brake, PathStop
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import Land, Takeoff, Waypoint
from tests.doubles.craft import ACCEPTED, Craft

LOAD_TRACKER = 4.0  # of SIM_SENS_FAIL


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


def test_a_stop_is_not_laid_out_anew_while_the_supervisor_decides_at_every_tick() -> None:
    """As it does while the estimate is not good enough."""
    craft = Craft(Takeoff(1.5), Waypoint(6.0, 0.0, 1.5), Land())
    craft.begin()
    craft.run(lambda c: c.flight.phase == Phase.MISSION and norm(c.truth.v_load) > 0.8)
    lost = mavlink.MAVLink_param_set_message(
        1, 1, b"SIM_SENS_FAIL", LOAD_TRACKER, mavlink.MAV_PARAM_TYPE_REAL32
    )
    craft.send(lost)
    craft.run(lambda c: isinstance(c.flight.legs[0], Brake | PathStop))
    core, stop, ticks, computed = craft.onboard.core, craft.flight.legs[0], 0, 0
    while craft.flight.legs[0] is stop:
        now = stop.jet((craft.onboard.now_us - craft.flight.leg_start_us) * 1e-6)
        assert core.rows.targets[0].tolist() == np.ravel(now).tolist()
        computed += core.rows.targets.base is None
        craft.tick()
        ticks += 1
    assert ticks > 5 * SETPOINTS_BRAKING
    assert computed <= ticks / SETPOINTS_BRAKING + 1
