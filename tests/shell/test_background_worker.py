"""The process that prepares paths: it answers, gives up useless work, and its death is reported."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import pytest

from autopilot.onboard.path_work import PathWork
from autopilot.own.own_code import OwnSetup
from autopilot.shell.background_worker import BackgroundWorker
from autopilot.supervisor.state import Phase
from autopilot.trajectory.prepare import PreparedPaths
from missions.model import Waypoint
from tests.doubles.craft import Craft

LIMIT_S = 600.0  # for work that takes a second on an idle machine, and may get a hundredth of a busy one


class Waiting:
    """What `BackgroundWorker` uses of the autopilot, with work to be done."""

    def __init__(self, phase: Phase = Phase.HOLD) -> None:
        self.phase = phase
        self.warmup_work = Craft().onboard.warmup_work
        self.work: PathWork | None = None
        self.finished: list[tuple[PathWork, PreparedPaths]] = []

    def ask(self, east_m: float) -> PathWork:
        steps = (Waypoint(0.0, 0.0, 2.0, 1.0), Waypoint(east_m, 0.0, 2.0, 1.0))
        self.work = PathWork(steps, (0, 1), self.warmup_work.paths.limits)
        return self.work

    def finish(self, work: PathWork, prepared: PreparedPaths) -> None:
        self.finished.append((work, prepared))
        if work is self.work:
            self.work = None


@pytest.fixture
def aside() -> Iterator[BackgroundWorker]:
    worker = BackgroundWorker()
    yield worker
    worker.close()
    assert not multiprocessing.active_children()


@pytest.fixture
def forked(aside: BackgroundWorker, monkeypatch: pytest.MonkeyPatch) -> BackgroundWorker:
    """With a process that has branched off: it is ready at once, without a second of loading."""
    monkeypatch.setattr("threading.active_count", lambda: 1)  # the threads of the tests hold no lock of ours
    aside.fork()
    aside.start(Waiting().warmup_work)
    return aside


def attend(aside: BackgroundWorker, onboard: Any, until: Callable[[], bool]) -> None:
    """Attend as often as a loop of 200 Hz does, and leave the processor to the process in between."""
    end = time.monotonic() + LIMIT_S
    while not until():
        assert time.monotonic() < end
        aside.update(onboard)
        wait([process.sentinel for process in multiprocessing.active_children()], 0.005)


def test_one_process_does_one_work_after_the_other(aside: BackgroundWorker) -> None:
    onboard = Waiting()
    aside.start(onboard.warmup_work)
    (process,) = multiprocessing.active_children()
    for east_m in (1.0, 2.0):
        work = onboard.ask(east_m)
        attend(aside, onboard, lambda: onboard.work is None)
        assert onboard.finished[-1] == (work, work.run())
    assert multiprocessing.active_children() == [process]


def test_one_that_branched_off_does_the_same(forked: BackgroundWorker) -> None:
    onboard = Waiting()
    (process,) = multiprocessing.active_children()
    work = onboard.ask(1.0)
    attend(forked, onboard, lambda: onboard.work is None)
    assert onboard.finished == [(work, work.run())]
    assert multiprocessing.active_children() == [process]


def test_a_planner_that_hangs_is_broken_off_and_named(forked: BackgroundWorker, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("""
import time

class Hangs:
    def plan(self, route):
        time.sleep(600.0)
""")
    onboard = Waiting()
    work = onboard.ask(1.0)
    onboard.work = work = work._replace(planner=OwnSetup(f"{tmp_path}/mine.py:Hangs", {}))
    attend(forked, onboard, lambda: onboard.work is None)
    ((done, prepared),) = onboard.finished
    assert done is work
    reason = "no answer within 5 s: an endless loop, or too much work for one call (mine.py:6)"
    assert f"Planner Hangs failed: TooSlow: {reason}" in prepared.refusal


def test_what_is_asked_for_later_is_done_when_what_goes_on_is_over(forked: BackgroundWorker) -> None:
    onboard = Waiting()
    first = onboard.ask(1.0)
    forked.update(onboard)  # type: ignore[arg-type]
    later = onboard.ask(2.0)
    attend(forked, onboard, lambda: onboard.work is None)
    assert [work for work, _ in onboard.finished] == [first, later]


def test_the_loop_goes_on_while_the_process_still_loads(aside: BackgroundWorker) -> None:
    onboard = Waiting(Phase.DISARMED)
    aside.start(onboard.warmup_work)
    work = onboard.ask(1.0)
    aside.update(onboard)  # type: ignore[arg-type]
    assert onboard.work is work
    attend(aside, onboard, lambda: onboard.work is None)
    assert onboard.finished == [(work, work.run())]


def test_on_the_ground_no_process_is_started_where_there_was_none(aside: BackgroundWorker) -> None:
    onboard = Waiting(Phase.DISARMED)
    work = onboard.ask(1.0)
    aside.update(onboard)  # type: ignore[arg-type]
    assert onboard.finished == [(work, work.run())]


def test_what_takes_long_and_is_of_no_use_any_more_is_given_up(forked: BackgroundWorker) -> None:
    onboard = Waiting()
    places = tuple(Waypoint(float(i % 7), float(i % 5), 2.0) for i in range(400))
    onboard.work = PathWork(places, tuple(range(400)), onboard.warmup_work.paths.limits)
    forked.update(onboard)  # type: ignore[arg-type]
    later = onboard.ask(2.0)
    attend(forked, onboard, lambda: onboard.work is None)
    assert [work for work, _ in onboard.finished] == [later]


def test_a_process_that_dies_at_its_work_is_a_refusal(forked: BackgroundWorker) -> None:
    onboard = Waiting()
    work = onboard.ask(1.0)
    forked.update(onboard)  # type: ignore[arg-type]
    (process,) = multiprocessing.active_children()
    process.kill()
    attend(forked, onboard, lambda: onboard.work is None)
    ((done, prepared),) = onboard.finished
    assert done is work
    assert prepared.refusal == "the process that prepares paths has died"


def test_a_process_that_died_is_replaced_on_the_ground_too(aside: BackgroundWorker) -> None:
    onboard = Waiting(Phase.DISARMED)
    aside.start(onboard.warmup_work)
    (process,) = multiprocessing.active_children()
    process.kill()
    attend(aside, onboard, lambda: not multiprocessing.active_children())
    onboard.ask(1.0)
    aside.update(onboard)  # type: ignore[arg-type]
    assert not onboard.finished, "the loop does not do the work itself"
    attend(aside, onboard, lambda: onboard.work is None)
    assert not onboard.finished[-1][1].refusal


def test_a_process_that_died_idle_is_replaced(aside: BackgroundWorker) -> None:
    onboard = Waiting()
    aside.start(onboard.warmup_work)
    (process,) = multiprocessing.active_children()
    process.kill()
    process.join()
    onboard.ask(1.0)
    attend(aside, onboard, lambda: onboard.work is None)
    assert not onboard.finished[-1][1].refusal
