"""How fast a flight runs in one process, through three processes over UDP, and what UDP would allow.

Ratios on one machine at one time are what this tells; the seconds are the machine's. Each variant flies the
same mission with the same seed, the variants in turn, `--repeat` times; the median counts. The last one flies
nothing: two Python processes on one core exchange as many pairs of datagrams as the flight has ticks, of the
same size. The share is what the three processes reach of that.

    python benchmarks/lockstep.py [--mission hover] [--repeat 3]
"""

from __future__ import annotations

import argparse
import io
import json
import multiprocessing
import os
import socket
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

ONE_PROCESS, OVER_UDP, PING_PONG = "one process", "three processes over UDP", "UDP ping-pong, nothing flown"
TICKS_PER_S = 250  # as the simulator has them by default
SENSORS_BYTES, ANSWER_BYTES = 330, 52  # of a tick with the sensors of the lab, and of its answer


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
    """`gcs fly`, from the vehicle's first word to the end of the flight."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        command = [sys.executable, "-m", "gcs", "fly", mission, "--out", str(out), "--json", "--quiet"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    record = json.loads(done.stdout)
    return record["recorded_s"], record["recorded_s"] / record["real_time_factor"]


def _echo(port: int, core: int) -> None:
    """The other end: answers until an empty datagram comes."""
    os.sched_setaffinity(0, {core})
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.connect(("127.0.0.1", port))
        end.send(b"")
        answer = bytes(ANSWER_BYTES)
        while end.recv(65535):
            end.send(answer)


def ping_pong(exchanges: int) -> float:
    """Wall seconds of so many exchanges between two Python processes, blocking, on one core."""
    cores = os.sched_getaffinity(0)
    core = max(cores)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.bind(("127.0.0.1", 0))
        other = multiprocessing.Process(target=_echo, args=(end.getsockname()[1], core))
        other.start()
        _, peer = end.recvfrom(65535)
        end.connect(peer)
        os.sched_setaffinity(0, {core})
        sensors = bytes(SENSORS_BYTES)
        began = time.perf_counter()
        for _ in range(exchanges):
            end.send(sensors)
            end.recv(65535)
        wall_s = time.perf_counter() - began
        os.sched_setaffinity(0, cores)
        end.send(b"")
        other.join()
    return wall_s


VARIANTS: dict[str, Callable[[str], Timed]] = {
    ONE_PROCESS: one_process,
    OVER_UDP: three_processes,
}


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mission", default="hover")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    for variant in VARIANTS.values():
        variant(options.mission)  # compiles the kernels, fills the caches
    timed: dict[str, list[Timed]] = {name: [] for name in (*VARIANTS, PING_PONG)}
    for _ in range(options.repeat):
        for name, variant in VARIANTS.items():
            timed[name].append(variant(options.mission))
        simulated_s, _ = timed[OVER_UDP][-1]
        timed[PING_PONG].append((simulated_s, ping_pong(round(simulated_s * TICKS_PER_S))))
    print(f"{options.mission}, median of {options.repeat}")
    print(f"{'variant':28} {'simulated s':>12} {'wall s':>8} {'x real time':>12} {'ratio':>6}")
    median_s = {name: statistics.median(wall for _, wall in runs) for name, runs in timed.items()}
    for name, runs in timed.items():
        simulated_s, wall_s = runs[0][0], median_s[name]
        print(
            f"{name:28} {simulated_s:12.1f} {wall_s:8.2f} {simulated_s / wall_s:12.1f} "
            f"{median_s[ONE_PROCESS] / wall_s:6.2f}"
        )
    shares = [wall / flown for (_, wall), (_, flown) in zip(timed[PING_PONG], timed[OVER_UDP], strict=True)]
    print(f"share of the ping-pong that three processes reach: {statistics.median(shares):.0%}")


if __name__ == "__main__":
    main()
