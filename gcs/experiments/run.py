"""The flights of the experiments: each a `gcs fly`, one on each core."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from gcs.batch.programs import pin_to_core
from gcs.batch.runner import Backend, Running, fly_all
from gcs.experiments import store
from gcs.experiments.plan import SEED, SENSORS, Experiment
from gcs.shell.processes import Child

LOG_FILE = "gcs.log"
EndedFlight = tuple[Experiment, bool]  # an ended flight, and whether it was completed


def start(experiment: Experiment, directory: Path, core: int) -> Child:
    """Start the flight of an experiment; results go to `directory`, and its output to gcs.log there."""
    store.prepare(directory)
    arguments = ["fly", experiment.case, "--law", experiment.law, "--vehicle", experiment.vehicle]
    arguments += ["--sensors", SENSORS, "--seed", str(SEED), "--lockstep", "--force", "--overwrite"]
    program = [sys.executable, "-m", "gcs"]
    child = Child("gcs", [*program, *arguments, "--out", str(directory)], directory / LOG_FILE)
    # in lockstep it and its children take turns, so they share one core, which no other flight uses
    return pin_to_core(child, core)


def missing(plan: Sequence[Experiment], directory: Path, fresh: bool) -> list[Experiment]:
    """The experiments that must be flown: all if `fresh`, else those not stored in `directory`/NAME."""
    return [e for e in plan if fresh or not store.is_flown(directory / e.name, store.experiment_origin(e))]


def fly_missing(
    waiting: Sequence[Experiment],
    directory: Path,
    backend: Backend[Experiment, EndedFlight],
    tell: Callable[[Sequence[EndedFlight], Running], None],
    stopped: Callable[[], bool],
) -> bool:
    """Fly the `waiting` experiments into `directory`/NAME; False if it was stopped before the end."""

    def store_ended(ended: Sequence[EndedFlight]) -> None:
        for experiment, _ in ended:
            store.mark_complete(directory / experiment.name, store.experiment_origin(experiment))

    return fly_all(((experiment,) for experiment in waiting), backend, store_ended, tell, stopped)
