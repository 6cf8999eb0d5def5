"""DroneKit's own first examples: `python dronekit_flight.py ADDRESS IDENTITY`; its observations as JSON.

With IDENTITY `px4` two things are left out: the download of an empty mission, for which DroneKit waits for
ever, and `vehicle.mode =`, in which it takes PX4's modes for numbers.
"""

from __future__ import annotations

import collections
import collections.abc
import json
import logging
import math
import sys
import threading
from collections.abc import Callable
from typing import Any

collections.MutableMapping = collections.abc.MutableMapping  # type: ignore[attr-defined]  # gone since 3.10

from dronekit import Command, LocationGlobalRelative, VehicleMode, connect  # noqa: E402

LONG_S = 120.0  # on a busy machine
DEGREE_M = 111_319.5
NAV_WAYPOINT, RELATIVE = 16, 3


def until(what: str, condition: Callable[[], Any]) -> None:
    turn = threading.Event()
    for _ in range(round(LONG_S / 0.1)):
        if condition():
            return
        turn.wait(0.1)
    sys.exit(f"in vain waited for: {what}")


def main(address: str, identity: str) -> None:
    ardupilot = identity == "ardupilot"
    logging.basicConfig(level=logging.INFO)  # its own log, and the texts of the vehicle
    vehicle = connect(address, wait_ready=True, heartbeat_timeout=15)
    until("is_armable", lambda: vehicle.is_armable)
    home = vehicle.location.global_frame
    told: dict[str, Any] = {"gps": vehicle.gps_0.fix_type, "battery": vehicle.battery.voltage}
    vehicle.parameters["MIS_SPEED"] = 1.25
    until("the parameter", lambda: vehicle.parameters["MIS_SPEED"] == 1.25)

    commands = vehicle.commands
    if ardupilot:
        commands.download()
        commands.wait_ready()
        told["at first"] = commands.count
        commands.clear()
    for north in (0.6, 1.2):
        place = (home.lat + north / DEGREE_M, home.lon, 1.5)
        commands.add(Command(0, 0, 0, RELATIVE, NAV_WAYPOINT, 0, 0, 0, 0, 0, 0, *place))
    commands.upload()
    commands.download()
    commands.wait_ready()
    told["commands"] = commands.count
    told["places"] = [(command.x, command.y, command.z) for command in commands]

    def mode(name: str) -> None:
        if ardupilot:
            vehicle.mode = VehicleMode(name)
        else:
            vehicle._master.set_mode(name)
        until(name, lambda: vehicle.mode.name == name)

    mode("GUIDED" if ardupilot else "LOITER")
    vehicle.armed = True
    until("armed", lambda: vehicle.armed)
    vehicle.simple_takeoff(1.5)
    until("the height", lambda: vehicle.location.global_relative_frame.alt > 1.5 + 0.6)  # the load's height
    until("rest", lambda: abs(vehicle.velocity[2]) < 0.05)
    vehicle.simple_goto(LocationGlobalRelative(home.lat + 1.0 / DEGREE_M, home.lon, 1.5))
    until("the place", lambda: abs(vehicle.location.global_frame.lat - home.lat - 1.0 / DEGREE_M) < 2e-6)
    commands.next = 0
    mode("AUTO" if ardupilot else "MISSION")
    until("the second item", lambda: commands.next == (2 if ardupilot else 1))
    mode("LOITER")
    mode("RTL")
    until("disarmed", lambda: not vehicle.armed)
    assert math.isfinite(vehicle.attitude.roll)
    vehicle.close()
    print(json.dumps(told))


if __name__ == "__main__":
    main(*sys.argv[1:])
