"""How much faster a flight of a sweep is than the same flight over the wire in one process, side by side.

    python benchmarks/sweep_speed.py [--mission case-b] [--law plumbline] [--sensors lab] [--pairs 3]

The two are flown in turn and must end alike. Processor time, so that other work on the machine counts little.
"""

from __future__ import annotations

import argparse
import statistics
import time

from autopilot.vehicle.parameters import LAWS
from gcs.closed_loop import Conditions
from gcs.closed_loop import fly as fly_with_wire
from gcs.sweep.flight import boarding, fly
from missions.fileformat import load_mission


class NoLog:
    """Takes frames and forgets them."""

    def write(self, unix_us: int, *frames: bytes) -> None:
        """Nothing."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--mission", default="case-b")
    parser.add_argument("--law", choices=LAWS, default="plumbline")
    parser.add_argument("--sensors", default="lab")
    parser.add_argument("--pairs", type=int, default=3)
    options = parser.parse_args()
    mission = load_mission(options.mission)
    law = {"CTL_LAW": float(LAWS.index(options.law))}

    def conditions(seed: int) -> Conditions:
        return Conditions(sensors=options.sensors, seed=seed, settings=law)

    board = boarding(mission, conditions(1))
    fly(mission, conditions(1), board)  # compiles
    fused_s, wire_s, flown_s = [], [], []
    for seed in range(1, options.pairs + 1):
        began_s = time.process_time()
        fused = fly(mission, conditions(seed), board)
        fused_s.append(time.process_time() - began_s)
        began_s = time.process_time()
        wire = fly_with_wire(mission, conditions(seed), NoLog())
        wire_s.append(time.process_time() - began_s)
        assert fused.outcome == wire.name, (fused, wire)
        flown_s.append(fused.flight_s)
    fused_median, wire_median = statistics.median(fused_s), statistics.median(wire_s)
    flight_s = statistics.median(flown_s)
    print(f"{options.mission}, law {options.law}, {options.sensors} sensors, {flight_s:.0f} s in the air")
    print(f"fused      {fused_median:8.3f} s   {flight_s / fused_median:7.0f} x real time")
    print(f"with wire  {wire_median:8.3f} s   {flight_s / wire_median:7.0f} x real time")
    print(f"ratio      {wire_median / fused_median:8.1f}")
    print(f"flights/s on one core {1.0 / fused_median:.1f}")


if __name__ == "__main__":
    main()
