"""Lockstep in machine code: ticks without Python, as long as no decision or answer has to be waited for.

`fly_ticks` waits for the sensors of the next tick, flies it, writes the streams that are due, and answers,
until something else is to be done: a datagram arrives that is not the plain next tick, none arrives in time,
the supervisor must decide, or the next tick requires more.
"""

from __future__ import annotations

import socket
from typing import Any, NamedTuple

import numpy as np

from autopilot.core.sensor_inbox import Tick
from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.kernel import kernel, nogil_kernel
from autopilot.onboard.onboard import Onboard
from autopilot.onboard.tick_batch import (
    LAST_REQUEST_US,
    LENGTH,
    MAX_WINDOWS,
    SEND_SINGLY_US,
    UNSENT_BYTES,
    WAITING_WINDOWS,
    Ints,
    TickBatch,
    TimesyncRequests,
)
from autopilot.onboard.ticks import (
    NEEDS_DECISION,
    OTHER_DATAGRAM,
    WINDOW_ENDED,
    can_continue,
    fly_next,
    tick_to_decide,
)
from autopilot.shell.machine_sockets import (
    NOWHERE,
    SUPPORTED,
    receive_at,
    send_at,
    send_to_at,
    system_address,
    usable,
)
from autopilot.shell.options import MAX_DATAGRAM_BYTES, Address
from autopilot.wire.compiled import Bytes

# why `fly_ticks` returns, beside OTHER_DATAGRAM and NEEDS_DECISION
NEEDS_PYTHON, TIMED_OUT = 4, 5


class SocketBuffers(NamedTuple):
    """The socket towards the simulator, the datagram received by it, and socket and address of the ground."""

    fd: int
    received: Bytes
    size: Ints  # (1,) of `received`
    ground_fd: int
    ground: Bytes  # its address in the form of the system


class BatchEnd(NamedTuple):
    """What ended the ticks without Python."""

    flew_ticks: bool  # whether there were any
    can_continue: bool = False  # and whether there may be more
    datagram: bytes | None = None  # a datagram to be handled
    tick_to_decide: Tick | None = None  # a tick that needs a decision


NO_BATCH = BatchEnd(False)


@kernel
def _send_windows(buffers: SocketBuffers, batch: TickBatch) -> None:
    """Send the closed windows if there are enough of them or the ground will soon be waited for."""
    numbers, address = batch.numbers, batch.streams.unsent.ctypes.data
    if numbers[WAITING_WINDOWS] < numbers[MAX_WINDOWS] and numbers[LAST_REQUEST_US] < numbers[SEND_SINGLY_US]:
        return
    begin = 0
    for i in range(numbers[WAITING_WINDOWS]):
        end = batch.window_ends[i]
        send_to_at(
            buffers.ground_fd, address + begin, end - begin, buffers.ground.ctypes.data, len(buffers.ground)
        )
        begin = end
    if begin > 0:  # the last message was a timesync request: nothing is left
        numbers[WAITING_WINDOWS] = numbers[UNSENT_BYTES] = 0


@nogil_kernel
def fly_ticks(buffers: SocketBuffers, batch: TickBatch) -> int:
    """Fly ticks until the next one must be left to Python (NEEDS_PYTHON), another datagram arrives
    (OTHER_DATAGRAM), none does in time (TIMED_OUT), or the supervisor must decide (NEEDS_DECISION)."""
    while can_continue(batch):
        size = receive_at(buffers.fd, buffers.received.ctypes.data, len(buffers.received))
        buffers.size[0] = size
        if size < 0:
            return TIMED_OUT
        outcome = fly_next(batch, buffers.received.ctypes.data, size)
        if outcome >= OTHER_DATAGRAM:
            return outcome
        if outcome == WINDOW_ENDED:
            _send_windows(buffers, batch)
        send_at(buffers.fd, batch.frame.ctypes.data, batch.numbers[LENGTH])
    return NEEDS_PYTHON


class TickLoop:
    """Runs `fly_ticks` if the system and the sockets allow it."""

    def __init__(self, sock: socket.socket, ground: socket.socket, address: Address) -> None:
        """`sock` is connected to the simulator; `ground` sends to the ground station at `address`."""
        ground_address = system_address(address)
        self._usable = usable(sock) and usable(ground) and ground_address is not None
        received, address_bytes = (
            np.zeros(MAX_DATAGRAM_BYTES, np.uint8),
            np.frombuffer(ground_address or NOWHERE, np.uint8).copy(),
        )
        self._buffers = SocketBuffers(
            sock.fileno(), received, np.zeros(1, np.int64), ground.fileno(), address_bytes
        )
        self._fly_ticks: Any = None  # machine code, after the first call

    def run(self, onboard: Onboard, timesync_requests: TimesyncRequests) -> BatchEnd:
        """Fly the ticks that can be flown in this way; returns what ended them."""
        batch = onboard.tick_batch(timesync_requests) if self._usable else None
        if batch is None:
            return NO_BATCH
        buffers = self._buffers
        if self._fly_ticks is None:
            self._fly_ticks = entry_point_of(fly_ticks, buffers, batch)
        reason = self._fly_ticks(buffers, batch)
        flew_ticks = onboard.finish_batch()
        if reason == OTHER_DATAGRAM:
            return BatchEnd(flew_ticks, datagram=buffers.received[: buffers.size[0]].tobytes())
        if reason == NEEDS_DECISION:
            return BatchEnd(flew_ticks, tick_to_decide=tick_to_decide(batch))
        return BatchEnd(flew_ticks, can_continue=flew_ticks and reason == NEEDS_PYTHON)


def warm_up(onboard: Onboard) -> None:
    """Compile or load the machine code of `fly_ticks` if it can be used on this system."""
    if SUPPORTED:
        none = np.zeros(1, np.uint8)
        buffers = SocketBuffers(-1, none, np.zeros(1, np.int64), -1, none)
        entry_point_of(fly_ticks, buffers, onboard.warmup_batch())
