"""Compiles the simulator: python -m sitl.warmup."""

from __future__ import annotations

from autopilot.shell.compiling import print_compiled_kernels


def main() -> None:
    """Compile the simulator, or find it compiled; prints the names of the kernels that are compiled."""
    print_compiled_kernels()
    # only now: the import itself compiles the first ones
    from sitl.hil import HilSimulator
    from sitl.sensor_log import SensorLog
    from sitl.shell.tick_loop import warm_up

    simulator = HilSimulator.build(log=SensorLog(lambda data: None))
    warm_up(simulator)
    simulator.truth_datagram()
    simulator.receive(b"")
    simulator.advance()


if __name__ == "__main__":
    main()
