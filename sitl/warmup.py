"""Compiles the simulator: python -m sitl.warmup, and for a cable of links: python -m sitl.warmup cable."""

from __future__ import annotations

import sys

from autopilot.shell.compiling import print_compiled_kernels

ALL_SENSORS = ("lab", "rtk")  # profiles that have all of them together
_CABLES = {"": 0.0, "cable": 10.0}  # links


def main(cable: str = "") -> None:
    """Compile the simulator, or find it compiled; prints the names of the kernels that are compiled."""
    print_compiled_kernels()
    # only now: the import itself compiles the first ones
    from sitl.hil import HilSimulator
    from sitl.sensor_log import SensorLog
    from sitl.shell.tick_loop import warm_up

    settings = {"SIM_BATTERY": 1.0, "SIM_CBL_LINKS": _CABLES[cable]}
    for sensors in ALL_SENSORS:
        simulator = HilSimulator.build(sensors=sensors, settings=settings, log=SensorLog(lambda data: None))
    warm_up(simulator)
    simulator.truth_datagram()
    simulator.receive(b"")
    simulator.advance()


if __name__ == "__main__":
    main(*sys.argv[1:])
