"""The live page of running vehicles: `gcs view`, and the process behind `gcs fly --view`."""

from __future__ import annotations

import asyncio
import os
import sys
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from autopilot.shell.options import stop_signals
from autopilot.vehicle.file import load_vehicle
from autopilot.wire.signing import Signing, timestamp_of
from gcs.clients.connection import Connection
from gcs.clients.truth import TruthSources
from gcs.errors import GcsError
from gcs.shell.display import notify
from gcs.shell.feed import COMMAND, EVENT, TRUTH, FeedEnd, inherited_feed
from gcs.shell.link import (
    LOOPBACK,
    SITL_TRUTH,
    Address,
    UdpSocket,
    VehicleLink,
    monotonic_us,
    open_address,
    unix_us,
)
from gcs.shell.page_server import PageCallbacks, PageServer, Site
from gcs.view.controls import SLIDERS
from gcs.view.station import Station
from gcs.web import LIVE_FILES, LIVE_PAGE, asset

STATE_S = 0.02  # between two records of the state
_TICK_S = 0.01


@dataclass(frozen=True)
class ViewOptions:
    """Options of `gcs view`."""

    connect: tuple[Address, ...]
    host: str = LOOPBACK
    port: int | None = None  # None: PAGE_PORT, or any free port
    opens_browser: bool = True  # opens a browser, if there is one
    truth: Address | None = SITL_TRUTH  # where the simulator sends the truth; None: it is not received


class Links(Protocol):
    """The links on which datagrams of vehicles are received and sent."""

    def poll(self, station: Station, now_us: int) -> None:
        """Pass all received datagrams to the station, and send what it returns."""

    def close(self) -> None:
        """Close all links."""


class UdpLinks:
    """Vehicles that were started separately, at one address or several."""

    def __init__(self, addresses: tuple[Address, ...], truth: Address | None) -> None:
        self._sockets: list[VehicleLink] = []
        self._routes: dict[int, tuple[VehicleLink, tuple[str, int]]] = {}  # socket and peer by system id
        # of `udpout:` and `tcp:` addresses: the vehicle waits until we send first
        self._outgoing: list[VehicleLink] = []
        self._truth: UdpSocket | None = None
        self._worlds = TruthSources()
        try:
            for address in addresses:
                self._sockets.append(open_address(address))
                if not address.listen:
                    self._outgoing.append(self._sockets[-1])
            if truth:
                self._truth = _truth_socket(truth)
        except GcsError:
            self.close()
            raise
        self._hello = Connection()

    def poll(self, station: Station, now_us: int) -> None:
        for link in self._sockets:
            for datagram, sender in link.drain_with_senders():
                for system in station.receive(datagram, now_us):
                    self._routes[system] = (link, sender)
        for datagram, sender in self._truth.drain_with_senders() if self._truth else ():
            run = self._worlds.run(datagram, sender)
            station.receive_truth(datagram, run, alone=len(self._worlds) == 1)
        for outgoing in station.poll(now_us):
            route = self._routes.get(outgoing.system)
            if route is not None:
                route[0].send_to(outgoing.datagram, route[1])
        if not self._routes:
            for datagram in self._hello.poll(now_us) if self._outgoing else ():
                for link in self._outgoing:
                    link.send(datagram)

    def close(self) -> None:
        for link in (*self._sockets, *((self._truth,) if self._truth else ())):
            link.close()


def _truth_socket(address: Address) -> UdpSocket | None:
    """The socket on which the simulator sends the truth; None if another program uses its port."""
    try:
        return UdpSocket(address.host, address.port)
    except GcsError:
        notify(
            f"UDP {address} is in use: the page shows what the autopilot believes; --truth names another port"
        )
        return None


class FeedLinks:
    """The vehicle of `gcs fly`, which passes on what it receives, and sends what the page requests."""

    def __init__(self, feed: FeedEnd, on_event: Callable[[dict[str, Any]], None]) -> None:
        self._feed = feed
        self._on_event = on_event

    def poll(self, station: Station, now_us: int) -> None:
        for message in self._feed.read():
            if message.kind == EVENT:
                self._on_event(message.event)
            elif message.kind == TRUTH:
                station.receive_truth(message.body)
            else:
                station.receive(message.body, now_us)
                station.sample(now_us)  # at each datagram, since a lockstep flight is faster than the clock
        for outgoing in station.poll(now_us):
            self._feed.send_datagrams(COMMAND, 0, [outgoing.datagram])

    @property
    def ended(self) -> bool:
        """Whether `gcs fly` has ended."""
        return self._feed.closed

    def close(self) -> None:
        self._feed.close()


@dataclass
class _Session:
    """The record about the flight as a whole for the page; in `gcs view` it contains nothing of a flight."""

    record: dict[str, Any] = field(default_factory=lambda: {"type": "session", "kind": "view"})


def view(options: ViewOptions) -> None:
    """Serve the page until Ctrl-C."""
    key = next((address.signing_key for address in options.connect if address.signing_key), None)
    signing = None if key is None else Signing(key, timestamp_of(unix_us()))
    station = Station(signing=signing, system=options.connect[0].system)
    links = UdpLinks(options.connect, options.truth)
    try:
        asyncio.run(_serve(station, links, options, _Session(), Site(_texts()), None))
    finally:
        links.close()


def serve_feed(descriptor: int, options: ViewOptions) -> None:
    """Serve the page of a flight that the parent process flies, until that ends this process."""
    feed = inherited_feed(descriptor)
    station = Station(active=False)
    session, site = _Session(), Site(_texts())
    servers: list[PageServer] = []

    def on_event(event: dict[str, Any]) -> None:
        if "report" in event:
            site.report = Path(event.pop("report"))
            event["report"] = "report/report.html"
        if "kind" in event:
            station.known_waypoints = event.pop("waypoints", [])
            station.known_parameters.update(
                _known_parameters(event.get("vehicle_name"), event.pop("settings", {}))
            )
        session.record = {**session.record, **event}
        for server in servers:
            server.send_to_all(session.record)

    links = FeedLinks(feed, on_event)
    try:
        asyncio.run(_serve(station, links, options, session, site, feed, servers))
    except GcsError as error:
        feed.send_event({"trouble": str(error)})
    finally:
        links.close()


async def _serve(
    station: Station,
    links: UdpLinks | FeedLinks,
    options: ViewOptions,
    session: _Session,
    site: Site,
    feed: FeedEnd | None,
    servers: list[PageServer] | None = None,
) -> None:
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in stop_signals():
        loop.add_signal_handler(number, stopped.set)

    def on_open() -> list[dict[str, Any]]:
        controls = [slider.record() for slider in SLIDERS]
        hello = {"type": "hello", "controls": controls}
        return [hello, *station.initial_records(), session.record]

    def on_count_changed(count: int) -> None:
        if feed is not None:
            feed.send_event({"readers": count})

    async with PageServer(
        site, PageCallbacks(on_open, station.handle_request, on_count_changed), options.host, options.port
    ) as server:
        if servers is not None:
            servers.append(server)
        if feed is not None:
            feed.send_event({"address": server.address})
        else:
            _announce(server.address, options)
        next_state_s = loop.time()
        while not stopped.is_set():
            now_us = monotonic_us()
            links.poll(station, now_us)
            for record in station.news():
                page = record.pop("page", None)
                if page is None:
                    server.send_to_all(record)
                else:
                    server.send_to(page, record)
            if loop.time() >= next_state_s:
                next_state_s = max(next_state_s + STATE_S, loop.time())
                if station.vehicles and server.readers:
                    server.send_to_all(station.state(now_us))
                else:
                    station.sample(now_us)
                    station.discard_samples()
            if isinstance(links, FeedLinks) and links.ended:
                return
            try:
                await asyncio.wait_for(stopped.wait(), _TICK_S)
            except TimeoutError:
                continue


def _known_parameters(vehicle: str | None, settings: dict[str, float]) -> dict[str, float]:
    """Parameters of the vehicle that was started for the flight, before they are changed on the page."""
    if vehicle is None:
        return {}
    vehicle_file = load_vehicle(vehicle)
    known = {slider.name: slider.default for slider in SLIDERS if slider.default is not None}
    known |= {"VEH_ARM_LEN": vehicle_file.arm_m, "VEH_CABLE_LEN": vehicle_file.cable_length_m}
    return {**known, "SIM_LOAD_MASS": vehicle_file.load_mass_kg, **settings}


def _announce(address: str, options: ViewOptions) -> None:
    print(f"live page: {address}", flush=True)
    warn_if_reachable(options.host)
    if options.opens_browser:
        open_browser(address)


def warn_if_reachable(host: str) -> None:
    """Print a line if other machines than this one can reach the page."""
    if host not in (LOOPBACK, "localhost", "::1"):
        notify("other machines can reach the page: anyone who knows its full address can command the vehicle")


def open_browser(address: str) -> bool:
    """Open the page in a browser if there is a screen; return whether it was opened."""
    has_screen = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    return has_screen and webbrowser.open(address)


def _texts() -> dict[str, bytes]:
    return {"": asset(LIVE_PAGE).encode(), **{name: asset(name).encode() for name in LIVE_FILES}}
