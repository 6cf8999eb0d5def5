"""Flights as function calls, in a pool of processes on all cores or on a Dask cluster."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from autopilot.shell.options import can_fork
from gcs.batch.runner import Running
from gcs.errors import GcsError, from_clone

F = TypeVar("F")
R = TypeVar("R")

Clock = Callable[[], float]  # seconds
Stopped = Callable[[], bool]
# returns the results of the flights that were flown before `Stopped` returned True; must be picklable
FlyMany = Callable[[tuple[F, ...], Clock, Stopped], list[R]]

_QUEUED_GROUPS = 2  # groups waiting for each worker
_POLL_S = 0.2


def fly_group(fly: FlyMany[F, R], group: tuple[F, ...]) -> list[R]:
    """Fly a group of flights; runs in a worker."""
    return fly(group, time.monotonic, _is_stopped)


STOP_EVENTS: list[
    Any
] = []  # in a worker of `LocalProcesses`: the event that requests that no more flights begin


def _is_stopped() -> bool:
    return any(event.is_set() for event in STOP_EVENTS)


@runtime_checkable
class Stoppable(Protocol):
    """An executor that can be stopped: its workers then start no more flights, not even the remaining flights
    of groups that they have started."""

    def request_stop(self) -> None: ...


class LocalProcesses(ProcessPoolExecutor):
    """Worker processes on this machine. The groups that they have already fetched cannot be cancelled, so an
    event stops them.

    They are forked, with all modules that are loaded here, if no thread can hold a lock. Otherwise each of
    them imports the modules again, which takes seconds.
    """

    def __init__(self, jobs: int) -> None:
        is_forked = can_fork()
        context = get_context("fork" if is_forked else "spawn")
        self._stop_event = context.Event()
        super().__init__(
            jobs, mp_context=context, initializer=_initialize_worker, initargs=(self._stop_event,)
        )
        if is_forked:
            self.submit(_no_op)  # starts all processes now

    def request_stop(self) -> None:
        self._stop_event.set()


class PoolBackend(Generic[F, R]):
    """A backend that consists of the `workers` of an executor; each calls `fly` with its flights."""

    def __init__(self, executor: Executor, workers: int, fly: FlyMany[F, R]) -> None:
        self._executor, self._workers, self._fly = executor, workers, fly
        self._futures: set[Future[list[R]]] = set()

    @property
    def has_capacity(self) -> bool:
        return len(self._futures) < self._workers * _QUEUED_GROUPS

    @property
    def is_idle(self) -> bool:
        return not self._futures

    def start(self, group: tuple[F, ...]) -> None:
        with _lost_worker_as_error():
            self._futures.add(self._executor.submit(fly_group, self._fly, group))

    def collect(self) -> Sequence[R]:
        done, self._futures = wait(self._futures, _POLL_S, FIRST_COMPLETED)
        failed = {future for future in done if not _has_result(future)}
        if len(failed) < len(done):  # what others have flown is kept; the next call meets the failure
            self._futures |= failed
            done -= failed
        with _lost_worker_as_error():
            return [result for future in done for result in future.result()]

    def running(self) -> Running:
        return ()

    def stop(self) -> Sequence[R]:
        """Wait for the flights in progress, one or eight per worker; a second Ctrl-C does not wait."""
        if isinstance(self._executor, Stoppable):
            self._executor.request_stop()
        for future in self._futures:
            future.cancel()
        ended, _ = wait([future for future in self._futures if not future.cancelled()])
        self._futures = set()
        return [result for future in ended if _has_result(future) for result in future.result()]


@contextmanager
def local_processes(jobs: int) -> Iterator[tuple[Executor, int]]:
    """`jobs` worker processes on this machine, which are killed if a second Ctrl-C abandons their flights."""
    executor = LocalProcesses(jobs)
    try:
        yield executor, jobs
    except KeyboardInterrupt:
        for worker in active_children():
            worker.kill()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


@contextmanager
def dask_cluster(address: str) -> Iterator[tuple[Executor, int]]:
    """The workers of a running Dask scheduler, which must have this version of Plumbline."""
    try:
        from distributed import Client
    except ImportError:
        raise GcsError(f"--scheduler needs Dask; install it with: pip install {from_clone('dask')}") from None
    # it would log the loss of the scheduler, which is reported as an error, with a traceback
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise GcsError(
            f"--scheduler {address}: no Dask scheduler answers: {str(error) or 'timed out'}"
        ) from None
    try:
        workers = sum(client.nthreads().values())
        if workers == 0:
            raise GcsError(f"--scheduler {address}: the Dask scheduler has no workers; start dask worker")
        yield client.get_executor(pure=False), workers
    finally:
        client.close()


def _has_result(future: Future[Any]) -> bool:
    return not future.cancelled() and future.exception() is None


@contextmanager
def _lost_worker_as_error() -> Iterator[None]:
    """Report the death of a worker process, and of a Dask scheduler, which cancels all its flights."""
    try:
        yield
    except (BrokenProcessPool, CancelledError) as error:
        lost = (
            "the Dask scheduler is gone"
            if isinstance(error, CancelledError)
            else "a worker process was killed"
        )
        raise GcsError(
            f"{lost}; completed flights are stored, run the same command again to continue"
        ) from None


def _no_op() -> None:
    """Do nothing."""


def _initialize_worker(stop_event: Any) -> None:
    """Prepare a worker: the parent handles Ctrl-C and a closed terminal; a worker whose parent is gone ends.

    The parent writes the results to stdout. Text printed in a worker, for example by a custom law, goes to
    stderr.
    """
    STOP_EVENTS.append(stop_event)
    sys.stdout = sys.stderr
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_exit_with, args=(parent,), daemon=True).start()


def _exit_with(parent: Any) -> None:
    parent.join()
    os._exit(1)
