"""Work for another process. It is a separate module because a spawned process cannot import `__main__`."""

from __future__ import annotations

import gc
import signal
import time
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import ForkContext, SpawnContext
from multiprocessing.process import BaseProcess

from autopilot.onboard.onboard import Onboard, SetupWork, WarmupWork
from autopilot.onboard.path_work import PathWork
from autopilot.shell.options import can_fork
from autopilot.shell.watched_calls import watched_calls
from autopilot.supervisor.state import ON_GROUND

_MAX_OBSOLETE_S = 1.0  # longest wait for obsolete work; about the time in which a new process loads


class BackgroundWorker:
    """Work for which the control loop must not wait, done by a separate process that is kept ready.

    If it was not started because the clock waits, a vehicle on the ground does its work itself.
    """

    def __init__(self) -> None:
        self._work: PathWork | SetupWork | None = None  # present work of the process
        self._start_s = 0.0  # when it began
        self._loaded = False
        self._was_started = False  # a process that has died is replaced
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None

    def fork(self) -> None:
        """Fork the process with what is loaded here, while there is no thread, lock or socket to inherit.

        If that is impossible, `start` begins a process that loads everything itself: a second of processor
        time.
        """
        if can_fork():
            self._start_process(get_context("fork"))

    def start(self, warmup_work: WarmupWork) -> None:
        """Have the process load what it needs by doing `warmup_work`."""
        if self._process is None:
            self._start_process(get_context("spawn"))
        with suppress(OSError):  # it has died: the next check notices that
            self._pipe.send(warmup_work)  # type: ignore[union-attr]

    def _start_process(self, context: ForkContext | SpawnContext) -> None:
        self._pipe, child_end = context.Pipe()
        parent_end = self._pipe if isinstance(context, ForkContext) else None
        self._process = context.Process(target=_serve, args=(child_end, parent_end), daemon=True)
        self._process.start()
        self._was_started = True
        child_end.close()

    def update(self, onboard: Onboard) -> None:
        """Begin waiting work; hand over finished work."""
        if (self._work is not None or not self._loaded) and self._pipe is not None and self._pipe.poll():
            self._receive_result(self._pipe, onboard)
        if onboard.work is None or self._work is onboard.work:
            return
        if self._work is not None:  # obsolete work, which usually does not take long
            if not self._loaded or time.monotonic() - self._start_s < _MAX_OBSOLETE_S:
                return
            self.close()
            self.start(onboard.warmup_work)
        if self._pipe is None and onboard.phase in ON_GROUND and not self._was_started:
            onboard.finish(onboard.work, onboard.work.run())
            return
        if self._pipe is None:
            self.start(onboard.warmup_work)
        self._work, self._start_s = onboard.work, time.monotonic()
        with suppress(OSError):  # it has died idle: the next check notices that
            self._pipe.send(self._work)  # type: ignore[union-attr]

    def _receive_result(self, pipe: Connection, onboard: Onboard) -> None:
        try:
            result = pipe.recv()
        except (EOFError, OSError):
            work = self._work
            self.close()
            if work is not None:
                onboard.finish(work, work.failure("the process that prepares paths has died"))
            return
        if not self._loaded:
            self._loaded, self._start_s = True, time.monotonic()  # its first message
        elif self._work is not None:
            work, self._work = self._work, None
            onboard.finish(work, result)

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        if self._pipe is not None:
            self._pipe.close()
        self._work = self._process = self._pipe = None
        self._loaded = False


def _serve(pipe: Connection, parent_end: Connection | None) -> None:
    """Do the work that arrives by `pipe`. A fork inherits the parent's end too, and closes it, since it would
    not notice otherwise that the parent has closed it."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the parent ends this process
    if parent_end is not None:
        parent_end.close()
        gc.enable()
    with suppress(EOFError, OSError), watched_calls():  # our parent is gone
        warmup_work: WarmupWork = pipe.recv()
        warmup_work.run()
        pipe.send(None)  # ready
        while True:
            work: PathWork | SetupWork = pipe.recv()
            pipe.send(work.run())
