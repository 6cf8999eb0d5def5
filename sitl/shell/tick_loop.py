"""Lockstep in machine code: tick after tick without Python, as long as there are but answers and frames.

`exchange` stands where the sensors of a tick have been sent. It waits for the answer, moves the world on, and
sends the frames of the next tick, until something else is to be done: a datagram comes that is not the plain
answer to this tick, none comes in time, or a tick is due at which more is to be said than sensors and truth.
"""

from __future__ import annotations

from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from autopilot.geometry.addresses import ask_kernel_at, bytes_at, call_kernel_at
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
from autopilot.vehicle.layout import MOST
from autopilot.wire.compiled import FRAME_ROOM, Bytes
from sitl.hil import LEAST_SNAP, HilSimulator
from sitl.messages import DIALECT_FRAMES, VEHICLE_SYSTEM
from sitl.plant.rotors import ASKED
from sitl.running import (
    ARMED,
    DIALECT_SEQUENCE,
    GRIPPER_OPEN,
    LENGTH,
    NOW_US,
    RAN,
    SEQUENCE,
    TICK_US,
    TICKS,
    TRUTH_EVERY,
    TRUTH_SEQUENCE,
    UNTIL_US,
    Ints,
    Running,
    ask_answer,
    ask_sensors,
)
from sitl.shell.link import TRUTH_WINDOW_US, Link
from sitl.sim_core import SNAP_SPEED
from sitl.world import rotors_of

# why `exchange` returns
SILENCE, HEARD, MOVED = 0, 1, 2
_TRUTH_ROOM = 65_507  # bytes of the longest datagram; a window has less
_TRUTH_OF_A_TICK = (1 + DIALECT_FRAMES) * FRAME_ROOM
# what `Wire.sizes` are
_ADDRESS, _HEARD, _GATHERED = range(3)


class Wire(NamedTuple):
    """The sockets, and what goes through them."""

    fd: int
    truth_fd: int
    peer: Bytes  # the addresses of the autopilot that is served, of who has spoken, and where truth goes
    sender: Bytes
    truth_to: Bytes
    heard: Bytes  # the last datagram
    gathered: Bytes  # truth of this window
    sizes: Ints  # of a system's address; of `heard`; of `gathered`
    window_ends_us: Ints  # (1,)


@kernel
def _tell(wire: Wire, run: Running, now_us: int) -> None:
    """Send the sensors of this tick; gather its truth, and at the end of a window send that."""
    numbers, rows, code = run.numbers, run.rows, run.code
    if numbers[TICKS] % numbers[TRUTH_EVERY] == 0:
        begin = wire.sizes[_GATHERED]
        truth = (rows.world, rows.model, rotors_of(rows), run.statement, wire.gathered[begin:], run.payload)
        length = ask_kernel_at(code.put_truth, (*truth, numbers[TRUTH_SEQUENCE], numbers[DIALECT_SEQUENCE]))
        wire.sizes[_GATHERED] = begin + length
        numbers[TRUTH_SEQUENCE] = (numbers[TRUTH_SEQUENCE] + 1) & 0xFF
        numbers[DIALECT_SEQUENCE] = (numbers[DIALECT_SEQUENCE] + DIALECT_FRAMES) & 0xFF
    ends_us = wire.window_ends_us[0]
    if not ends_us - TRUTH_WINDOW_US < now_us < ends_us:
        wire.window_ends_us[0] = now_us - now_us % TRUTH_WINDOW_US + TRUTH_WINDOW_US
        if wire.sizes[_GATHERED] > 0:
            send_to_at(
                wire.truth_fd,
                wire.gathered.ctypes.data,
                wire.sizes[_GATHERED],
                wire.truth_to.ctypes.data,
                SYSTEM_ADDRESS_BYTES,
            )
            wire.sizes[_GATHERED] = 0
    length, sequence = ask_sensors(
        code.put_sensors,
        (rows, now_us, run.newest, run.statement, run.buffer, run.payload, numbers[SEQUENCE]),
    )
    numbers[LENGTH], numbers[SEQUENCE] = length, sequence
    send_to_at(wire.fd, run.buffer.ctypes.data, length, wire.peer.ctypes.data, SYSTEM_ADDRESS_BYTES)


@threaded
def exchange(wire: Wire, run: Running) -> int:
    """Ticks of the world, each as soon as the one before is answered: SILENCE or HEARD where the present one
    is not, MOVED where the world stands at a tick of which nothing is framed yet."""
    numbers, rows, code = run.numbers, run.rows, run.code
    asked, rotors = rows.rotors[ASKED], rows.rotor_table.shape[0]
    now_us = numbers[NOW_US]
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
        said = ask_answer(
            code.answer_in, (bytes_at(wire.heard.ctypes.data, size), VEHICLE_SYSTEM, run.payload)
        )
        plain, time_us, forces, armed, gripper_open, reel_rate = said
        total = 0.0
        for i in range(MOST):
            total += forces[i]
        if not plain or time_us != now_us or not isfinite(total):
            return HEARD
        asked[:] = 0.0
        for i in range(MOST):
            run.command[i] = forces[i]
            if armed and i < rotors:
                asked[i] = forces[i]
        run.command[MOST] = reel_rate
        numbers[ARMED], numbers[GRIPPER_OPEN] = armed, gripper_open
        call_kernel_at(code.world_tick, (rows, asked, gripper_open, reel_rate, run.chain))
        now_us += numbers[TICK_US]
        numbers[NOW_US] = now_us
        numbers[TICKS] += 1
        numbers[RAN] += 1
        full = wire.sizes[_GATHERED] > _TRUTH_ROOM - _TRUTH_OF_A_TICK
        if now_us >= numbers[UNTIL_US] or rows.world[SNAP_SPEED] > LEAST_SNAP or full:
            return MOVED
        _tell(wire, run, now_us)


class TickLoop:
    """Runs `exchange` where it can be run."""

    def __init__(self, link: Link, simulator: HilSimulator) -> None:
        self._link, self._simulator = link, simulator
        self._truth_to = system_address(link.truth)
        self._usable = all(map(usable, link.sockets)) and self._truth_to is not None
        self._peer: Address | None = None
        self._wire: Wire | None = None
        self._exchange: Any = None  # machine code, once it was asked for

    def run(self) -> tuple[bool, tuple[bytes, Address] | None]:
        """Behind the sending of a tick's sensors: whether the world has moved on to a tick that is still to
        be told of, else the datagram that has come, if any, as `Link.receive` gives it."""
        link, simulator = self._link, self._simulator
        run = simulator.running() if self._usable else None
        wire = None if run is None else self._ready()
        if run is None or wire is None:
            return False, link.receive()
        gathered = link.take_gathered()
        if len(gathered) > _TRUTH_ROOM - _TRUTH_OF_A_TICK:
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
        """The wire towards the autopilot that is served now; None: machine code cannot speak to it."""
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
    """Have the machine code of `exchange` ready, if this simulator can use it."""
    run = simulator.running()
    if SUPPORTED and run is not None:
        entry_of(exchange, _new_wire(-1, -1, b"", b""), run)
