"""Lockstep in machine code: tick after tick without Python, as long as there are only answers and frames.

`exchange` begins after the sensors of a tick have been sent. It waits for the answer, moves the world on, and
sends the frames of the next tick, until something else must be done: a datagram comes that is not the plain
answer to this tick, none comes in time, or at a tick more must be sent than sensors and truth.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.kernel import kernel, nogil_kernel
from autopilot.shell.machine_sockets import (
    SUPPORTED,
    SYSTEM_ADDRESS_BYTES,
    address_of_system,
    receive_from_at,
    send_to_at,
    system_address,
    usable,
)
from autopilot.shell.options import MAX_DATAGRAM_BYTES, Address
from autopilot.wire.compiled import Bytes
from autopilot.wire.periods import next_multiple
from sitl.hil import HilSimulator
from sitl.shell.link import TRUTH_WINDOW_US, Link
from sitl.tick_batch import NOW_US, TICKS_RUN, Ints, TickBatch
from sitl.ticks import MAX_TRUTH_BYTES, advance_with_answer, can_continue, put_next_sensors, put_truth_if_due

# why `exchange` returns
TIMED_OUT, RECEIVED, ADVANCED = 0, 1, 2
_TRUTH_CAPACITY = 65_507  # bytes of the longest datagram; a window has less
# entries of `SocketBuffers.sizes`
_ADDRESS, _RECEIVED, _GATHERED = range(3)


class SocketBuffers(NamedTuple):
    """The sockets, and the data that pass through them."""

    fd: int
    truth_fd: int
    peer: Bytes  # the addresses of the autopilot that is served, of the last sender, and for the truth
    sender: Bytes
    truth_address: Bytes
    received: Bytes  # the last datagram
    gathered: Bytes  # truth of this window
    sizes: Ints  # bytes of the sender's address, of `received`, of `gathered`
    window_ends_us: Ints  # (1,)


@kernel
def _send_tick(buffers: SocketBuffers, batch: TickBatch) -> None:
    """Send the sensors of this tick; gather its truth, and send the truth at the end of a window."""
    now_us = batch.numbers[NOW_US]
    buffers.sizes[_GATHERED] += put_truth_if_due(batch, buffers.gathered[buffers.sizes[_GATHERED] :])
    ends_us = buffers.window_ends_us[0]
    if not ends_us - TRUTH_WINDOW_US < now_us < ends_us:
        buffers.window_ends_us[0] = next_multiple(now_us, TRUTH_WINDOW_US)
        if buffers.sizes[_GATHERED] > 0:
            send_to_at(
                buffers.truth_fd,
                buffers.gathered.ctypes.data,
                buffers.sizes[_GATHERED],
                buffers.truth_address.ctypes.data,
                SYSTEM_ADDRESS_BYTES,
            )
            buffers.sizes[_GATHERED] = 0
    length = put_next_sensors(batch)
    send_to_at(buffers.fd, batch.buffer.ctypes.data, length, buffers.peer.ctypes.data, SYSTEM_ADDRESS_BYTES)


@nogil_kernel
def exchange(buffers: SocketBuffers, batch: TickBatch) -> int:
    """Run ticks of the world, each as soon as the one before is answered. Returns TIMED_OUT or RECEIVED if
    the present tick is not answered, ADVANCED if the world is at a tick whose frames are not written yet."""
    while True:
        buffers.sizes[_ADDRESS] = SYSTEM_ADDRESS_BYTES
        size = receive_from_at(
            buffers.fd,
            buffers.received.ctypes.data,
            len(buffers.received),
            buffers.sender.ctypes.data,
            buffers.sizes.ctypes.data,
        )
        buffers.sizes[_RECEIVED] = size
        if size < 0:
            return TIMED_OUT
        for i in range(SYSTEM_ADDRESS_BYTES):
            if buffers.sender[i] != buffers.peer[i]:
                return RECEIVED
        if not advance_with_answer(batch, buffers.received.ctypes.data, size):
            return RECEIVED
        if not can_continue(batch) or buffers.sizes[_GATHERED] > _TRUTH_CAPACITY - MAX_TRUTH_BYTES:
            return ADVANCED
        _send_tick(buffers, batch)


class TickLoop:
    """Runs `exchange` where that is possible."""

    def __init__(self, link: Link, simulator: HilSimulator) -> None:
        self._link, self._simulator = link, simulator
        self._truth_address = system_address(link.truth)
        self._usable = all(map(usable, link.sockets)) and self._truth_address is not None
        self._peer: Address | None = None
        self._buffers: SocketBuffers | None = None
        self._exchange: Any = None  # machine code, after its first use

    def run(self) -> tuple[bool, tuple[bytes, Address] | None]:
        """Run after the sensors of a tick were sent. Returns whether the world has moved on to a tick that is
        still to be sent, and otherwise the datagram that came, if any, as `Link.receive` returns it."""
        link, simulator = self._link, self._simulator
        batch = simulator.tick_batch() if self._usable else None
        buffers = None if batch is None else self._ready()
        if batch is None or buffers is None:
            return False, link.receive()
        gathered = link.take_gathered()
        if len(gathered) > _TRUTH_CAPACITY - MAX_TRUTH_BYTES:
            link.gather(gathered, link.window_ends_us)
            return False, link.receive()
        buffers.gathered[: len(gathered)] = np.frombuffer(gathered, np.uint8)
        buffers.sizes[_GATHERED], buffers.window_ends_us[0] = len(gathered), link.window_ends_us
        if self._exchange is None:
            self._exchange = entry_point_of(exchange, buffers, batch)
        reason = self._exchange(buffers, batch)
        link.gather(buffers.gathered[: buffers.sizes[_GATHERED]].tobytes(), int(buffers.window_ends_us[0]))
        if batch.numbers[TICKS_RUN]:
            link.note_answer()
        simulator.finish_batch(sensors_sent=reason != ADVANCED)
        if reason != RECEIVED:
            return reason == ADVANCED, None
        sender = buffers.sender.tobytes()
        return False, (buffers.received[: buffers.sizes[_RECEIVED]].tobytes(), address_of_system(sender))

    def _ready(self) -> SocketBuffers | None:
        """The wire to the autopilot that is served now; None: machine code cannot send to its address."""
        peer = self._link.peer
        if peer != self._peer:
            self._peer = peer
            address = None if peer is None else system_address(peer)
            self._buffers = None if address is None else self._buffers_to(address)
        return self._buffers

    def _buffers_to(self, peer: bytes) -> SocketBuffers:
        assert self._truth_address is not None
        sock, truth_sock = self._link.sockets
        return _new_buffers(sock.fileno(), truth_sock.fileno(), peer, self._truth_address)


def _new_buffers(fd: int, truth_fd: int, peer: bytes, truth_address: bytes) -> SocketBuffers:
    return SocketBuffers(
        fd,
        truth_fd,
        np.frombuffer(peer, np.uint8).copy(),
        np.zeros(SYSTEM_ADDRESS_BYTES, np.uint8),
        np.frombuffer(truth_address, np.uint8).copy(),
        np.zeros(MAX_DATAGRAM_BYTES, np.uint8),
        np.zeros(_TRUTH_CAPACITY, np.uint8),
        np.zeros(3, np.int64),
        np.zeros(1, np.int64),
    )


def warm_up(simulator: HilSimulator) -> None:
    """Prepare the machine code of `exchange`, if this simulator can use it."""
    batch = simulator.tick_batch()
    if SUPPORTED and batch is not None:
        entry_point_of(exchange, _new_buffers(-1, -1, b"", b""), batch)
