"""The loop of the simulator around PX4: a TCP server for one firmware after another."""

from __future__ import annotations

import errno
import select
import socket
import time
from collections.abc import Callable

from autopilot.shell.options import Address, StopRequest, reason, shown
from sitl.hil import HilSimulator
from sitl.interfaces.px4 import Exchange
from sitl.pacing import Pacing
from sitl.shell.link import Link
from sitl.shell.loops import LOOK_S, LOST_S, WAITED_S, Clock

_FREE_S = 0.004  # between ticks before the first answer: about real time, as the firmware starts by its clock
_PIECE = 65_536
_UNREAD = 65_536  # bytes that may wait for a firmware that does not read: hundreds of ticks


def run_px4(
    link: Link,
    simulator: HilSimulator,
    stop: StopRequest,
    say: Callable[[str], None],
    pacing: Pacing | None = None,
) -> None:
    """Serve firmwares for ever; the world restarts with each."""
    exchange = Exchange(simulator)
    with _server(link.address) as server:
        door, served = Door(server, say), False
        while True:
            stop.check()
            came = door.enter()
            if came is None:
                continue
            firmware, peer = came
            say(f"serving PX4 at {shown(peer)}{', and the world restarts' if served else ''}")
            link.met()
            if served:
                simulator.begin_anew()
                exchange = Exchange(simulator)
            served = True
            with firmware:
                firmware.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                firmware.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _UNREAD)
                clock = None if pacing is None else Clock(pacing, simulator, say)
                why = _serve(firmware, exchange, door, link, simulator, stop, say, clock)
            say(f"PX4 is gone at t = {simulator.now_us / 1e6:.3f} s: {why}; waiting for another")


class Door:
    """Lets one firmware in at a time."""

    def __init__(self, server: socket.socket, say: Callable[[str], None]) -> None:
        self._server, self._say = server, say
        self._inside: Address | None = None
        self._next: tuple[socket.socket, Address] | None = None
        self._looked_s = 0.0

    def enter(self) -> tuple[socket.socket, Address] | None:
        """The firmware that is served from now on; None if none has connected for LOOK_S."""
        came, self._next = self._next or self._asking(LOOK_S), None
        self._inside = None if came is None else came[1]
        return came

    def turn_away(self) -> None:
        """Refuse a firmware that connects while another answers; checks at most once in LOOK_S."""
        came = self._knocking()
        if came is not None:
            came[0].close()
            self._say(f"PX4 at {shown(came[1])} is not served: that at {shown(self._inside)} answers")

    def give_place(self) -> None:
        """If another firmware connects while the present one is silent, raise ConnectionError to serve it."""
        self._next = self._knocking()
        if self._next is not None:
            raise ConnectionError("it is silent, and another asks")

    def _knocking(self) -> tuple[socket.socket, Address] | None:
        now_s = time.monotonic()
        if now_s - self._looked_s < LOOK_S:
            return None
        self._looked_s = now_s
        return self._asking(0.0)

    def _asking(self, seconds: float) -> tuple[socket.socket, Address] | None:
        if not select.select([self._server], [], [], seconds)[0]:
            return None
        try:
            came, peer = self._server.accept()
        except ConnectionError:  # it has disconnected already
            return None
        return came, peer[:2]


def _server(address: Address) -> socket.socket:
    server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        server.bind(address)
    except OSError as error:
        server.close()
        busy = "is another sitl running? " if error.errno == errno.EADDRINUSE else ""
        raise ValueError(
            f"cannot listen on TCP {shown(address)}: {reason(error)}; {busy}choose another with --listen"
        ) from None
    server.listen(1)
    return server


def _serve(
    firmware: socket.socket,
    exchange: Exchange,
    door: Door,
    link: Link,
    simulator: HilSimulator,
    stop: StopRequest,
    say: Callable[[str], None],
    clock: Clock | None,
) -> str:
    """Tick while the firmware is connected; returns why it no longer is."""
    began = time.monotonic()
    try:
        while True:
            stop.check()
            if clock is not None:
                clock.wait()
            if exchange.in_step:
                door.turn_away()
            elif time.monotonic() - began > LOST_S:
                door.give_place()
            firmware.sendall(exchange.sensors())
            link.gather_truth(simulator)
            waited_s = _await(firmware, exchange, door, simulator, stop, say)
            if clock is not None and waited_s >= WAITED_S:
                clock.skip(waited_s)
            simulator.advance()
    except TimeoutError:
        return "it does not read what is sent to it"
    except EOFError:
        return "the connection was closed"
    except ConnectionError as error:
        return reason(error)


def _await(
    firmware: socket.socket,
    exchange: Exchange,
    door: Door,
    simulator: HilSimulator,
    stop: StopRequest,
    say: Callable[[str], None],
) -> float:
    """Wait until the tick is answered or, before the first answer, for _FREE_S; returns the time in s."""
    began = time.monotonic()
    told = False
    while True:
        firmware.settimeout(LOOK_S if exchange.in_step else _FREE_S)
        try:
            piece = firmware.recv(_PIECE)
        except TimeoutError:
            piece = None
        if piece == b"":
            raise EOFError
        if piece is not None and exchange.receive(piece):
            if told:
                say("PX4 answers again")
            break
        if not exchange.in_step and time.monotonic() - began >= _FREE_S:
            break
        stop.check()
        if told:
            door.give_place()
        elif time.monotonic() - began > LOST_S:
            told = True
            say(f"no answer from PX4 for {LOST_S:g} s (t = {simulator.now_us / 1e6:.3f} s); waiting for it")
    return time.monotonic() - began
