"""Work for another process. A module of its own, because a spawned process cannot import `__main__`."""

from __future__ import annotations

import signal
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from autopilot.onboard.onboard import Onboard, Work
from autopilot.trajectory.prepare import Prepared


class Aside:
    """Work for which the control loop must not wait, done by a process of its own."""

    def __init__(self) -> None:
        self._work: Work | None = None
        self._process: SpawnProcess | None = None
        self._answer: Connection | None = None

    def attend(self, onboard: Onboard) -> None:
        """Begin what waits; hand over what is done."""
        if onboard.work is not None and onboard.work is not self._work:
            self.close()
            self._work = onboard.work
            context = get_context("spawn")
            self._answer, theirs = context.Pipe(duplex=False)
            self._process = context.Process(target=_work_aside, args=(onboard.work, theirs), daemon=True)
            self._process.start()
            theirs.close()
        if self._answer is not None and self._work is not None and self._answer.poll():
            try:
                onboard.finish(self._work, self._answer.recv())
            except EOFError:
                text = "the process that prepares paths has died"
                onboard.finish(self._work, Prepared(refusal=text, notes=(text,)))
            self.close()

    def close(self) -> None:
        """End what goes on."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        if self._answer is not None:
            self._answer.close()
        self._work = self._process = self._answer = None


def _work_aside(work: Work, answer: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever began it ends it
    answer.send(work.done())
