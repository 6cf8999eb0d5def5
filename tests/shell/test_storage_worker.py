"""Storing in a thread: in order, reported when it is done, and messages to the ground wait for it."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest

from autopilot.shell.atomic_file import write_atomically
from autopilot.shell.ground import GroundStations
from autopilot.shell.storage_worker import StorageWorker


@pytest.fixture
def aside() -> Iterator[StorageWorker]:
    storing = StorageWorker(threaded=True)
    yield storing
    storing.close()


LISTENER = ("127.0.0.1", 0)


def nothing(error: OSError) -> None:
    raise AssertionError(error)


def test_what_is_asked_for_is_done_in_order_and_told_by_who_asked(aside: StorageWorker) -> None:
    done: list[int] = []
    told: list[int] = []
    for number in range(20):
        aside.request(lambda n=number: done.append(n), nothing, lambda n=number: told.append(n))
    assert not told, "not by the thread"
    aside.close()
    assert done == told == list(range(20))
    assert aside.requested == aside.finished == 20


@pytest.mark.parametrize("by_thread", [True, False])
def test_what_cannot_be_stored_is_told_and_what_follows_is_stored(by_thread: bool) -> None:
    storing = StorageWorker(by_thread)
    told: list[str] = []

    def full() -> None:
        raise OSError(28, "No space left on device")

    storing.request(full, lambda error: told.append(str(error.strerror)), lambda: told.append("stored"))
    storing.request(lambda: None, nothing, lambda: told.append("stored"))
    storing.close()
    assert told == ["No space left on device", "stored"]


def test_where_the_clock_waits_it_is_done_at_once() -> None:
    done: list[str] = []
    StorageWorker(threaded=False).request(lambda: done.append("stored"), nothing, lambda: done.append("told"))
    assert done == ["stored", "told"]


def test_the_loop_does_not_wait_for_a_disk_and_the_ground_does(
    aside: StorageWorker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a slow disk, ticks continue, and no answer is sent before what it reports is stored."""
    monkeypatch.setattr(time, "perf_counter", lambda: 0.0)  # a tick has time to send all, on any machine
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(LISTENER)
        listener.setblocking(False)
        stations = GroundStations((listener.getsockname(),), (), None, aside)
        link = (0, listener.getsockname())
        onboard: Any = SimpleNamespace(said=[b"before"])
        onboard.ground_datagrams = lambda: [(link, datagram) for datagram in onboard.said]
        disk = Event()

        def wait_for_disk() -> None:
            disk.wait()

        stations.send(onboard)
        aside.request(wait_for_disk, nothing, lambda: None)
        for said in (b"the answer", b"telemetry"):
            onboard.said = [said]
            stations.send(onboard)
        assert listener.recv(100) == b"before"
        with pytest.raises(BlockingIOError):
            listener.recv(100)
        disk.set()
        aside.close()
        onboard.said = []
        stations.send(onboard)
        assert [listener.recv(100), listener.recv(100)] == [b"the answer", b"telemetry"]
        stations.close()


def test_what_is_told_as_stored_lies_on_the_disk(
    tmp_path: Path, aside: StorageWorker, monkeypatch: Any
) -> None:
    synced: list[bool] = []
    monkeypatch.setattr(os, "fsync", lambda handle: synced.append(True))
    before: list[int] = []
    aside.request(
        lambda: write_atomically(tmp_path / "mission.bin", b"m"), nothing, lambda: before.append(len(synced))
    )
    aside.close()
    assert before == [2], "the file and its directory"
