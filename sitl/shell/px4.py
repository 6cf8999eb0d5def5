"""The loop of the simulator around PX4: a TCP server for one firmware after another."""

from __future__ import annotations

import errno
import select
import socket
import time
from collections.abc import Callable

from autopilot.shell.options import Address, StopRequest, address_text, os_error_text
from sitl.hil import HilSimulator
from sitl.interfaces.px4 import Exchange
from sitl.pacing import Pacing
from sitl.shell.link import Link
from sitl.shell.loops import LONG_WAIT_S, LOST_S, POLL_S, Clock

# between ticks before the first answer: about real time, as the firmware starts by its clock
_FREE_RUN_TICK_S = 0.004
_CHUNK_BYTES = 65_536
_SEND_BUFFER_BYTES = 65_536  # bytes that may wait for a firmware that does not read: hundreds of ticks


def run_px4(
    link: Link,
    simulator: HilSimulator,
    stop: StopRequest,
    notify: Callable[[str], None],
    pacing: Pacing | None = None,
) -> None:
    """Serve firmwares for ever; the world restarts with each."""
    exchange = Exchange(simulator)
    with _server(link.address) as server:
        gate, served = FirmwareGate(server, notify), False
        while True:
            stop.check()
            connection = gate.accept_next()
            if connection is None:
                continue
            firmware, peer = connection
            notify(f"serving PX4 at {address_text(peer)}{', and the world restarts' if served else ''}")
            link.note_connection()
            if served:
                simulator.restart()
                exchange = Exchange(simulator)
            served = True
            with firmware:
                firmware.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                firmware.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
                clock = None if pacing is None else Clock(pacing, simulator, notify)
                reason_gone = _serve(firmware, exchange, gate, link, simulator, stop, notify, clock)
            notify(f"PX4 is gone at t = {simulator.now_us / 1e6:.3f} s: {reason_gone}; waiting for another")


class FirmwareGate:
    """Lets one firmware in at a time."""

    def __init__(self, server: socket.socket, notify: Callable[[str], None]) -> None:
        self._server, self._notify = server, notify
        self._served: Address | None = None
        self._next: tuple[socket.socket, Address] | None = None
        self._last_poll_s = 0.0

    def accept_next(self) -> tuple[socket.socket, Address] | None:
        """The firmware that is served from now on; None if none has connected for POLL_S."""
        connection, self._next = self._next or self._accept_within(POLL_S), None
        self._served = None if connection is None else connection[1]
        return connection

    def refuse_others(self) -> None:
        """Refuse a firmware that connects while another answers; checks at most once in POLL_S."""
        connection = self._poll_for_next()
        if connection is not None:
            connection[0].close()
            self._notify(
                f"PX4 at {address_text(connection[1])} is not served: "
                f"that at {address_text(self._served)} answers"
            )

    def yield_to_next(self) -> None:
        """If another firmware connects while the present one is silent, raise ConnectionError to serve it."""
        self._next = self._poll_for_next()
        if self._next is not None:
            raise ConnectionError("it is silent, and another asks")

    def _poll_for_next(self) -> tuple[socket.socket, Address] | None:
        now_s = time.monotonic()
        if now_s - self._last_poll_s < POLL_S:
            return None
        self._last_poll_s = now_s
        return self._accept_within(0.0)

    def _accept_within(self, seconds: float) -> tuple[socket.socket, Address] | None:
        if not select.select([self._server], [], [], seconds)[0]:
            return None
        try:
            connection, peer = self._server.accept()
        except ConnectionError:  # it has disconnected already
            return None
        return connection, peer[:2]


def _server(address: Address) -> socket.socket:
    server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        server.bind(address)
    except OSError as error:
        server.close()
        busy = "is another sitl running? " if error.errno == errno.EADDRINUSE else ""
        raise ValueError(
            f"cannot listen on TCP {address_text(address)}: {os_error_text(error)}; "
            f"{busy}choose another with --listen"
        ) from None
    server.listen(1)
    return server


def _serve(
    firmware: socket.socket,
    exchange: Exchange,
    gate: FirmwareGate,
    link: Link,
    simulator: HilSimulator,
    stop: StopRequest,
    notify: Callable[[str], None],
    clock: Clock | None,
) -> str:
    """Tick while the firmware is connected; returns why it no longer is."""
    began_s = time.monotonic()
    try:
        while True:
            stop.check()
            if clock is not None:
                clock.wait()
            if exchange.in_lockstep:
                gate.refuse_others()
            elif time.monotonic() - began_s > LOST_S:
                gate.yield_to_next()
            firmware.sendall(exchange.sensors())
            link.gather_truth(simulator)
            waited_s = _await(firmware, exchange, gate, simulator, stop, notify)
            if clock is not None and waited_s >= LONG_WAIT_S:
                clock.skip(waited_s)
            simulator.advance()
    except TimeoutError:
        return "it does not read what is sent to it"
    except EOFError:
        return "the connection was closed"
    except ConnectionError as error:
        return os_error_text(error)


def _await(
    firmware: socket.socket,
    exchange: Exchange,
    gate: FirmwareGate,
    simulator: HilSimulator,
    stop: StopRequest,
    notify: Callable[[str], None],
) -> float:
    """Wait until the tick is answered or, before the first answer, for _FREE_S; returns the time in s."""
    began_s = time.monotonic()
    silence_reported = False
    while True:
        firmware.settimeout(POLL_S if exchange.in_lockstep else _FREE_RUN_TICK_S)
        try:
            chunk = firmware.recv(_CHUNK_BYTES)
        except TimeoutError:
            chunk = None
        if chunk == b"":
            raise EOFError
        if chunk is not None and exchange.receive(chunk):
            if silence_reported:
                notify("PX4 answers again")
            break
        if not exchange.in_lockstep and time.monotonic() - began_s >= _FREE_RUN_TICK_S:
            break
        stop.check()
        if silence_reported:
            gate.yield_to_next()
        elif time.monotonic() - began_s > LOST_S:
            silence_reported = True
            notify(
                f"no answer from PX4 for {LOST_S:g} s (t = {simulator.now_us / 1e6:.3f} s); waiting for it"
            )
    return time.monotonic() - began_s
