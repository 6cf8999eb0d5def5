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

Failed = Callable[[OSError], None]


class Storing:
    """Stores in the order of the requests; `aside`: in a thread, else immediately."""

    def __init__(self, aside: bool) -> None:
        self._asked = 0
        self._done = 0  # counted up by the thread alone
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._outcomes: deque[Callable[[], None]] = deque()
        self._thread: Thread | None = None
        if aside:
            self._thread = Thread(target=self._work, name="storing", daemon=True)
            self._thread.start()

    def ask(self, store: Callable[[], None], failed: Failed, stored: Callable[[], None]) -> None:
        """Request that something is stored; `attend` then calls `failed` or `stored`."""

        def job() -> None:
            try:
                store()
            except OSError as error:
                self._outcomes.append(partial(failed, error))
            else:
                self._outcomes.append(stored)
            self._done += 1

        self._asked += 1
        if self._thread is None:
            job()
            self.attend()
        else:
            self._jobs.put(job)

    def attend(self) -> None:
        """Report the results of finished requests."""
        while self._outcomes:
            self._outcomes.popleft()()

    @property
    def asked(self) -> int:
        """Number of requests so far."""
        return self._asked

    @property
    def done(self) -> int:
        """Number of finished requests, which are executed in their order."""
        return self._done

    def close(self) -> None:
        """Return when all is stored."""
        if self._thread is not None:
            self._jobs.put(None)
            self._thread.join()
            self._thread = None
        self.attend()

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()
