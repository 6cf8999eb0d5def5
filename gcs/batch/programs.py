"""Flights as programs: each in a separate process, kept on one core with all processes that it starts."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

from gcs.batch.runner import Running
from gcs.errors import EXIT_DONE, EXIT_NOT_MET, GcsError
from gcs.shell.processes import Child

_POLL_S = 0.2


class Titled(Protocol):
    """A flight with a title for display."""

    @property
    def title(self) -> str: ...


class Program(Protocol):
    """A program that has been started; `gcs.shell.processes.Child`."""

    exit_code: int | None

    @property
    def running(self) -> bool: ...
    def last_line(self) -> str: ...
    def exit_report(self) -> str: ...
    def terminate(self) -> None: ...
    def finish(self) -> None: ...


F = TypeVar("F", bound=Titled)


def cores(max_count: int | None = None) -> tuple[int, ...]:
    """The cores that this process may use, at most `max_count` of them."""
    if hasattr(os, "sched_getaffinity"):
        found = tuple(sorted(os.sched_getaffinity(0)))
    else:
        found = tuple(range(os.cpu_count() or 1))
    return found[:max_count]


def pin_to_core(child: Child, core: int) -> Child:
    """Keep a process and all processes that it starts on one core, if the system has a call for it."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(child.pid, {core})
    return child


class ProgramBackend(Generic[F]):
    """A backend that runs one program on each of `cores`; a result is a flight and whether it met its
    criteria.

    `start` starts the program of a flight on a core. Its exit code must be 0 (met) or 3 (not met).
    """

    def __init__(
        self,
        cores: Sequence[int],
        start: Callable[[F, int], Program],
        pause: Callable[[], None] = lambda: time.sleep(_POLL_S),
    ) -> None:
        self._cores, self._start, self._pause = tuple(cores), start, pause
        self._programs: dict[int, tuple[F, Program]] = {}  # by core
        self._failure = ""

    @property
    def has_capacity(self) -> bool:
        return len(self._programs) < len(self._cores)

    @property
    def is_idle(self) -> bool:
        return not self._programs and not self._failure

    def start(self, group: tuple[F, ...]) -> None:
        (flight,) = group
        core = next(core for core in self._cores if core not in self._programs)
        self._programs[core] = (flight, self._start(flight, core))

    def collect(self) -> Sequence[tuple[F, bool]]:
        if self._failure:
            raise GcsError(self._failure)
        self._pause()
        ended: list[tuple[F, bool]] = []
        for core, (flight, program) in list(self._programs.items()):
            if program.running:
                continue
            del self._programs[core]
            if program.exit_code in (EXIT_DONE, EXIT_NOT_MET):
                ended.append((flight, program.exit_code == EXIT_DONE))
            else:  # the next call raises the first failure, so that the flights that ended well are stored
                self._failure = self._failure or f"{flight.title}: {program.exit_report()}"
        return ended

    def running(self) -> Running:
        return tuple((flight.title, program.last_line()) for flight, program in self._programs.values())

    def stop(self) -> Sequence[tuple[F, bool]]:
        """End all programs and the processes that they started; interrupted flights give no result."""
        for _, program in self._programs.values():
            program.terminate()
        for _, program in self._programs.values():
            program.finish()
        self._programs = {}
        return ()
