"""`gcs fly` as a process of its own, kept on one core with everything that it starts."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType

from gcs.experiments.plan import SEED, SENSORS, Experiment
from gcs.shell.processes import Child

LOG_FILE = "gcs.log"


def cores(most: int | None = None) -> tuple[int, ...]:
    """The cores that we may use, at most `most` of them."""
    if hasattr(os, "sched_getaffinity"):
        found = tuple(sorted(os.sched_getaffinity(0)))
    else:
        found = tuple(range(os.cpu_count() or 1))
    return found[:most]


class FlightProcesses:
    """The flights that run; leaving the `with` block ends them and what they have started."""

    def __init__(self) -> None:
        self._children: list[Child] = []

    def start(self, experiment: Experiment, directory: Path, core: int) -> Child:
        """Start a flight; its words go to gcs.log in `directory`."""
        arguments = ["fly", experiment.case, "--law", experiment.law, "--vehicle", experiment.vehicle]
        arguments += ["--sensors", SENSORS, "--seed", str(SEED), "--lockstep", "--force", "--overwrite"]
        child = Child("gcs", [*arguments, "--out", str(directory)], directory / LOG_FILE)
        # it and its own children share one core while they are in lockstep: not the one of its neighbour
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(child.pid, {core})
        self._children.append(child)
        return child

    def __enter__(self) -> FlightProcesses:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for child in self._children:
            child.terminate()
        for child in self._children:
            child.finish()
