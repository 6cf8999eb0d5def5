"""The flight software compiled before it flies: its parts in as many processes as there are cores."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from autopilot.geometry.machine_code import ROOT
from autopilot.shell.compiling import SIMULATOR, Part, autopilot_parts
from gcs.errors import GcsError
from gcs.shell.display import CompileDisplay, say
from gcs.shell.processes import Child, Processes

_LOOK_S = 0.05
_CHECK = Part(
    "the mission check",
    "gcs.workflows.warm_check",
    (),
    ROOT / "gcs" / "workflows" / "check_mission.py",
    "check",
    3.0,
)
_REPORT = Part("the report", "gcs.report.warm", (), ROOT / "gcs" / "report" / "style.py", "report", 3.0)


def flight_parts(laws: Sequence[str]) -> list[Part]:
    """What `gcs fly` needs for flights with these laws."""
    return [*autopilot_parts(*laws), SIMULATOR, _CHECK, _REPORT]


def warm_up(parts: Iterable[Part], quiet: bool = False) -> None:
    """Compile what is left to be compiled of these parts, the longest first."""
    waiting = sorted((part for part in parts if not part.ready), key=lambda part: -part.cost_s)
    if not waiting:
        return
    total = len(waiting)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not quiet:
        cost_s = max(waiting[0].cost_s, sum(part.cost_s for part in waiting) / cores)
        say(f"compiling the flight software, once; about {cost_s:.0f} s on an idle machine")
    with (
        tempfile.TemporaryDirectory(prefix="plumbline-") as logs,
        Processes() as processes,
        CompileDisplay(quiet) as display,
    ):
        running: dict[str, tuple[Part, Child]] = {}
        while waiting or running:
            while waiting and len(running) < cores:
                part = waiting.pop(0)
                log = Path(logs) / f"{part.mark}.log"
                running[part.title] = part, processes.start(part.module, part.arguments, log)
            display.update(
                {title: child.last_line() for title, (_, child) in running.items()},
                len(waiting) + len(running),
                total,
            )
            time.sleep(_LOOK_S)
            for title, (part, child) in list(running.items()):
                if child.running:
                    continue
                if child.exit_code != 0:
                    raise GcsError(f"{title} cannot be compiled: {child.obituary()}")
                part.done()
                del running[title]
