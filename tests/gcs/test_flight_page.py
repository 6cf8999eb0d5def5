"""The live page of a flight after it: how long the command keeps it."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import closing

import pytest

from gcs.shell.feed import FeedEnd, feed_pipe, inherited_feed
from gcs.shell.stopping import StopRequest
from gcs.workflows import flight_page
from gcs.workflows.flight_page import FlightPage


@pytest.fixture
def ends() -> Iterator[tuple[FlightPage, FeedEnd]]:
    """The page as the flight has it, and the end of the feed at the process that serves it."""
    ours, theirs = feed_pipe()
    with closing(ours), closing(inherited_feed(theirs.detach())) as server:
        yield FlightPage(ours, "127.0.0.1"), server


def test_a_page_that_nobody_has_opened_ends_with_the_flight(
    ends: tuple[FlightPage, FeedEnd], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page, server = ends
    monkeypatch.setattr(flight_page.select, "select", lambda *_: pytest.fail("it waits for a page"))
    server.send_event({"address": "http://127.0.0.1:8090/key/"})
    with StopRequest("stopping") as stop:
        page.keep_open(stop)
    assert capsys.readouterr().err == "gcs: no page was opened: the live page ends with the flight\n"


def test_a_page_that_was_opened_during_the_flight_stays_until_it_is_closed(
    ends: tuple[FlightPage, FeedEnd], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page, server = ends
    waits: list[int] = []

    def select(read: object, write: object, error: object, timeout_s: float) -> None:
        waits.append(len(waits))
        if len(waits) == 100:  # the browser is closed
            server.send_event({"readers": 0})

    monkeypatch.setattr(flight_page.select, "select", select)
    server.send_event({"readers": 1})
    with StopRequest("stopping") as stop:
        page.keep_open(stop)
    assert 100 < len(waits) < 200  # and may be opened again for a moment, as by a reload
    assert capsys.readouterr().err == "gcs: the page stays until it is closed or Ctrl-C ends it\n"


def test_ctrl_c_ends_an_open_page(ends: tuple[FlightPage, FeedEnd], monkeypatch: pytest.MonkeyPatch) -> None:
    page, server = ends
    monkeypatch.setattr(flight_page.select, "select", lambda *_: os.kill(os.getpid(), signal.SIGINT))
    server.send_event({"readers": 1})
    with StopRequest("stopping") as stop:
        page.keep_open(stop)
        assert stop
