"""Ticks of the world that machine code can move on by itself: what it needs for that, and what comes of it.

Most ticks are alike: an answer comes, the world moves, frames of sensors and truth go out. `HilSimulator`
says until when that is all there is (`running`), a loop in machine code does it (`sitl.shell.tick_loop`),
and `HilSimulator.ran` takes over what has become of the world. All else is left to `HilSimulator`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from autopilot.geometry.addresses import kernel_giving
from autopilot.geometry.entry import native_address_of
from autopilot.geometry.packed import Row
from autopilot.vehicle.layout import MOST
from autopilot.wire.codec import FrameWriter
from autopilot.wire.compiled import Bytes
from autopilot.wire.simulator_frames import answer_in
from sitl.messages import VEHICLE_SYSTEM, put_sensors, put_truth
from sitl.plant.rotors import ASKED
from sitl.world import WorldRows, rotors_of, world_tick

Ints = NDArray[np.int64]

# what `Running.numbers` are
NOW_US, TICKS, TICK_US, UNTIL_US, TRUTH_EVERY = range(5)
SEQUENCE, TRUTH_SEQUENCE, DIALECT_SEQUENCE = range(5, 8)  # of the next frames of the three components
LENGTH = 8  # bytes of the sensors' frames in the buffer
RAN = 9  # ticks that were moved on in this call
ARMED, GRIPPER_OPEN = 10, 11  # of the last answer
_NUMBERS = 12

ask_answer: Any = kernel_giving(
    types.boolean,
    types.int64,
    types.UniTuple(types.float64, MOST),
    types.boolean,
    types.boolean,
    types.float64,
)
ask_sensors: Any = kernel_giving(types.int64, types.int64)


class Code(NamedTuple):
    """Addresses of kernels."""

    answer_in: int
    world_tick: int
    put_sensors: int
    put_truth: int


class Running(NamedTuple):
    """What the ticks to come work with, until `numbers[UNTIL_US]`: that one is not such a tick any more."""

    numbers: Ints
    command: Row  # of the last answer: forces of as many rotors as there can be (N), rate of the winch (m/s)
    rows: WorldRows
    chain: Any
    newest: Row
    statement: Row
    buffer: Bytes
    payload: Bytes
    code: Code


class Writers(NamedTuple):
    """Who writes the frames of a tick."""

    sensors: FrameWriter
    truth: FrameWriter
    dialect: FrameWriter


class Room(NamedTuple):
    """What the frames of a tick are written from and to."""

    newest: Row
    statement: Row
    buffer: Bytes
    payload: Bytes


class Ran(NamedTuple):
    """Where the world stands, and what the last answer said."""

    now_us: int
    ticks: int
    forces: list[float]  # N, of as many rotors as there can be
    reel_rate: float  # m/s
    armed: bool
    gripper_open: bool
    framed: int  # bytes of the sensors' frames of the last tick that was told of


class Runner:
    """Puts `Running` together, and takes apart what has become of it."""

    def __init__(self, writers: Writers) -> None:
        self._writers = writers
        self._numbers, self._command = np.zeros(_NUMBERS, np.int64), np.zeros(MOST + 1)
        self._code: Code | None = None  # once it was asked for

    def running(
        self, times: tuple[int, int, int, int, int], rows: WorldRows, chain: Any, room: Room
    ) -> Running | None:
        """What the next ticks work with; `times`: the time now (us), the number of this tick, how long one
        lasts (us), when the first comes that is left to Python (us), and each how many-th has its truth told.
        None where nothing is compiled."""
        self._code = self._code or code_of(rows, chain, room)
        if self._code is None:
            return None
        self._numbers[:] = *times, *(writer.sequence for writer in self._writers), 0, 0, 0, 0
        return Running(self._numbers, self._command, rows, chain, *room, self._code)

    def ran(self) -> Ran | None:
        """What has become of it; None: there were no ticks. The writers are brought up to date."""
        if self._numbers[RAN] == 0:
            return None
        numbers, forces = self._numbers.tolist(), self._command.tolist()
        for writer, at in zip(self._writers, (SEQUENCE, TRUTH_SEQUENCE, DIALECT_SEQUENCE), strict=True):
            writer.sequence = numbers[at]
        said = (forces[:MOST], forces[MOST], bool(numbers[ARMED]), bool(numbers[GRIPPER_OPEN]))
        return Ran(numbers[NOW_US], numbers[TICKS], *said, numbers[LENGTH])


def code_of(rows: WorldRows, chain: Any, room: Room) -> Code | None:
    """The kernels for such a world, compiled or loaded where need be; None where nothing is compiled."""
    if not hasattr(world_tick, "overloads"):
        return None
    newest, statement, buffer, payload = room
    truth_rows = (rows.world, rows.model, rotors_of(rows), statement)
    return Code(
        native_address_of(answer_in, b"", VEHICLE_SYSTEM, payload),
        native_address_of(world_tick, rows, rows.rotors[ASKED], False, 0.0, chain),
        native_address_of(put_sensors, rows, 0, newest, statement, buffer, payload, 0),
        native_address_of(put_truth, *truth_rows, buffer, payload, 0, 0),
    )
