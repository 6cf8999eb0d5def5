"""How fast a flight runs, side by side: in one process, and through three processes over UDP.

Ratios on one machine at one time are what this tells; the seconds are the machine's. Each variant flies the
same mission with the same seed, the variants in turn, `--repeat` times; the median counts.

    python benchmarks/lockstep.py [--mission hover] [--repeat 3]
"""

from __future__ import annotations

import argparse
import io
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from autopilot.wire.tlog import TlogWriter, read_tlog
from gcs.closed_loop import Conditions, fly
from missions.fileformat import load_mission

Timed = tuple[float, float]  # simulated seconds, wall seconds


def one_process(mission: str) -> Timed:
    """Simulator, autopilot and ground station joined by byte queues."""
    log = io.BytesIO()
    began = time.perf_counter()
    fly(load_mission(mission), Conditions(), TlogWriter(log))
    wall_s = time.perf_counter() - began
    log.seek(0)
    times = [unix_us for unix_us, _ in read_tlog(log)]
    return (times[-1] - times[0]) * 1e-6, wall_s


def three_processes(mission: str) -> Timed:
    """`gcs fly`, start of the processes included, report left out."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        command = [sys.executable, "-m", "gcs", "fly", mission, "--out", str(out), "--json", "--quiet"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    record = json.loads(done.stdout)
    return record["recorded_s"], record["wall_s"]


VARIANTS: dict[str, Callable[[str], Timed]] = {
    "one process": one_process,
    "three processes over UDP": three_processes,
}


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mission", default="hover")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    for variant in VARIANTS.values():
        variant(options.mission)  # compiles the kernels, fills the caches
    timed: dict[str, list[Timed]] = {name: [] for name in VARIANTS}
    for _ in range(options.repeat):
        for name, variant in VARIANTS.items():
            timed[name].append(variant(options.mission))
    print(f"{options.mission}, median of {options.repeat}")
    print(f"{'variant':28} {'simulated s':>12} {'wall s':>8} {'x real time':>12} {'ratio':>6}")
    base = None
    for name, runs in timed.items():
        simulated_s = runs[0][0]
        wall_s = statistics.median(wall for _, wall in runs)
        base = base or wall_s
        print(
            f"{name:28} {simulated_s:12.1f} {wall_s:8.2f} {simulated_s / wall_s:12.1f} {base / wall_s:6.2f}"
        )


if __name__ == "__main__":
    main()
