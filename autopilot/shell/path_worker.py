"""Work for another process. A module of its own, because a spawned process cannot import `__main__`."""

from __future__ import annotations

import signal
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from autopilot.onboard.onboard import Onboard, Work
from autopilot.shell.options import StopRequest
from autopilot.trajectory.prepare import Prepared

_LOOK_S = 0.1  # between two looks at a request to stop


class Aside:
    """Work for which the control loop must not wait, done by a process of its own that is kept ready."""

    def __init__(self) -> None:
        self._work: Work | None = None  # what it is at
        self._process: SpawnProcess | None = None
        self._pipe: Connection | None = None

    def start(self, rehearsal: Work) -> None:
        """Have the process load what it needs, which it does by `rehearsal`; takes a second."""
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(rehearsal, theirs), daemon=True)
        self._process.start()
        theirs.close()

    def wait(self, stop: StopRequest) -> None:
        """Until the process has loaded what it needs: a vehicle that is armed does not wait for it."""
        while self._pipe is not None and not self._pipe.poll(_LOOK_S):
            stop.check()

    def attend(self, onboard: Onboard) -> None:
        """Begin what waits; hand over what is done."""
        if onboard.work is not None and onboard.work is not self._work:
            if self._work is not None:  # what it is at is of no use any more
                self.close()
            if self._pipe is None:
                self.start(onboard.rehearsal)
            self._work = onboard.work
            self._send(onboard.work)
        if self._work is not None and self._pipe is not None and self._pipe.poll():
            work = self._work
            try:
                prepared = self._pipe.recv()
            except (EOFError, OSError):
                text = "the process that prepares paths has died"
                prepared = Prepared(refusal=text, notes=(text,))
                self.close()
            if prepared is not None:
                self._work = None
                onboard.finish(work, prepared)

    def _send(self, work: Work) -> None:
        if self._pipe is not None:
            try:
                self._pipe.send(work)
            except OSError:  # it has died idle, and another takes its place
                self.close()
                self.start(work)
                self._work = work
                self._pipe.send(work)

    def close(self) -> None:
        """End what goes on."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        if self._pipe is not None:
            self._pipe.close()
        self._work = self._process = self._pipe = None


def _serve(rehearsal: Work, pipe: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever began it ends it
    rehearsal.done()
    with suppress(EOFError, OSError):  # our parent is gone
        pipe.send(None)  # ready
        while True:
            work: Work = pipe.recv()
            pipe.send(work.done())
