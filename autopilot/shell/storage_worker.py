"""Storing in a thread: slow disk work is done beside the control loop, and reported to the ground afterwards.

Messages to the ground stations wait, in their order, until everything that was to be stored before them is on
the disk. An answer that reports something as stored is thus true, and the control loop waits for no disk.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from threading import Thread

FailureCallback = Callable[[OSError], None]


class StorageWorker:
    """Stores in the order of the requests; `threaded`: in a thread, else immediately."""

    def __init__(self, threaded: bool) -> None:
        self._requested = 0
        self._finished = 0  # counted up by the thread alone
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._outcomes: deque[Callable[[], None]] = deque()
        self._thread: Thread | None = None
        if threaded:
            self._thread = Thread(target=self._work, name="storing", daemon=True)
            self._thread.start()

    def request(
        self, store: Callable[[], None], on_failed: FailureCallback, on_stored: Callable[[], None]
    ) -> None:
        """Request that something is stored; `report_results` then calls `on_failed` or `on_stored`."""

        def job() -> None:
            try:
                store()
            except OSError as error:
                self._outcomes.append(partial(on_failed, error))
            else:
                self._outcomes.append(on_stored)
            self._finished += 1

        self._requested += 1
        if self._thread is None:
            job()
            self.report_results()
        else:
            self._jobs.put(job)

    def report_results(self) -> None:
        """Report the results of finished requests."""
        while self._outcomes:
            self._outcomes.popleft()()

    @property
    def requested(self) -> int:
        """Number of requests so far."""
        return self._requested

    @property
    def finished(self) -> int:
        """Number of finished requests, which are executed in their order."""
        return self._finished

    def close(self) -> None:
        """Return when all is stored."""
        if self._thread is not None:
            self._jobs.put(None)
            self._thread.join()
            self._thread = None
        self.report_results()

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()
