"""Who flies a sweep: processes of our own on all cores, or the workers of a Dask cluster."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from typing import Any

from gcs.errors import GcsError
from gcs.sweep.plan import Case
from gcs.sweep.store import Row, Store
from gcs.sweep.work import Work, batches, fly_case

BATCH = 4  # flights handed over at a time: about a second
_AHEAD = 2  # batches waiting for each worker
_KEEP_S, _KEEP_ROWS = 5.0, 1000  # what is flown is on disk after so long, or so many
_POLL_S = 0.2


def fly_batch(work: Work, cases: tuple[Case, ...]) -> list[Row]:
    """Fly some flights, one after the other; what a worker runs."""
    return [fly_case(work, case, time.monotonic) for case in cases]


@contextmanager
def own_processes(jobs: int) -> Iterator[tuple[Executor, int]]:
    """`jobs` processes of our own."""
    executor = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_begin_worker)
    try:
        yield executor, jobs
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


@contextmanager
def dask_cluster(address: str) -> Iterator[tuple[Executor, int]]:
    """The workers of a running Dask scheduler, which must have this version of Plumbline."""
    try:
        from distributed import Client
    except ImportError:
        raise GcsError("--scheduler needs Dask: pip install 'plumbline[dask]'") from None
    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise GcsError(f"no Dask scheduler answers at {address}: {str(error) or 'timed out'}") from None
    try:
        workers = sum(client.nthreads().values())
        if workers == 0:
            raise GcsError(f"the Dask scheduler at {address} has no workers")
        yield client.get_executor(pure=False), workers
    finally:
        client.close()


def _begin_worker() -> None:
    """Ctrl-C is the parent's affair; without a parent there is nobody to fly for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)


def fly_all(
    work: Work,
    cases: Sequence[Case],
    executor: Executor,
    workers: int,
    store: Store,
    told: Callable[[list[Row]], None],
    stopped: Callable[[], bool],
) -> bool:
    """Fly the cases and store their rows; False if it was stopped before the end.

    `told` is given the rows as they come, and called without any now and then.
    """
    waiting = iter(batches(cases, BATCH))
    flying: set[Future[list[Row]]] = set()
    kept: list[Row] = []
    kept_s = time.monotonic()
    exhausted = False
    try:
        while not stopped():
            while not exhausted and len(flying) < workers * _AHEAD:
                batch = next(waiting, None)
                if batch is None:
                    exhausted = True
                else:
                    flying.add(executor.submit(fly_batch, work, batch))
            if not flying:
                return True
            done, flying = wait(flying, _POLL_S, FIRST_COMPLETED)
            rows = [row for future in done for row in future.result()]
            kept += rows
            told(rows)
            if len(kept) >= _KEEP_ROWS or (kept and time.monotonic() - kept_s > _KEEP_S):
                store.add(kept)
                kept, kept_s = [], time.monotonic()
    except BrokenProcessPool:
        raise GcsError("a worker was killed; what is flown is kept, the same command goes on") from None
    finally:
        for future in flying:
            future.cancel()
        # what is in the air comes down in a second or two; a second Ctrl-C does not wait
        landed, _ = wait([future for future in flying if not future.cancelled()])
        kept += [row for future in landed if future.exception() is None for row in future.result()]
        store.add(kept)
    return False
