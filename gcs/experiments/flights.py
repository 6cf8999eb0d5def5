"""Several flights at a time, one on each core, until all are flown, one fails or somebody stops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from gcs.errors import EXIT_DONE, EXIT_NOT_MET, GcsError
from gcs.experiments import reuse
from gcs.experiments.plan import Experiment


class Handle(Protocol):
    """A flight that has been started."""

    @property
    def running(self) -> bool: ...
    @property
    def exit_code(self) -> int | None: ...
    def last_line(self) -> str: ...
    def obituary(self) -> str: ...


# experiment, its directory, core -> the flight
Start = Callable[[Experiment, Path, int], Handle]


class Status(NamedTuple):
    """How far it is."""

    done: int
    total: int
    flying: tuple[tuple[Experiment, str], ...]  # and the last words of each


class Interrupted(Exception):
    """Somebody asked to stop; what is flown stays."""


def fly_missing(
    plan: Sequence[Experiment],
    directory: Path,
    cores: Sequence[int],
    code: str,
    start: Start,
    tell: Callable[[Status], None],
    pause: Callable[[], None],
    stop: Callable[[], bool],
    fresh: bool = False,
) -> int:
    """Fly what is not flown yet, into `directory`/NAME; how many were.

    `pause` waits a moment, `stop` says whether somebody asked to. The caller ends flights that still run when
    this leaves with GcsError or Interrupted.
    """
    waiting = [e for e in plan if fresh or not reuse.is_flown(directory / e.name, e, code)]
    flown, done = len(waiting), len(plan) - len(waiting)
    running: dict[int, tuple[Experiment, Handle]] = {}

    def show() -> None:
        tell(Status(done, len(plan), tuple((e, flight.last_line()) for e, flight in running.values())))

    while waiting or running:
        if stop():
            raise Interrupted
        for core, (experiment, flight) in list(running.items()):
            if flight.running:
                continue
            if flight.exit_code not in (EXIT_DONE, EXIT_NOT_MET):
                raise GcsError(f"{experiment.title}: {flight.obituary()}")
            reuse.finish(directory / experiment.name, code)
            del running[core]
            done += 1
        for core in cores:
            if core not in running and waiting:
                experiment = waiting.pop(0)
                reuse.begin(directory / experiment.name)
                running[core] = (experiment, start(experiment, directory / experiment.name, core))
        show()
        if running:
            pause()
    show()
    return flown
