"""Lockstep in machine code: ticks without Python, as long as no decision or answer has to be waited for.

`fly_on` waits for the sensors of the next tick, flies it, writes the streams that are due, and answers, until
something else is to be done: a datagram arrives that is not the plain next tick, none arrives in time, the
supervisor must decide, or the next tick requires more.
"""

from __future__ import annotations

import socket
from typing import Any, NamedTuple

import numpy as np

from autopilot.core.sensor_inbox import Tick
from autopilot.geometry.entry import entry_of
from autopilot.geometry.kernel import kernel, threaded
from autopilot.onboard.onboard import Onboard
from autopilot.onboard.running import (
    ALONE_US,
    ASKED,
    ASKED_US,
    LENGTH,
    MOST_ASKED,
    SAID,
    Ints,
    Questions,
    Running,
)
from autopilot.onboard.ticks import DECIDE, ENDED, HEARD, begun, fly_next, goes_on
from autopilot.shell.machine_sockets import (
    NOWHERE,
    SUPPORTED,
    receive_at,
    send_at,
    send_to_at,
    system_address,
    usable,
)
from autopilot.shell.options import LARGEST_DATAGRAM, Address
from autopilot.wire.compiled import Bytes

# why `fly_on` returns, beside HEARD and DECIDE
UNTIL, SILENCE = 4, 5


class Wire(NamedTuple):
    """The socket towards the simulator, the datagram received by it, and socket and address of the ground."""

    fd: int
    heard: Bytes
    size: Ints  # (1,) of `heard`
    ground_fd: int
    ground: Bytes  # its address in the form of the system


class Met(NamedTuple):
    """What ended the ticks without Python."""

    ran: bool  # whether there were any
    more: bool = False  # and whether there may be more
    datagram: bytes | None = None  # a datagram to be handled
    decide: Tick | None = None  # a tick that needs a decision


NOTHING = Met(False)


@kernel
def _send_windows(wire: Wire, run: Running) -> None:
    """Send the closed windows if there are enough of them or the ground will soon be waited for."""
    numbers, said = run.numbers, run.streams.said.ctypes.data
    if numbers[ASKED] < numbers[MOST_ASKED] and numbers[ASKED_US] < numbers[ALONE_US]:
        return
    begin = 0
    for i in range(numbers[ASKED]):
        end = run.windows[i]
        send_to_at(wire.ground_fd, said + begin, end - begin, wire.ground.ctypes.data, len(wire.ground))
        begin = end
    if begin > 0:  # the last message was a question: nothing is left
        numbers[ASKED] = numbers[SAID] = 0


@threaded
def fly_on(wire: Wire, run: Running) -> int:
    """Fly ticks until the next one must be left to Python (UNTIL), another datagram is HEARD, none arrives
    (SILENCE), or the supervisor must DECIDE."""
    while goes_on(run):
        size = receive_at(wire.fd, wire.heard.ctypes.data, len(wire.heard))
        wire.size[0] = size
        if size < 0:
            return SILENCE
        what = fly_next(run, wire.heard.ctypes.data, size)
        if what >= HEARD:
            return what
        if what == ENDED:
            _send_windows(wire, run)
        send_at(wire.fd, run.frame.ctypes.data, run.numbers[LENGTH])
    return UNTIL


class TickLoop:
    """Runs `fly_on` if the system and the sockets allow it."""

    def __init__(self, sock: socket.socket, ground: socket.socket, address: Address) -> None:
        """`sock` is connected to the simulator; `ground` sends to the ground station at `address`."""
        at = system_address(address)
        self._usable = usable(sock) and usable(ground) and at is not None
        heard, to = np.zeros(LARGEST_DATAGRAM, np.uint8), np.frombuffer(at or NOWHERE, np.uint8).copy()
        self._wire = Wire(sock.fileno(), heard, np.zeros(1, np.int64), ground.fileno(), to)
        self._fly_on: Any = None  # machine code, after the first call

    def run(self, onboard: Onboard, questions: Questions) -> Met:
        """Fly the ticks that can be flown in this way; returns what ended them."""
        run = onboard.running(questions) if self._usable else None
        if run is None:
            return NOTHING
        wire = self._wire
        if self._fly_on is None:
            self._fly_on = entry_of(fly_on, wire, run)
        why = self._fly_on(wire, run)
        ran = onboard.ran()
        if why == HEARD:
            return Met(ran, datagram=wire.heard[: wire.size[0]].tobytes())
        if why == DECIDE:
            return Met(ran, decide=begun(run))
        return Met(ran, more=ran and why == UNTIL)


def rehearse(onboard: Onboard) -> None:
    """Compile or load the machine code of `fly_on` if it can be used on this system."""
    if SUPPORTED:
        none = np.zeros(1, np.uint8)
        wire = Wire(-1, none, np.zeros(1, np.int64), -1, none)
        entry_of(fly_on, wire, onboard.rehearsed_running())
