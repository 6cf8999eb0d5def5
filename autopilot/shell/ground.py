"""The sockets towards ground stations: on the wall clock, and in step with one that shares our clock."""

from __future__ import annotations

import errno
import socket
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress

from autopilot.onboard.onboard import GROUND_WINDOW_US, Onboard
from autopilot.onboard.tick_batch import TimesyncRequests
from autopilot.services.endpoint import MAX_GARBAGE_BYTES
from autopilot.services.records import Event, Link, TimesyncAnswered
from autopilot.shell.options import (
    Address,
    StopRequest,
    address_text,
    datagram_socket,
    os_error_text,
    receive,
    set_timeout,
)
from autopilot.shell.storage_worker import StorageWorker
from autopilot.shell.tcp_server import TcpServer
from autopilot.wire.codec import FieldReader, decode
from autopilot.wire.dialect import plumbline as mavlink

_MIN_RESEND_S = 0.05
_MAX_RESEND_S = 0.5
_TS1 = FieldReader(mavlink.MAVLink_timesync_message, "ts1")
_MAX_SILENCE_US = 1_000_000  # longest silence that a ground station which shares our clock can promise
_MAX_DATAGRAM_BYTES = (
    32_768  # bytes in a datagram to a ground station that shares our clock, which is on this machine
)
_MAX_PACKED_BYTES = 1400  # bytes of several messages in one datagram to any other ground station
_MAX_WINDOWS = 4  # windows that are sent together to a ground station that sends nothing meanwhile
_MAX_RECEIVED_BYTES = 2048  # bytes of a datagram from the ground; the rest is dropped
_MAX_PIECE_BYTES = 280  # bytes of a datagram that are handed over together: the largest frame
_RECEIVE_BUDGET_S = (
    0.5e-3  # for all messages from the ground between two ticks; a flood must not stop the clock
)
_SEND_BUDGET_S = 1e-3  # for all that is sent between two ticks, if much has waited for the disk
_MAX_WAITING = 16_384  # datagrams
_LOST_S = 30.0  # silence after which a ground station in lockstep is assumed to be gone
_LINK: Link = "ground"


class AutopilotError(Exception):
    """An error that ends the program with one line of text."""


def open_socket(address: Address, role: str) -> socket.socket:
    """A socket for one address; AutopilotError, which names the address as `role`, if it cannot be opened."""
    try:
        sock = datagram_socket(address)
        # no traffic except to the given address and answers from there
        sock.bind(("127.0.0.1" if _is_loopback(address[0]) else "", 0))
    except OSError as error:
        raise AutopilotError(f"{role} {address_text(address)}: {os_error_text(error)}") from None
    return sock


def listen(address: Address) -> TcpServer:
    """Listen for ground stations that connect by TCP; AutopilotError if the port cannot be used."""
    try:
        return TcpServer(address)
    except OSError as error:
        busy = "is another autopilot running? " if error.errno == errno.EADDRINUSE else ""
        raise AutopilotError(
            f"cannot listen on TCP {address_text(address)}: {os_error_text(error)}; "
            f"{busy}choose another with --tcp"
        ) from None


def _is_loopback(host: str) -> bool:
    return host == "localhost" or host.startswith("127.")


def _split_datagram(datagram: bytes, link: Link) -> list[tuple[bytes, Link]]:
    """A datagram of many messages in pieces: a hundred together take longer than the time between ticks."""
    if len(datagram) <= _MAX_PIECE_BYTES:
        return [(datagram, link)]
    frames = [received.frame for received in decode(datagram, MAX_GARBAGE_BYTES)[0]] or [b""]
    return [(frame, link) for frame in frames]


def _packed(datagrams: Iterable[tuple[Link, bytes]]) -> list[tuple[Link, bytes]]:
    """The messages of each link in as few datagrams as a network does not divide: a receiver whose machine is
    busy has room for a number of datagrams rather than of bytes."""
    packed: list[tuple[Link, bytes]] = []
    for link, datagram in datagrams:
        if packed and packed[-1][0] == link and len(packed[-1][1]) + len(datagram) <= _MAX_PACKED_BYTES:
            packed[-1] = (link, packed[-1][1] + datagram)
        else:
            packed.append((link, datagram))
    return packed


class GroundStations:
    """Sockets towards ground stations and programs, one for each configured address.

    Any other sender to such a socket is a separate link and is answered at its own address.
    """

    def __init__(
        self,
        stations: tuple[Address, ...],
        programs: tuple[Address, ...],
        tcp: TcpServer | None,
        storage_worker: StorageWorker,
    ) -> None:
        """Datagrams wait until `storage_worker` has stored what was to be stored before them."""
        self._tcp = tcp
        self._storage_worker = storage_worker
        # number of jobs to be stored before, link, datagram; if there are too many, the oldest are lost
        self._waiting: deque[tuple[int, Link, bytes]] = deque(maxlen=_MAX_WAITING)
        addresses = (*stations, *programs)
        self._sockets = [open_socket(address, "ground station") for address in addresses]
        self._is_program = [i >= len(stations) for i in range(len(addresses))]
        self._links: list[Link] = [(i, address) for i, address in enumerate(addresses)]
        # messages that arrived at each of the sockets, and by TCP, and are not handed over yet
        self._received: list[deque[tuple[bytes, Link]]] = [deque() for _ in range(len(addresses) + 1)]

    def join(self, onboard: Onboard) -> None:
        """Serve the configured links from now on."""
        for link, is_program in zip(self._links, self._is_program, strict=True):
            onboard.add_link(link, is_program)
        if self._tcp is not None:
            self._tcp.join(onboard)

    def exchange(self, onboard: Onboard, handle: Callable[[list[Event]], None], stop: StopRequest) -> None:
        """Hand over the messages that arrived, as far as time allows, and send what is due."""
        until = time.perf_counter() + _RECEIVE_BUDGET_S
        for i in range(len(self._received)):
            program = i < len(self._is_program) and self._is_program[i]
            while (received := self._next_message(i, onboard)) is not None:
                handle(onboard.receive_ground(*received, program))
                if time.perf_counter() > until:  # the next sockets get one message each, and the rest waits
                    break
        self.send(onboard)

    def _next_message(self, i: int, onboard: Onboard) -> tuple[bytes, Link] | None:
        """The next message that arrived at socket `i`, or by TCP if `i` is beyond the last socket."""
        waiting = self._received[i]
        if not waiting:
            arrived = self._receive(i, onboard)
            if arrived is not None:
                waiting.extend(_split_datagram(*arrived))
        return waiting.popleft() if waiting else None

    def _receive(self, i: int, onboard: Onboard) -> tuple[bytes, Link] | None:
        if i < len(self._sockets):
            arrived = receive(self._sockets[i], socket.MSG_DONTWAIT, _MAX_RECEIVED_BYTES)
            return None if arrived is None else (arrived[0], (i, arrived[1]))
        return None if self._tcp is None else self._tcp.receive(onboard)

    def send(self, onboard: Onboard) -> None:
        """Send what is due."""
        self._send(onboard.ground_datagrams(), onboard)

    def send_heartbeats(self, onboard: Onboard) -> None:
        """A heartbeat while the clock stands and nothing is due."""
        links = (*self._links, *(self._tcp.links() if self._tcp else ()))
        self._send([(link, onboard.paused_heartbeat(link)) for link in links], onboard)

    def _send(self, datagrams: list[tuple[Link, bytes]], onboard: Onboard) -> None:
        waiting, requested = self._waiting, self._storage_worker.requested
        waiting.extend((requested, link, datagram) for link, datagram in _packed(datagrams))
        until = time.perf_counter() + _SEND_BUDGET_S
        while waiting and waiting[0][0] <= self._storage_worker.finished and time.perf_counter() < until:
            _, link, datagram = waiting.popleft()
            i, address = link  # type: ignore[misc]
            if self._tcp is not None and i == "tcp":  # type: ignore[has-type]
                self._tcp.send(link, datagram, onboard)
                continue
            with suppress(OSError):  # nobody listens there yet, or the network is full: lost
                self._sockets[i].sendto(datagram, address)  # type: ignore[has-type]

    def close(self) -> None:
        for sock in self._sockets:
            sock.close()
        if self._tcp is not None:
            self._tcp.close()


def _answers_earlier(datagram: bytes, stamp: int) -> bool:
    """Whether this is only the answer to a request before that of `stamp`, which was not waited for."""
    received, _ = decode(datagram)
    timesync = mavlink.MAVLINK_MSG_ID_TIMESYNC
    return len(received) == 1 and received[0].id == timesync and _TS1.read(received[0].frame) < stamp


class LockstepGroundStation:
    """One ground station that shares our clock: every 20 ms we wait until it has caught up.

    It processes messages only on request, so the messages of a window are sent with a timesync request. If it
    has promised to send nothing for a while, we send the request and continue without waiting. Several
    windows are then sent together, because waking the ground station takes as long as everything else that is
    done for it.
    """

    def __init__(self, address: Address) -> None:
        self._socket = open_socket(address, "ground station")
        self._address = address
        self._silent_until_us = 0  # it sends nothing before
        self._timeout_s = 0.0  # timeout of a receive
        self._open_window: list[bytes] = []  # messages of this window
        self._size = 0
        self._windows: list[bytes] = []  # datagrams to be sent

    def join(self, onboard: Onboard) -> None:
        """Serve the link from now on."""
        onboard.add_link(_LINK)
        self._silent_until_us = 0
        self._set_timeout(_MIN_RESEND_S)

    def exchange(self, onboard: Onboard, handle: Callable[[list[Event]], None], stop: StopRequest) -> None:
        """Send what is due; at the end of a window wait for the ground station's answer."""
        for _, datagram in onboard.ground_datagrams():
            self._add_message(datagram)
        request = onboard.timesync_request(_LINK)
        if request is None:
            return
        self._add_message(request)
        self._close_window()
        self._send_windows(onboard.now_us)
        if self._silent_until_us > onboard.now_us:
            return
        stamp = onboard.now_us * 1000
        request_s = time.monotonic()
        silence_s = _MIN_RESEND_S
        while True:
            stop.check()
            self._set_timeout(silence_s)
            arrived = receive(self._socket)
            if arrived is None:
                if time.monotonic() - request_s > _LOST_S:
                    raise AutopilotError(f"the ground station was silent for {_LOST_S:g} s; stopping")
                self._send(request)
                silence_s = min(2.0 * silence_s, _MAX_RESEND_S)
                continue
            if arrived[1] != self._address or _answers_earlier(arrived[0], stamp):
                continue
            events = onboard.receive_ground(arrived[0], _LINK)
            handle(events)
            for event in events:
                if isinstance(event, TimesyncAnswered) and event.ts1 == stamp:
                    promised_us = (event.tc1 - stamp) // 1000
                    if promised_us <= _MAX_SILENCE_US:  # else the ground station uses another clock
                        self._silent_until_us = onboard.now_us + promised_us
                    return

    @property
    def socket_and_address(self) -> tuple[socket.socket, Address]:
        """The socket and the address with which machine code sends."""
        return self._socket, self._address

    @property
    def timesync_requests(self) -> TimesyncRequests:
        """The requests that may be sent without `exchange`, since their answers are not waited for."""
        unsent = (*self._windows, b"".join(self._open_window))
        return TimesyncRequests(self._silent_until_us, self._send_singly_us, _MAX_WINDOWS, unsent)

    def set_unsent(self, unsent: list[bytes]) -> None:
        """Take back what is not sent of `timesync_requests.unsent` and of the messages written without
        `exchange`."""
        *self._windows, last = unsent
        self._open_window, self._size = [last], len(last)

    @property
    def _send_singly_us(self) -> int:
        """Time from which windows are sent one by one, since the ground station will soon be waited for."""
        return self._silent_until_us - _MAX_WINDOWS * GROUND_WINDOW_US

    def _set_timeout(self, seconds: float) -> None:
        """Set how long a receive waits."""
        if seconds != self._timeout_s:
            self._timeout_s = seconds
            set_timeout(self._socket, seconds)

    def _add_message(self, datagram: bytes) -> None:
        if self._size + len(datagram) > _MAX_DATAGRAM_BYTES:
            self._close_window()
        self._open_window.append(datagram)
        self._size += len(datagram)

    def _close_window(self) -> None:
        self._windows.append(b"".join(self._open_window))
        self._open_window.clear()
        self._size = 0

    def _send_windows(self, now_us: int) -> None:
        """Send the closed windows if there are enough of them or the ground will soon be waited for."""
        if len(self._windows) >= _MAX_WINDOWS or now_us >= self._send_singly_us:
            for datagram in self._windows:
                self._send(datagram)
            self._windows.clear()

    def _send(self, datagram: bytes) -> None:
        with suppress(OSError):
            self._socket.sendto(datagram, self._address)

    def close(self) -> None:
        self._socket.close()
