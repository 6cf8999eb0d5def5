"""Lockstep in machine code: tick after tick without Python, as long as nothing is to be decided, or asked.

`fly_on` waits for the sensors of the next tick, flies it, writes the streams that are due, and answers, until
something else is to be done: a datagram comes that is not the plain next tick, none comes in time, the
supervisor is to decide, or a tick is near at which more is to be said.
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
    """The socket towards the simulator, what came by it, and the way to the ground station."""

    fd: int
    heard: Bytes
    size: Ints  # (1,) of `heard`
    ground_fd: int
    ground: Bytes  # its address, as the system has it


class Met(NamedTuple):
    """What ended the ticks without Python."""

    ran: bool  # there were any
    more: bool = False  # and there may be more
    datagram: bytes | None = None  # that is to be handled
    decide: Tick | None = None  # a tick that is to be decided upon


NOTHING = Met(False)


@kernel
def _send_windows(wire: Wire, run: Running) -> None:
    """Send the windows that are over, once they are enough or the ground will soon be waited for."""
    numbers, said = run.numbers, run.streams.said.ctypes.data
    if numbers[ASKED] < numbers[MOST_ASKED] and numbers[ASKED_US] < numbers[ALONE_US]:
        return
    begin = 0
    for i in range(numbers[ASKED]):
        end = run.windows[i]
        send_to_at(wire.ground_fd, said + begin, end - begin, wire.ground.ctypes.data, len(wire.ground))
        begin = end
    if begin > 0:  # what was said last was a question: nothing is left
        numbers[ASKED] = numbers[SAID] = 0


@threaded
def fly_on(wire: Wire, run: Running) -> int:
    """Fly ticks until one is near that is none of these (UNTIL), until another datagram is HEARD, or none
    (SILENCE), or until there is one to DECIDE upon."""
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
    """Runs `fly_on` where it can be run."""

    def __init__(self, sock: socket.socket, ground: socket.socket, address: Address) -> None:
        """`sock` is connected to the simulator; `ground` sends to the ground station at `address`."""
        at = system_address(address)
        self._usable = usable(sock) and usable(ground) and at is not None
        heard, to = np.zeros(LARGEST_DATAGRAM, np.uint8), np.frombuffer(at or NOWHERE, np.uint8).copy()
        self._wire = Wire(sock.fileno(), heard, np.zeros(1, np.int64), ground.fileno(), to)
        self._fly_on: Any = None  # machine code, once it was asked for

    def run(self, onboard: Onboard, questions: Questions) -> Met:
        """Fly the ticks that can be flown so; what ended them."""
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
    """Have the machine code of `fly_on` ready, where it is used."""
    if SUPPORTED:
        none = np.zeros(1, np.uint8)
        wire = Wire(-1, none, np.zeros(1, np.int64), -1, none)
        entry_of(fly_on, wire, onboard.rehearsed_running())
