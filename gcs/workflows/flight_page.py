"""The live page of one `gcs fly`: a separate process, to which the ground station passes what it receives.

The flight never waits for the page. Requests of the user on the page come back as frames, which the ground
station sends to the vehicle as its own, in lockstep at its turn.
"""

from __future__ import annotations

import os
import select
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from autopilot.own.law import law_name
from gcs.clients.capture import Capture
from gcs.clients.datagrams import messages
from gcs.clients.flight import FlightClient
from gcs.errors import GcsError
from gcs.foreign_mission import home_of
from gcs.mission_items import items_of
from gcs.shell.display import notify
from gcs.shell.feed import COMMAND, EVENT, TRUTH, VEHICLE, FeedEnd, feed_pipe
from gcs.shell.processes import Processes
from gcs.shell.stopping import StopRequest
from gcs.view.places import waypoints_record
from gcs.workflows.flight_options import FlightOptions, parse_setting
from gcs.workflows.view import open_browser, warn_if_reachable
from missions.model import Mission

_START_LIMIT_S = 20.0  # until the page's process must have sent its address
_READER_S = 15.0  # until the opened browser must show the page
_RELOAD_S = 3.0  # within which a closed page may be opened again, as by a reload
_WAIT_S = 0.1


@dataclass(frozen=True)
class PageOptions:
    """Where the page of a flight is served."""

    host: str
    port: int | None  # None: any free port


class FlightPage:
    """The end of the flight's process."""

    def __init__(self, feed: FeedEnd, host: str) -> None:
        self.address = ""
        self._host = host
        self._feed = feed
        self._readers = 0
        self._had_readers = False
        self._stage = ""
        self._requested_frames: list[bytes] = []

    # ---- in flight

    def turn(
        self,
        client: FlightClient,
        capture: Capture,
        truth: list[bytes],
        vehicle: list[bytes],
        now_us: int,
        may_send: bool,
    ) -> list[bytes]:
        """Pass what was received to the page; return the datagrams for the vehicle that the page requested.

        These wait for a turn at which the ground station may send (`may_send`).
        """
        self._feed.send_datagrams(TRUTH, now_us, truth)
        self._feed.send_datagrams(VEHICLE, now_us, vehicle)
        if client.stage.value != self._stage:
            self._stage = client.stage.value
            self.send_event(stage=self._stage)
        self._receive()
        if not may_send or not self._requested_frames or client.outcome is not None:
            return []
        frames, self._requested_frames = self._requested_frames, []
        sent = [client.connection.frame(one.message) for frame in frames for one in messages(frame)[0]]
        client.start_manual_control()
        for datagram in sent:
            capture.on_sent(datagram)
        return sent

    def send_event(self, **record: Any) -> None:
        """Send the page news about the flight as a whole."""
        self._feed.send_event(record)

    # ---- before and after it

    def await_address(self) -> None:
        """Wait until the page is served; GcsError if it cannot be."""
        self._wait(_START_LIMIT_S, lambda: bool(self.address))
        if not self.address:
            raise GcsError("the process of the live page does not start")

    def await_reader(self, stop: StopRequest) -> None:
        """Open a browser and wait until it shows the page; without a screen, do not wait."""
        notify(f"live page: {self.address}")
        warn_if_reachable(self._host)
        if open_browser(self.address):
            self._wait(_READER_S, lambda: bool(self._readers or stop))

    def keep_open(self, stop: StopRequest) -> None:
        """Keep the page, if a browser has opened it, until the last one closes it, or until Ctrl-C."""
        if stop:
            return
        self._receive()
        if not self._had_readers:
            notify("no page was opened: the live page ends with the flight")
            return
        notify("the page stays until it is closed or Ctrl-C ends it")
        closed_s = 0.0
        while not stop and closed_s < _RELOAD_S and not self._feed.closed:
            select.select([self._feed], [], [], _WAIT_S)
            self._receive()
            closed_s = closed_s + _WAIT_S if self._had_readers and not self._readers else 0.0

    def _wait(self, limit_s: float, done: Any) -> None:
        waited_s = 0.0
        while not done() and waited_s < limit_s and not self._feed.closed:
            if not select.select([self._feed], [], [], _WAIT_S)[0]:
                waited_s += _WAIT_S
            self._receive()

    def _receive(self) -> None:
        for message in self._feed.read():
            if message.kind == COMMAND:
                self._requested_frames.append(message.body)
            elif message.kind == EVENT:
                event = message.event
                if "trouble" in event:
                    raise GcsError(event["trouble"])
                self.address = event.get("address", self.address)
                self._readers = event.get("readers", self._readers)
                self._had_readers = self._had_readers or self._readers > 0


@contextmanager
def flight_page(mission: Mission, options: FlightOptions, page: PageOptions) -> Iterator[FlightPage]:
    """Start the page of a flight, and end it afterwards."""
    flight_end, page_end = feed_pipe()
    with closing(flight_end), Processes() as processes:
        with closing(page_end):
            arguments = ["view", "--feed", str(page_end.fileno()), "--bind", page.host]
            if page.port is not None:
                arguments += ["--port", str(page.port)]
            processes.start("gcs", arguments, Path(os.devnull), (page_end.fileno(),))
        served_page = FlightPage(flight_end, page.host)
        served_page.await_address()
        served_page.send_event(**_session_record(mission, options))
        yield served_page


def _session_record(mission: Mission, options: FlightOptions) -> dict[str, Any]:
    own, home = options.connect is None, home_of(mission)
    record: dict[str, Any] = {"kind": "fly", "mission": mission.name, "title": mission.title}
    record["waypoints"] = waypoints_record(items_of(mission, home), home)
    if own:
        record |= {"law": law_name(options.law), "sensors": options.sensors, "vehicle_name": options.vehicle}
        record |= {"seed": options.seed, "speed": options.speed}
        record["settings"] = dict(parse_setting(setting) for setting in options.settings)
    return record
