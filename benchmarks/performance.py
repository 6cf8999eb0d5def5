"""Speed of Plumbline on this machine, each figure beside a bound or another figure of the same run.

    python benchmarks/performance.py [--flights 200] [--real-time 60] [--linear] [--docs docs/performance.md]

Seconds depend on the machine and on what else it runs; only ratios can be compared. Repeated measurements are
made in turn, and the median counts. With --docs the tables are written into the page, between its markers, in
place of those of the same kind of machine; those of other machines stay.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import platform
import re
import resource
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import chain
from pathlib import Path

from gcs.closed_loop import Conditions
from gcs.closed_loop import fly as fly_with_wire
from gcs.experiments.marked_text import split_at_marks, write_between
from gcs.sweep.flight import fly, start_times
from missions.fileformat import load_mission
from missions.model import Land, Mission, Takeoff, Waypoint

MISSION = "case-b"
TICKS_PER_S = 250  # the simulator's default
SENSORS_BYTES, ANSWER_BYTES = 330, 52  # of a tick with the sensors `lab`, and of its answer
REAL_TIME_HZ = 500
_CLOCK = re.compile(r"gcs: +[\d.]+ s  ")  # how a progress line of `gcs fly` begins
BEGIN, END = "<!-- measured -->\n", "<!-- end -->"


class NoLog:
    """A log that discards its frames."""

    def write(self, unix_us: int, *frames: bytes) -> None:
        """Discard the frames."""


# ---- with messages


def over_udp(folder: Path) -> tuple[dict[str, float], float, float]:
    """The record of `gcs fly` in lockstep, the seconds until the vehicle is heard, and those in total."""
    out = folder / f"flight-{time.monotonic_ns()}"
    command = [sys.executable, "-m", "gcs", "fly", MISSION, "--sensors", "lab", "--out", str(out)]
    start_s = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert child.stderr is not None
    of_vehicle = (line for line in child.stderr if _CLOCK.match(line) and "looking for" not in line)
    heard_s = next((time.perf_counter() - start_s for _ in of_vehicle), float("nan"))
    child.communicate()
    total_s = time.perf_counter() - start_s
    if child.returncode != 0:
        raise SystemExit(f"gcs fly failed: exit code {child.returncode}")
    return json.loads((out / "summary.json").read_text(encoding="utf-8")), heard_s, total_s


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
    """Wall seconds of `exchanges` exchanges between two Python processes, blocking, on one core."""
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


# ---- without messages


def processor_s(run: Callable[[], object]) -> float:
    """Processor seconds of a call, on which other work on the machine has little effect."""
    began = time.process_time()
    run()
    return time.process_time() - began


def sweep_s(flights: int) -> float:
    """Wall seconds of a sweep of so many flights on all cores, as `gcs sweep` reports them."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "gcs", "sweep", MISSION, "--seeds", str(flights)]
        done = subprocess.run(
            [*command, "--out", str(Path(folder) / "sweep"), "--quiet", "--json"],
            capture_output=True,
            text=True,
            check=True,
        )
    return float(json.loads(done.stdout)["wall_s"])


def hold_mission(seconds: float) -> Mission:
    """A mission that takes off and holds."""
    return Mission("hold", "Hold", "", (), (Takeoff(1.0), Waypoint(0.0, 0.0, 1.0, hold_s=seconds), Land()))


# ---- real time


def real_time(seconds: float, folder: Path) -> tuple[str, str]:
    """What `sitl` reports of its timeliness after so many seconds, and `autopilot` of its work."""
    port, truth = "127.0.0.1:14571", "127.0.0.1:14572"
    simulator = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "sitl",
            "--real-time",
            "--listen",
            port,
            "--truth",
            truth,
            "--set",
            f"SIM_RATE_HZ={REAL_TIME_HZ}",
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    autopilot = subprocess.Popen(
        [sys.executable, "-m", "autopilot", "--sim", port, "--storage", str(folder / "card")],
        stdout=subprocess.PIPE,
        text=True,
    )
    time.sleep(seconds)
    simulator.send_signal(signal.SIGINT)
    simulator_text, _ = simulator.communicate()
    autopilot.send_signal(signal.SIGINT)
    autopilot_text, _ = autopilot.communicate()
    last, cost = (text.strip().splitlines()[-1] for text in (simulator_text, autopilot_text))
    return last.removeprefix("sitl: "), cost.partition("; ")[2]


# ---- the tables


def machine() -> str:
    """Processor, its widest vectors, on which the sweeps depend most, and interpreter."""
    about = dict.fromkeys(("model name", "flags"), "")
    if Path("/proc/cpuinfo").is_file():
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            about[name.strip()] = value.strip()
    widths = {"avx512f": 512, "avx2": 256}
    width = next((bits for flag, bits in widths.items() if flag in about["flags"].split()), 0)
    vectors = f", vectors of {width} bits" if width else ""
    name_of_model = about["model name"] or platform.machine()
    return f"{os.cpu_count()} cores of {name_of_model}{vectors}, Python {platform.python_version()}"


Rows = Iterator[tuple[str, ...]]  # each as soon as it is measured


def lockstep_rows(repeat: int, folder: Path) -> Rows:
    """Flights through three processes and in one, and the limit that UDP sets."""
    mission, conditions = load_mission(MISSION), Conditions()
    over_udp(folder)  # loads everything once
    udp_factors, first_word, totals, udp_shares, one_process = [], [], [], [], []
    for _ in range(repeat):
        record, heard_s, total_s = over_udp(folder)
        wall_s = record["recorded_s"] / record["real_time_factor"]
        udp_factors.append(record["real_time_factor"])
        first_word.append(heard_s)
        totals.append(total_s)
        udp_shares.append(ping_pong(round(record["recorded_s"] * TICKS_PER_S)) / wall_s)
        start_s = time.perf_counter()
        fly_with_wire(mission, conditions, NoLog())
        one_process.append(record["recorded_s"] / (time.perf_counter() - start_s))
    median = statistics.median
    yield (
        "three processes over UDP in lockstep",
        f"{median(udp_factors):.0f} x real time",
        f"{median(udp_shares):.0%} of a ping-pong of UDP datagrams, as many and as large",
    )
    yield (
        "the same cores in one process",
        f"{median(one_process):.0f} x real time",
        f"{median(one_process) / median(udp_factors):.1f} x three processes",
    )
    yield "`gcs fly`, from the command to the vehicle's first word", f"{median(first_word):.1f} s", ""
    yield "`gcs fly`, from the command to the prompt, with its report", f"{median(totals):.1f} s", ""


def sweep_rows(repeat: int, flights: int) -> Rows:
    """One flight without messages, and many on all cores."""
    mission = load_mission(MISSION)
    for sensors in ("lab", "ideal"):
        board = start_times(mission, Conditions(sensors=sensors))
        flown = fly(mission, Conditions(sensors=sensors), board)
        timed = [
            processor_s(partial(fly, mission, Conditions(sensors=sensors, seed=2 + k), board))
            for k in range(max(repeat, 5))
        ]
        speed = flown.flight_s / statistics.median(timed)
        yield (
            f"one flight without the wire, {sensors}",
            f"{speed:.0f} x real time",
            f"{1e6 * statistics.median(timed) / (flown.flight_s * TICKS_PER_S):.1f} us a tick",
        )
    wall_s = sweep_s(flights)
    cores = len(os.sched_getaffinity(0))
    yield (
        f"a sweep of {flights} flights on {cores} cores",
        f"{flights / wall_s:.1f} flights/s",
        f"10,000 flights in {1e4 * wall_s / flights:.0f} s",
    )


def light_rows(repeat: int) -> Rows:
    """Processor time of commands that only print something; `gcs status` waits in vain for a vehicle."""
    for words in (["--help"], ["status", "--connect", "14573"]):
        timed = []
        for _ in range(max(repeat, 5)):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([sys.executable, "-m", "gcs", *words], capture_output=True, check=False)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            timed.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        yield f"`gcs {words[0]}`", f"{statistics.median(timed):.2f} s", "processor time"


def linear_rows() -> Rows:
    """Microseconds per tick over three decades of flights and of ticks, and over the possible rates."""
    mission, conditions = load_mission(MISSION), Conditions()
    board = start_times(mission, conditions)

    def us_per_tick(flights: Iterable[tuple[Mission, Conditions]], ticks_per_s: float) -> str:
        start_s = time.process_time()
        flight_s = sum(fly(one, conditions_of_one, board).flight_s for one, conditions_of_one in flights)
        return f"{1e6 * (time.process_time() - start_s) / (flight_s * ticks_per_s):.2f}"

    for count in (1, 10, 100, 1000):
        cost = us_per_tick(((mission, Conditions(seed=k)) for k in range(count)), TICKS_PER_S)
        yield f"{count} flights of {MISSION}", cost
    for seconds in (10.0, 100.0, 1000.0, 10_000.0):
        cost = us_per_tick([(hold_mission(seconds), conditions)], TICKS_PER_S)
        yield f"one flight that holds for {seconds:g} s", cost
    for rate in (250, 500, 1000):
        faster = Conditions(settings={"SIM_RATE_HZ": float(rate)})
        yield f"{MISSION} at {rate} Hz", us_per_tick([(mission, faster)], rate)


def all_rows(options: argparse.Namespace, folder: Path) -> Rows:
    """The rows of the first table."""
    yield from lockstep_rows(options.repeat, folder)
    yield from sweep_rows(options.repeat, options.flights)
    yield from light_rows(options.repeat)
    if options.real_time:
        label = f"real time at {REAL_TIME_HZ} Hz, {options.real_time:g} s"
        yield label, *real_time(options.real_time, folder)


def table(head: Sequence[str], rows: Rows) -> str:
    """A Markdown table; each line is printed as soon as it is complete."""
    lines = []
    for cells in chain((head, ["---"] * len(head)), rows):
        lines.append("| " + " | ".join(cells) + " |")
        print(lines[-1], flush=True)
    print()
    return "\n".join(lines)


def with_machine(measured: str, about: str, text: str) -> str:
    """What is measured on several machines, with these tables under a heading that names this one."""
    sections = dict(section.split("\n", 1) for section in measured.split("### ")[1:]) | {about: text}
    return "\n".join(f"### {name}\n\n{tables.strip()}\n" for name, tables in sorted(sections.items()))


def main() -> None:
    """Measure, print, and with `--docs` write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--flights", type=int, default=200, help="of the sweep")
    parser.add_argument(
        "--real-time", type=float, default=0.0, metavar="S", help="seconds at 500 Hz; 0: none"
    )
    parser.add_argument("--linear", action="store_true", help="the table of cost over three decades")
    parser.add_argument("--docs", type=Path)
    options = parser.parse_args()
    about = machine()
    print(about)
    with tempfile.TemporaryDirectory() as name:
        text = table(("Case B", "measured", "beside it"), all_rows(options, Path(name)))
    if options.linear:
        text += "\n\n" + table(("without the wire, sensors of the lab", "us a tick"), linear_rows())
    if options.docs:
        _, measured, _ = split_at_marks(options.docs, BEGIN, END)
        write_between(options.docs, BEGIN, END, with_machine(measured, about, text))


if __name__ == "__main__":
    main()
