"""The sockets towards ground stations: on the wall clock, and in step with one that shares our clock."""

from __future__ import annotations

import errno
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from autopilot.onboard.onboard import GROUND_WINDOW_US, Onboard
from autopilot.onboard.running import Questions
from autopilot.services.endpoint import PATIENCE
from autopilot.services.records import Event, Link, TimesyncAnswered
from autopilot.shell.options import Address, StopRequest, datagram_socket, reason, receive, set_timeout, shown
from autopilot.shell.storing import Storing
from autopilot.shell.tcp_server import TcpServer
from autopilot.wire.codec import Field, decode
from autopilot.wire.dialect import plumbline as mavlink

_RESEND_FIRST_S = 0.05
_RESEND_LAST_S = 0.5
_TS1 = Field(mavlink.MAVLink_timesync_message, "ts1")
_LONGEST_SILENCE_US = 1_000_000  # longest silence that a ground station which shares our clock can promise
_MOST_SAID = 32_768  # bytes in a datagram to a ground station that shares our clock, which is on this machine
_TOGETHER = 4  # windows that are sent together to a ground station that sends nothing meanwhile
_LARGEST_HEARD = 2048  # bytes of a datagram from the ground; the rest is dropped
_LARGEST_AT_ONCE = 280  # bytes of a datagram that are handed over together: the largest frame
_BUDGET_S = 0.5e-3  # for all messages from the ground between two ticks; a flood must not stop the clock
_SENDING_S = 1e-3  # for all that is sent between two ticks, if much has waited for the disk
_MOST_WAITING = 16_384  # datagrams
_GONE_S = 30.0  # silence after which a ground station in lockstep is assumed to be gone
_LINK: Link = "ground"


class AutopilotError(Exception):
    """An error that ends the program with one line of text."""


def open_socket(address: Address, what: str) -> socket.socket:
    """A socket for one address; AutopilotError, which names the address as `what`, if it cannot be opened."""
    try:
        sock = datagram_socket(address)
        # no traffic except to the given address and answers from there
        sock.bind(("127.0.0.1" if _is_loopback(address[0]) else "", 0))
    except OSError as error:
        raise AutopilotError(f"{what} {shown(address)}: {reason(error)}") from None
    return sock


def listen(address: Address) -> TcpServer:
    """Listen for ground stations that connect by TCP; AutopilotError if the port cannot be used."""
    try:
        return TcpServer(address)
    except OSError as error:
        busy = "is another autopilot running? " if error.errno == errno.EADDRINUSE else ""
        raise AutopilotError(
            f"cannot listen on TCP {shown(address)}: {reason(error)}; {busy}choose another with --tcp"
        ) from None


def _is_loopback(host: str) -> bool:
    return host == "localhost" or host.startswith("127.")


def _pieces(datagram: bytes, link: Link) -> list[tuple[bytes, Link]]:
    """A datagram of many messages in pieces: a hundred together take longer than the time between ticks."""
    if len(datagram) <= _LARGEST_AT_ONCE:
        return [(datagram, link)]
    frames = [received.frame for received in decode(datagram, PATIENCE)[0]] or [b""]
    return [(frame, link) for frame in frames]


class GroundStations:
    """Sockets towards ground stations and programs, one for each configured address.

    Any other sender to such a socket is a separate link and is answered at its own address.
    """

    def __init__(
        self,
        stations: tuple[Address, ...],
        programs: tuple[Address, ...],
        tcp: TcpServer | None,
        storing: Storing,
    ) -> None:
        """Datagrams wait until `storing` has stored what was to be stored before them."""
        self._tcp = tcp
        self._storing = storing
        # number of jobs to be stored before, link, datagram; if there are too many, the oldest are lost
        self._waiting: deque[tuple[int, Link, bytes]] = deque(maxlen=_MOST_WAITING)
        addresses = (*stations, *programs)
        self._sockets = [open_socket(address, "ground station") for address in addresses]
        self._is_program = [i >= len(stations) for i in range(len(addresses))]
        self._links: list[Link] = [(i, address) for i, address in enumerate(addresses)]
        # messages that arrived at each of the sockets, and by TCP, and are not handed over yet
        self._heard: list[deque[tuple[bytes, Link]]] = [deque() for _ in range(len(addresses) + 1)]

    def join(self, onboard: Onboard) -> None:
        """Serve the configured links from now on."""
        for link, is_program in zip(self._links, self._is_program, strict=True):
            onboard.add_link(link, is_program)
        if self._tcp is not None:
            self._tcp.join(onboard)

    def exchange(self, onboard: Onboard, handle: Callable[[list[Event]], None], stop: StopRequest) -> None:
        """Hand over the messages that arrived, as far as time allows, and send what is due."""
        until = time.perf_counter() + _BUDGET_S
        for i in range(len(self._heard)):
            program = i < len(self._is_program) and self._is_program[i]
            while (heard := self._next(i, onboard)) is not None:
                handle(onboard.receive_ground(*heard, program))
                if time.perf_counter() > until:  # the next sockets get one message each, and the rest waits
                    break
        self.send(onboard)

    def _next(self, i: int, onboard: Onboard) -> tuple[bytes, Link] | None:
        """The next message that arrived at socket `i`, or by TCP if `i` is beyond the last socket."""
        waiting = self._heard[i]
        if not waiting:
            arrived = self._arrived(i, onboard)
            if arrived is not None:
                waiting.extend(_pieces(*arrived))
        return waiting.popleft() if waiting else None

    def _arrived(self, i: int, onboard: Onboard) -> tuple[bytes, Link] | None:
        if i < len(self._sockets):
            arrived = receive(self._sockets[i], socket.MSG_DONTWAIT, _LARGEST_HEARD)
            return None if arrived is None else (arrived[0], (i, arrived[1]))
        return None if self._tcp is None else self._tcp.take(onboard)

    def send(self, onboard: Onboard) -> None:
        """Send what is due."""
        self._send(onboard.ground_datagrams(), onboard)

    def beat(self, onboard: Onboard) -> None:
        """A heartbeat while the clock stands and nothing is due."""
        links = (*self._links, *(self._tcp.links() if self._tcp else ()))
        self._send([(link, onboard.stranded_heartbeat(link)) for link in links], onboard)

    def _send(self, datagrams: list[tuple[Link, bytes]], onboard: Onboard) -> None:
        waiting, asked = self._waiting, self._storing.asked
        waiting.extend((asked, link, datagram) for link, datagram in datagrams)
        until = time.perf_counter() + _SENDING_S
        while waiting and waiting[0][0] <= self._storing.done and time.perf_counter() < until:
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


def _answers_before(datagram: bytes, stamp: int) -> bool:
    """Whether this is only the answer to a question before that of `stamp`, which was not waited for."""
    received, _ = decode(datagram)
    timesync = mavlink.MAVLINK_MSG_ID_TIMESYNC
    return len(received) == 1 and received[0].id == timesync and _TS1.of(received[0].frame) < stamp


class GroundInStep:
    """One ground station that shares our clock: every 20 ms we wait until it has caught up.

    It processes messages only when asked, so the messages of a window are sent with the question. If it has
    promised to send nothing for a while, we ask and continue without waiting. Several windows are then sent
    together, because waking the ground station takes as long as everything else that is done for it.
    """

    def __init__(self, address: Address) -> None:
        self._socket = open_socket(address, "ground station")
        self._address = address
        self._silent_until_us = 0  # it sends nothing before
        self._waits_s = 0.0  # timeout of a receive
        self._said: list[bytes] = []  # messages of this window
        self._size = 0
        self._windows: list[bytes] = []  # datagrams to be sent

    def join(self, onboard: Onboard) -> None:
        """Serve the link from now on."""
        onboard.add_link(_LINK)
        self._silent_until_us = 0
        self._wait(_RESEND_FIRST_S)

    def exchange(self, onboard: Onboard, handle: Callable[[list[Event]], None], stop: StopRequest) -> None:
        """Send what is due; at the end of a window wait for the ground station's answer."""
        for _, datagram in onboard.ground_datagrams():
            self._say(datagram)
        ask = onboard.question(_LINK)
        if ask is None:
            return
        self._say(ask)
        self._close_window()
        self._send_together(onboard.now_us)
        if self._silent_until_us > onboard.now_us:
            return
        stamp = onboard.now_us * 1000
        asked = time.monotonic()
        silence_s = _RESEND_FIRST_S
        while True:
            stop.check()
            self._wait(silence_s)
            arrived = receive(self._socket)
            if arrived is None:
                if time.monotonic() - asked > _GONE_S:
                    raise AutopilotError(f"the ground station was silent for {_GONE_S:g} s; stopping")
                self._send(ask)
                silence_s = min(2.0 * silence_s, _RESEND_LAST_S)
                continue
            if arrived[1] != self._address or _answers_before(arrived[0], stamp):
                continue
            events = onboard.receive_ground(arrived[0], _LINK)
            handle(events)
            for event in events:
                if isinstance(event, TimesyncAnswered) and event.ts1 == stamp:
                    promised_us = (event.tc1 - stamp) // 1000
                    if promised_us <= _LONGEST_SILENCE_US:  # else the ground station uses another clock
                        self._silent_until_us = onboard.now_us + promised_us
                    return

    @property
    def way(self) -> tuple[socket.socket, Address]:
        """The socket and the address with which machine code sends."""
        return self._socket, self._address

    @property
    def questions(self) -> Questions:
        """The questions that may be asked without `exchange`, since their answers are not waited for."""
        unsent = (*self._windows, b"".join(self._said))
        return Questions(self._silent_until_us, self._alone_us, _TOGETHER, unsent)

    def take_back(self, unsent: list[bytes]) -> None:
        """Take back what is not sent of `questions.unsent` and of the messages written without `exchange`."""
        *self._windows, last = unsent
        self._said, self._size = [last], len(last)

    @property
    def _alone_us(self) -> int:
        """Time from which windows are sent one by one, since the ground station will soon be waited for."""
        return self._silent_until_us - _TOGETHER * GROUND_WINDOW_US

    def _wait(self, seconds: float) -> None:
        """Set how long a receive waits."""
        if seconds != self._waits_s:
            self._waits_s = seconds
            set_timeout(self._socket, seconds)

    def _say(self, datagram: bytes) -> None:
        if self._size + len(datagram) > _MOST_SAID:
            self._close_window()
        self._said.append(datagram)
        self._size += len(datagram)

    def _close_window(self) -> None:
        self._windows.append(b"".join(self._said))
        self._said.clear()
        self._size = 0

    def _send_together(self, now_us: int) -> None:
        """Send the closed windows if there are enough of them or the ground will soon be waited for."""
        if len(self._windows) >= _TOGETHER or now_us >= self._alone_us:
            for datagram in self._windows:
                self._send(datagram)
            self._windows.clear()

    def _send(self, datagram: bytes) -> None:
        with suppress(OSError):
            self._socket.sendto(datagram, self._address)

    def close(self) -> None:
        self._socket.close()
