"""Lockstep in machine code: tick after tick without Python, as long as there are only answers and frames.

`exchange` begins after the sensors of a tick have been sent. It waits for the answer, moves the world on, and
sends the frames of the next tick, until something else must be done: a datagram comes that is not the plain
answer to this tick, none comes in time, or at a tick more must be sent than sensors and truth.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from autopilot.geometry.entry import entry_of
from autopilot.geometry.kernel import kernel, threaded
from autopilot.shell.machine_sockets import (
    SUPPORTED,
    SYSTEM_ADDRESS_BYTES,
    address_of_system,
    receive_from_at,
    send_to_at,
    system_address,
    usable,
)
from autopilot.shell.options import LARGEST_DATAGRAM, Address
from autopilot.wire.compiled import Bytes
from autopilot.wire.periods import next_multiple
from sitl.hil import HilSimulator
from sitl.running import NOW_US, RAN, Ints, Running
from sitl.shell.link import TRUTH_WINDOW_US, Link
from sitl.ticks import TRUTH_OF_A_TICK, goes_on, move_on, put_sensors_next, put_truth_due

# why `exchange` returns
SILENCE, HEARD, MOVED = 0, 1, 2
_TRUTH_ROOM = 65_507  # bytes of the longest datagram; a window has less
# entries of `Wire.sizes`
_ADDRESS, _HEARD, _GATHERED = range(3)


class Wire(NamedTuple):
    """The sockets, and the data that pass through them."""

    fd: int
    truth_fd: int
    peer: Bytes  # the addresses of the autopilot that is served, of the last sender, and for the truth
    sender: Bytes
    truth_to: Bytes
    heard: Bytes  # the last datagram
    gathered: Bytes  # truth of this window
    sizes: Ints  # bytes of the sender's address, of `heard`, of `gathered`
    window_ends_us: Ints  # (1,)


@kernel
def _tell(wire: Wire, run: Running) -> None:
    """Send the sensors of this tick; gather its truth, and send the truth at the end of a window."""
    now_us = run.numbers[NOW_US]
    wire.sizes[_GATHERED] += put_truth_due(run, wire.gathered[wire.sizes[_GATHERED] :])
    ends_us = wire.window_ends_us[0]
    if not ends_us - TRUTH_WINDOW_US < now_us < ends_us:
        wire.window_ends_us[0] = next_multiple(now_us, TRUTH_WINDOW_US)
        if wire.sizes[_GATHERED] > 0:
            send_to_at(
                wire.truth_fd,
                wire.gathered.ctypes.data,
                wire.sizes[_GATHERED],
                wire.truth_to.ctypes.data,
                SYSTEM_ADDRESS_BYTES,
            )
            wire.sizes[_GATHERED] = 0
    length = put_sensors_next(run)
    send_to_at(wire.fd, run.buffer.ctypes.data, length, wire.peer.ctypes.data, SYSTEM_ADDRESS_BYTES)


@threaded
def exchange(wire: Wire, run: Running) -> int:
    """Run ticks of the world, each as soon as the one before is answered. Returns SILENCE or HEARD if the
    present tick is not answered, MOVED if the world is at a tick of which no frames are written yet."""
    while True:
        wire.sizes[_ADDRESS] = SYSTEM_ADDRESS_BYTES
        size = receive_from_at(
            wire.fd, wire.heard.ctypes.data, len(wire.heard), wire.sender.ctypes.data, wire.sizes.ctypes.data
        )
        wire.sizes[_HEARD] = size
        if size < 0:
            return SILENCE
        for i in range(SYSTEM_ADDRESS_BYTES):
            if wire.sender[i] != wire.peer[i]:
                return HEARD
        if not move_on(run, wire.heard.ctypes.data, size):
            return HEARD
        if not goes_on(run) or wire.sizes[_GATHERED] > _TRUTH_ROOM - TRUTH_OF_A_TICK:
            return MOVED
        _tell(wire, run)


class TickLoop:
    """Runs `exchange` where that is possible."""

    def __init__(self, link: Link, simulator: HilSimulator) -> None:
        self._link, self._simulator = link, simulator
        self._truth_to = system_address(link.truth)
        self._usable = all(map(usable, link.sockets)) and self._truth_to is not None
        self._peer: Address | None = None
        self._wire: Wire | None = None
        self._exchange: Any = None  # machine code, after its first use

    def run(self) -> tuple[bool, tuple[bytes, Address] | None]:
        """Run after the sensors of a tick were sent. Returns whether the world has moved on to a tick that is
        still to be sent, and otherwise the datagram that came, if any, as `Link.receive` returns it."""
        link, simulator = self._link, self._simulator
        run = simulator.running() if self._usable else None
        wire = None if run is None else self._ready()
        if run is None or wire is None:
            return False, link.receive()
        gathered = link.take_gathered()
        if len(gathered) > _TRUTH_ROOM - TRUTH_OF_A_TICK:
            link.gather(gathered, link.window_ends_us)
            return False, link.receive()
        wire.gathered[: len(gathered)] = np.frombuffer(gathered, np.uint8)
        wire.sizes[_GATHERED], wire.window_ends_us[0] = len(gathered), link.window_ends_us
        if self._exchange is None:
            self._exchange = entry_of(exchange, wire, run)
        why = self._exchange(wire, run)
        link.gather(wire.gathered[: wire.sizes[_GATHERED]].tobytes(), int(wire.window_ends_us[0]))
        if run.numbers[RAN]:
            link.heard()
        simulator.ran(framed=why != MOVED)
        if why != HEARD:
            return why == MOVED, None
        sender = wire.sender.tobytes()
        return False, (wire.heard[: wire.sizes[_HEARD]].tobytes(), address_of_system(sender))

    def _ready(self) -> Wire | None:
        """The wire to the autopilot that is served now; None: machine code cannot send to its address."""
        peer = self._link.peer
        if peer != self._peer:
            self._peer = peer
            address = None if peer is None else system_address(peer)
            self._wire = None if address is None else self._wire_to(address)
        return self._wire

    def _wire_to(self, peer: bytes) -> Wire:
        assert self._truth_to is not None
        sock, truth_sock = self._link.sockets
        return _new_wire(sock.fileno(), truth_sock.fileno(), peer, self._truth_to)


def _new_wire(fd: int, truth_fd: int, peer: bytes, truth_to: bytes) -> Wire:
    return Wire(
        fd,
        truth_fd,
        np.frombuffer(peer, np.uint8).copy(),
        np.zeros(SYSTEM_ADDRESS_BYTES, np.uint8),
        np.frombuffer(truth_to, np.uint8).copy(),
        np.zeros(LARGEST_DATAGRAM, np.uint8),
        np.zeros(_TRUTH_ROOM, np.uint8),
        np.zeros(3, np.int64),
        np.zeros(1, np.int64),
    )


def rehearse(simulator: HilSimulator) -> None:
    """Prepare the machine code of `exchange`, if this simulator can use it."""
    run = simulator.running()
    if SUPPORTED and run is not None:
        entry_of(exchange, _new_wire(-1, -1, b"", b""), run)
