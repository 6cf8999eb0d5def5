"""A sweep that is asked to stop finishes the flights in the air and begins no others."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor, wait
from multiprocessing import active_children
from types import SimpleNamespace
from typing import Any

import pytest

from gcs.batch import pool
from gcs.batch.pool import PoolBackend, local_processes
from gcs.batch.runner import fly_all
from gcs.errors import GcsError
from gcs.sweep import work

GROUPS = [tuple(range(first, first + 16)) for first in range(0, 160, 16)]


class Threads(ThreadPoolExecutor):
    """One thread in place of processes."""

    def __init__(self, recalled: threading.Event) -> None:
        super().__init__(1)
        self._event = recalled

    def request_stop(self) -> None:
        self._event.set()


@pytest.fixture
def recalled(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    event = threading.Event()
    monkeypatch.setattr(pool, "STOP_EVENTS", [event])
    yield event
    event.set()


def test_groups_and_flights_that_have_not_begun_are_recalled(recalled: threading.Event) -> None:
    in_the_air = threading.Event()

    def fly(group: tuple[int, ...], clock: Any, stopped: Any) -> list[int]:
        flown = []
        for flight in group:
            if stopped():
                break
            if flight == 2:
                in_the_air.set()
                assert recalled.wait(60.0)
            flown.append(flight)
        return flown

    stored: list[int] = []
    with Threads(recalled) as executor:
        crew: PoolBackend[int, int] = PoolBackend(executor, 1, fly)
        whole = fly_all(GROUPS, crew, stored.extend, lambda *_: None, in_the_air.is_set)
    assert not whole
    assert stored == [0, 1, 2]


def test_what_others_have_flown_is_kept_when_a_worker_fails() -> None:
    both_begun = threading.Barrier(2)

    def fly(group: tuple[int, ...], clock: Any, stopped: Any) -> list[int]:
        both_begun.wait(60.0)
        if group == (1,):
            raise OSError("killed")
        return list(group)

    with ThreadPoolExecutor(2) as executor:
        crew: PoolBackend[int, int] = PoolBackend(executor, 2, fly)
        crew.start((0,))
        crew.start((1,))
        executor.shutdown(wait=True)  # both have ended before the first is asked for
        assert list(crew.collect()) == [0]
        with pytest.raises(OSError, match="killed"):
            crew.collect()


class Gone(Executor):
    """Cancels what it is given, as the client of a Dask scheduler that has gone does."""

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.cancel()
        future.set_running_or_notify_cancel()
        return future


def test_a_scheduler_that_is_gone_is_told() -> None:
    crew: PoolBackend[int, int] = PoolBackend(Gone(), 1, lambda group, clock, stopped: list(group))
    crew.start((0,))
    with pytest.raises(GcsError, match="the Dask scheduler is gone; completed flights are stored"):
        crew.collect()
    crew.start((1,))
    assert crew.stop() == []


def test_a_sweep_begins_no_flight_after_it_was_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    flown: list[int] = []

    def fly_one(_: object, case: Any, clock: object) -> Any:
        flown.append(case.index)
        return {"index": case.index}

    monkeypatch.setattr(work, "fly_one", fly_one)
    monkeypatch.setattr(work, "sweep_files", lambda plan: {})
    cases: Any = [SimpleNamespace(law="plumbline", varied=(), index=index) for index in range(20)]
    for own in ((), ("mine.py",)):
        flown.clear()
        plan = SimpleNamespace(own=lambda _law, own=own: own)
        prepared: Any = SimpleNamespace(plan=plan, files={}, lane_laws=frozenset())
        rows = work.fly_cases(prepared, cases, lambda: 0.0, lambda: len(flown) == 11)
        assert [row["index"] for row in rows] == flown == list(range(11))


def _never_ends() -> None:
    signal.pause()


def test_what_is_abandoned_is_not_waited_for() -> None:
    with pytest.raises(KeyboardInterrupt), local_processes(1) as (executor, _):
        flying = executor.submit(_never_ends)
        while not flying.running():
            wait([flying], 0.01)
        raise KeyboardInterrupt
    assert not active_children()
