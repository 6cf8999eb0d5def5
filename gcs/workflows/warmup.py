"""Compiles the flight software before it flies: its parts in as many processes as there are cores."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from autopilot.geometry.machine_code import (
    KEEPING_HINT,
    ROOT,
    drop_unused,
    storage_problem,
    use_temporary_folder,
)
from autopilot.shell.compiling import CABLE, SIMULATOR, Part, autopilot_parts
from autopilot.vehicle.parameters import LAWS
from autopilot.vehicle.shipped import VEHICLES
from gcs.errors import GcsError, StoppedError, reason
from gcs.shell.display import CompileDisplay, notify
from gcs.shell.processes import Child, Processes
from gcs.workflows.expected import duration_text, expected_s, remaining_s

_POLL_S = 0.05
_CHECK = Part(
    "the mission check",
    "gcs.workflows.warm_check",
    (),
    ROOT / "gcs" / "workflows" / "check_mission.py",
    "check",
    4.0,
)
_IN_PROCESS = Part(
    "flights in one process",
    "gcs.workflows.warm_in_process",
    (),
    ROOT / "gcs" / "closed_ticks.py",
    "here",
    5.0,
)
_REPORT = Part("the report", "gcs.report.warm", (), ROOT / "gcs" / "report" / "style.py", "report", 3.0)


def flight_parts(laws: Sequence[str]) -> list[Part]:
    """What `gcs fly` needs for flights with these laws; without any, for a third-party autopilot."""
    own = autopilot_parts(*laws) if laws else ()
    return [*own, SIMULATOR, _CHECK, _REPORT]


def vehicle_parts(vehicle: str, settings: Iterable[tuple[str, float]]) -> list[Part]:
    """What flights of this vehicle need besides, with parameters that are set."""
    links = dict(settings).get("SIM_CBL_LINKS")
    if links is None and vehicle not in VEHICLES.names():  # no shipped vehicle has any
        from autopilot.vehicle.file import load_vehicle

        links = load_vehicle(vehicle).cable_links
    return [CABLE] if links else []


def in_process_parts(laws: Sequence[str]) -> list[Part]:
    """What `plumbline.fly` needs for flights with these laws."""
    return [*flight_parts(laws), _IN_PROCESS]


def all_sweep_parts(laws: Sequence[str]) -> list[Part]:
    """What sweeps with these laws need besides; for shipped laws also the lanes (eight flights at once)."""
    from gcs.sweep.warmup import lanes_part, sweep_parts

    shared = {part.mark for part in flight_parts(laws)}
    alone = [part for part in sweep_parts(laws) if part.mark not in shared]
    return [*alone, *(lanes_part(law) for law in laws if law in LAWS)]


def warm_up(
    parts: Iterable[Part],
    quiet: bool = False,
    stopped: Callable[[], bool] = lambda: False,
    warn: Callable[[str], None] = notify,
) -> None:
    """Compile those of these parts that are not compiled yet, the longest first; if the machine code cannot
    be kept, for this program alone, and `warn` is called with a line that says so. StoppedError as soon as
    `stopped` returns True."""
    waiting = sorted((part for part in parts if not part.ready), key=lambda part: -part.cost_s)
    if not waiting:
        return
    total = len(waiting)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    busy = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    not_kept_reason = storage_problem()
    if not_kept_reason:
        warn(
            f"{not_kept_reason}; the machine code cannot be kept there and is compiled for this run alone; "
            f"{KEEPING_HINT}"
        )
        try:
            use_temporary_folder()
        except OSError as error:
            raise GcsError(f"the machine code cannot be stored: {reason(error)}; {KEEPING_HINT}") from None
    if not quiet:
        expected = duration_text(expected_s([part.cost_s for part in waiting], cores))
        count = f"{total} parts" if total > 1 else waiting[0].title
        once = "" if not_kept_reason else ", once"
        notify(f"compiling the flight software{once}: {count}, {expected} on an idle machine")
    with (
        tempfile.TemporaryDirectory(prefix="plumbline-") as logs,
        Processes() as processes,
        CompileDisplay(quiet) as display,
    ):
        running: dict[str, tuple[Part, Child, float]] = {}
        done: list[tuple[float, float]] = []  # s on an idle machine, s that it took
        start_s = time.monotonic()

        def remaining_text(now_s: float) -> str:
            remain = len(waiting) + len(running)
            if not remain:
                return "that was the last part"
            running_parts = [
                (part.cost_s, now_s - part_start_s) for part, _, part_start_s in running.values()
            ]
            more = duration_text(
                remaining_s(done, running_parts, [part.cost_s for part in waiting], cores, busy)
            )
            if total == 1:
                return f"after {now_s - start_s:.0f} s, {more} more"
            return f"{remain} of {total} parts remain after {now_s - start_s:.0f} s, {more} more"

        while waiting or running:
            while waiting and len(running) < cores:
                part = waiting.pop(0)
                log = Path(logs) / f"{part.mark}.log"
                child = processes.start(part.module, part.arguments, log)
                running[part.title] = part, child, time.monotonic()
            display.update(
                {title: child.last_line() for title, (_, child, _) in running.items()},
                len(waiting) + len(running),
                total,
                remaining_text(time.monotonic()),
            )
            time.sleep(_POLL_S)
            if stopped():
                raise StoppedError("stopped while the flight software was compiled")
            for title, (part, child, part_start_s) in list(running.items()):
                if child.running:
                    continue
                if child.exit_code != 0:
                    raise GcsError(f"{title} cannot be compiled: {child.exit_report()}")
                part.mark_done()
                del running[title]
                now_s = time.monotonic()
                done.append((part.cost_s, now_s - part_start_s))
                display.done(title, now_s - part_start_s, remaining_text(now_s))
    drop_unused(time.time())
