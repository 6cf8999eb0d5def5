"""The loop in which many flights are flown: start, collect, store, report progress, stop without loss.

A backend flies: `gcs.batch.pool` (processes on this machine, or a Dask cluster) or `gcs.batch.programs` (a
program for each flight). The loop runs in the calling thread, which also stores the results.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from typing import Generic, Protocol, TypeVar

F = TypeVar("F")
R = TypeVar("R")
F_contra = TypeVar("F_contra", contravariant=True)
R_co = TypeVar("R_co", covariant=True)

Running = tuple[tuple[str, str], ...]  # of each running flight: its title, the last line that it wrote
_MAX_BUFFERED = 1000  # results held in memory


class Backend(Protocol[F_contra, R_co]):
    """What flies the flights, which are handed over in groups."""

    @property
    def has_capacity(self) -> bool:
        """Whether another group may be started."""

    @property
    def is_idle(self) -> bool:
        """Whether nothing runs."""

    def start(self, group: tuple[F_contra, ...]) -> None:
        """Start a group of flights."""

    def collect(self) -> Sequence[R_co]:
        """Wait a moment; return the results of ended flights. GcsError if a flight could not be flown."""

    def running(self) -> Running:
        """The flights that run now, as far as they are known in this process."""

    def stop(self) -> Sequence[R_co]:
        """Start nothing more and end what runs; return the complete results."""


class _Buffer(Generic[R]):
    """Buffered results for the store, which is called at most every `store_interval_s` seconds."""

    def __init__(self, store: Callable[[Sequence[R]], None], store_interval_s: float) -> None:
        self._store, self._store_interval_s = store, store_interval_s
        self._results: list[R] = []
        self._stored_s = time.monotonic()

    def add(self, results: Sequence[R]) -> None:
        """Buffer results; store all buffered results if it is time or there are `_MAX_BUFFERED`."""
        self._results += results
        if len(self._results) >= _MAX_BUFFERED or time.monotonic() - self._stored_s >= self._store_interval_s:
            self.flush()

    def flush(self) -> None:
        """Store all buffered results."""
        buffered, self._results, self._stored_s = self._results, [], time.monotonic()
        if buffered:
            self._store(buffered)


def fly_all(
    groups: Iterable[tuple[F, ...]],
    backend: Backend[F, R],
    store: Callable[[Sequence[R]], None],
    report: Callable[[Sequence[R], Running], None],
    stopped: Callable[[], bool],
    store_interval_s: float = 0.0,
) -> bool:
    """Fly all groups of flights; False if it was stopped before the end.

    `store` receives every result once, at most every `store_interval_s` seconds, also if the loop ends by a
    request to stop or by an exception. `report` receives the results since its last call and the flights that
    run now; it is called several times a second.
    """
    remaining = iter(groups)
    exhausted = False
    buffer = _Buffer(store, store_interval_s)
    try:
        while not stopped():
            while not exhausted and backend.has_capacity:
                group = next(remaining, None)
                if group is None:
                    exhausted = True
                else:
                    backend.start(group)
            report((), backend.running())
            if backend.is_idle:
                return True
            results = backend.collect()
            buffer.add(results)
            report(results, backend.running())
        return False
    finally:
        buffer.flush()  # before waiting for running flights, which a second Ctrl-C abandons
        results = backend.stop()
        buffer.add(results)
        buffer.flush()
        report(results, ())
