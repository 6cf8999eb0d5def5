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
_LONGEST_SILENCE_US = 1_000_000  # that a ground station which shares our clock can promise
_MOST_SAID = 32_768  # bytes in a datagram to a ground station that shares our clock, which is on this machine
_TOGETHER = 4  # windows that are sent at once to a ground station that says nothing meanwhile
_LARGEST_HEARD = 2048  # bytes of a datagram from the ground; what is behind them is not heard
_LARGEST_AT_ONCE = 280  # bytes of one that are handed over together, as large as a frame may be
_BUDGET_S = 0.5e-3  # for all that the ground says between two ticks; a flood must not stop the clock
_SENDING_S = 1e-3  # for all that is sent between two ticks, where much has waited for the disk
_MOST_WAITING = 16_384  # datagrams
_GONE_S = 30.0  # a ground station in lockstep that is silent so long is gone
_LINK: Link = "ground"


class AutopilotError(Exception):
    """What ends the program with one line."""


def open_socket(address: Address, what: str) -> socket.socket:
    """A socket that speaks to one address; AutopilotError names `what` is there if it cannot be had."""
    try:
        sock = datagram_socket(address)
        # no traffic but to where we are pointed, and answers to it
        sock.bind(("127.0.0.1" if _is_loopback(address[0]) else "", 0))
    except OSError as error:
        raise AutopilotError(f"{what} {shown(address)}: {reason(error)}") from None
    return sock


def listen(address: Address) -> TcpServer:
    """Ground stations that connect by TCP; AutopilotError if the port cannot be had."""
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
    """A datagram of many messages in pieces: a hundred at once cost more time than there is between ticks."""
    if len(datagram) <= _LARGEST_AT_ONCE:
        return [(datagram, link)]
    frames = [received.frame for received in decode(datagram, PATIENCE)[0]] or [b""]
    return [(frame, link) for frame in frames]


class GroundStations:
    """Sockets towards ground stations and programs, one for each address that we were pointed at.

    Whoever else speaks to such a socket is a link of its own and is answered where it is.
    """

    def __init__(
        self,
        stations: tuple[Address, ...],
        programs: tuple[Address, ...],
        tcp: TcpServer | None,
        storing: Storing,
    ) -> None:
        """What is said waits for what is to be stored."""
        self._tcp = tcp
        self._storing = storing
        # until so much is stored; the oldest are lost where nobody could take as many
        self._waiting: deque[tuple[int, Link, bytes]] = deque(maxlen=_MOST_WAITING)
        addresses = (*stations, *programs)
        self._sockets = [open_socket(address, "ground station") for address in addresses]
        self._is_program = [i >= len(stations) for i in range(len(addresses))]
        self._links: list[Link] = [(i, address) for i, address in enumerate(addresses)]
        # what came by each of the sockets, and by TCP, and is not handed over yet
        self._heard: list[deque[tuple[bytes, Link]]] = [deque() for _ in range(len(addresses) + 1)]

    def join(self, onboard: Onboard) -> None:
        """Serve the configured links from now on."""
        for link, is_program in zip(self._links, self._is_program, strict=True):
            onboard.add_link(link, is_program)
        if self._tcp is not None:
            self._tcp.join(onboard)

    def exchange(self, onboard: Onboard, handle: Callable[[list[Event]], None], stop: StopRequest) -> None:
        """Hand over what came, as far as there is time for it, and send what is due."""
        until = time.perf_counter() + _BUDGET_S
        for i in range(len(self._heard)):
            program = i < len(self._is_program) and self._is_program[i]
            while (heard := self._next(i, onboard)) is not None:
                handle(onboard.receive_ground(*heard, program))
                if time.perf_counter() > until:  # the others have their turn, and the rest waits
                    break
        self.send(onboard)

    def _next(self, i: int, onboard: Onboard) -> tuple[bytes, Link] | None:
        """What is to be handed over next of what came by a socket, or behind the last of them by TCP."""
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
    """Whether this is but the answer to a question before that of `stamp`, for which nobody waited."""
    received, _ = decode(datagram)
    timesync = mavlink.MAVLINK_MSG_ID_TIMESYNC
    return len(received) == 1 and received[0].id == timesync and _TS1.of(received[0].frame) < stamp


class GroundInStep:
    """One ground station that shares our clock: every 20 ms we wait until it has caught up.

    It does nothing with what it hears until it is asked: what is said in a window goes with the question.
    Where it has promised to say nothing for a while, we ask and go on; and as to wake it takes as long as all
    else that is done for it, it then hears of several windows at once.
    """

    def __init__(self, address: Address) -> None:
        self._socket = open_socket(address, "ground station")
        self._address = address
        self._silent_until_us = 0  # it says nothing before
        self._waits_s = 0.0  # a receive that waits
        self._said: list[bytes] = []  # in this window
        self._size = 0
        self._windows: list[bytes] = []  # datagrams that are to be sent

    def join(self, onboard: Onboard) -> None:
        """Serve the link from now on."""
        onboard.add_link(_LINK)
        self._silent_until_us = 0
        self._wait(_RESEND_FIRST_S)

    def exchange(self, onboard: Onboard, handle: Callable[[list[Event]], None], stop: StopRequest) -> None:
        """Say what is due; at the end of a window wait for the ground station's word on it."""
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
                    if promised_us <= _LONGEST_SILENCE_US:  # else it is a clock of its own
                        self._silent_until_us = onboard.now_us + promised_us
                    return

    @property
    def way(self) -> tuple[socket.socket, Address]:
        """By which machine code sends."""
        return self._socket, self._address

    @property
    def questions(self) -> Questions:
        """What may be asked without `exchange`, as nobody waits for an answer."""
        unsent = (*self._windows, b"".join(self._said))
        return Questions(self._silent_until_us, self._alone_us, _TOGETHER, unsent)

    def take_back(self, unsent: list[bytes]) -> None:
        """What of `questions.unsent`, and of what was said without `exchange`, is not sent."""
        *self._windows, last = unsent
        self._said, self._size = [last], len(last)

    @property
    def _alone_us(self) -> int:
        """When windows are sent one by one, as the ground station will soon be waited for."""
        return self._silent_until_us - _TOGETHER * GROUND_WINDOW_US

    def _wait(self, seconds: float) -> None:
        """How long a receive waits."""
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
        """Send the windows that are over, once there are enough of them, or the ground will soon be waited
        for."""
        if len(self._windows) >= _TOGETHER or now_us >= self._alone_us:
            for datagram in self._windows:
                self._send(datagram)
            self._windows.clear()

    def _send(self, datagram: bytes) -> None:
        with suppress(OSError):
            self._socket.sendto(datagram, self._address)

    def close(self) -> None:
        self._socket.close()
