"""Storing aside: what a disk takes long to do is done by a thread, and the ground hears of it afterwards.

What is said to the ground stations waits, in its order, until all that was to be stored before it lies on the
disk: so an answer that says that something is stored is true, and the control loop waits for no disk.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from threading import Thread

Failed = Callable[[OSError], None]


class Storing:
    """Stores in the order in which it is asked to; `aside`: by a thread, else at once."""

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
        """Have something stored; `failed` or `stored` is called by `attend`."""

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
        """Tell what has come of it."""
        while self._outcomes:
            self._outcomes.popleft()()

    @property
    def asked(self) -> int:
        """How often something was asked for."""
        return self._asked

    @property
    def done(self) -> int:
        """How much of that is done, the first first."""
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
