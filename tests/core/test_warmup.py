"""After the rehearsal no kernel is left to be compiled in flight."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import sys
from numba.core.dispatcher import Dispatcher
from autopilot.guidance.legs import PathStretch
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as m
from missions.model import Takeoff, Waypoint
from tests.doubles.craft import ACCEPTED, Craft


def census():
    return {
        (k.py_func.__module__, k.py_func.__name__): len(k.signatures)
        for module in list(sys.modules.values())
        if getattr(module, "__name__", "").startswith(("autopilot.", "missions."))
        for k in vars(module).values()
        if isinstance(k, Dispatcher)
    }


def place():
    return m.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0x9F8, 1, 1, -2, *(0,) * 8)


def lean():
    return m.MAVLink_set_attitude_target_message(0, 1, 1, 7, [1, 0.02, 0, 0], 0, 0, 0, 0.5)


def stick():
    return m.MAVLink_manual_control_message(1, 500, 0, 500, 0, 0)


steps = Takeoff(2.0), Waypoint(1.0, 0.0, 2.0), Waypoint(1.0, 1.0, 2.0)
craft = Craft(*steps)
craft.onboard.warm_up()
craft.wait(1.0)
before = census()
assert len(before) > 100
assert craft.command(m.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 2.0) == ACCEPTED
assert craft.command(m.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
craft.run(lambda craft: craft.flight.phase == Phase.HOLD)
nan = float("nan")
for message, command in (
    (place, (m.MAV_CMD_DO_SET_MODE, 1.0, 6.0)),
    (lean, (m.MAV_CMD_DO_SET_MODE, 1.0, 6.0)),
    (stick, (m.MAV_CMD_DO_SET_MODE, 1.0, 3.0)),
    (stick, (m.MAV_CMD_DO_ORBIT, 2.0, 1.0, 0.0, 0.0, nan, nan, nan)),
    (stick, (m.MAV_CMD_DO_SET_MODE, 1.0, 4.0, 3.0)),
    (stick, (m.MAV_CMD_DO_SET_MODE, 1.0, 4.0, 4.0)),
    (stick, (m.MAV_CMD_NAV_LAND,)),
):
    for k in range(250):
        if k % 12 == 0:
            craft.send(message())
        if k == 24:
            assert craft.command(*command) == ACCEPTED, command
        else:
            craft.tick()
craft = Craft(*steps)
craft.begin()
craft.run(lambda craft: bool(craft.flight.legs) and isinstance(craft.flight.legs[0], PathStretch))
left = {name for name, count in census().items() if count != before.get(name, 0)}
assert not left, left
"""


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_no_kernel_is_compiled_in_flight() -> None:
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False, cwd=root
    )
    assert done.returncode == 0, done.stderr[-2000:]
