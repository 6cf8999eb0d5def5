"""Ticks of the world that machine code can run without Python: the data for them, and their results.

Most ticks are alike: an answer comes, the world moves, frames of sensors and truth are sent. `HilSimulator`
determines until when nothing else is due (`running`), a loop in machine code runs these ticks
(`sitl.shell.tick_loop`), and `HilSimulator.ran` takes over the resulting state of the world. Everything else
is left to `HilSimulator`.
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

# entries of `Running.numbers`
NOW_US, TICKS, TICK_US, UNTIL_US, TRUTH_EVERY = range(5)
SEQUENCE, TRUTH_SEQUENCE, DIALECT_SEQUENCE = range(5, 8)  # of the next frames of the three components
LENGTH = 8  # bytes of the sensors' frames in the buffer
RAN = 9  # ticks that were run in this call
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
    """The data of the next ticks, up to but without the tick at `numbers[UNTIL_US]`, which needs Python."""

    numbers: Ints
    command: Row  # of the last answer: forces of the greatest number of rotors (N), rate of the winch (m/s)
    rows: WorldRows
    chain: Any
    newest: Row
    statement: Row
    buffer: Bytes
    payload: Bytes
    code: Code


class Writers(NamedTuple):
    """The writers of the frames of a tick."""

    sensors: FrameWriter
    truth: FrameWriter
    dialect: FrameWriter


class Room(NamedTuple):
    """The arrays from which and to which the frames of a tick are written."""

    newest: Row
    statement: Row
    buffer: Bytes
    payload: Bytes


class Ran(NamedTuple):
    """The present tick of the world, and the contents of the last answer."""

    now_us: int
    ticks: int
    forces: list[float]  # N, of the greatest number of rotors
    reel_rate: float  # m/s
    armed: bool
    gripper_open: bool
    framed: int  # bytes of the sensors' frames of the last tick that was sent


class Runner:
    """Assembles `Running`, and reads the results from it."""

    def __init__(self, writers: Writers) -> None:
        self._writers = writers
        self._numbers, self._command = np.zeros(_NUMBERS, np.int64), np.zeros(MOST + 1)
        self._code: Code | None = None  # after its first use

    def running(
        self, times: tuple[int, int, int, int, int], rows: WorldRows, chain: Any, room: Room
    ) -> Running | None:
        """The data of the next ticks. `times`: the time now (us), the number of this tick, the duration of a
        tick (us), the time of the first tick that is left to Python (us), and the number of ticks from one
        truth to the next. None where nothing is compiled."""
        self._code = self._code or code_of(rows, chain, room)
        if self._code is None:
            return None
        self._numbers[:] = *times, *(writer.sequence for writer in self._writers), 0, 0, 0, 0
        return Running(self._numbers, self._command, rows, chain, *room, self._code)

    def ran(self) -> Ran | None:
        """The results; None: there were no ticks. The sequence counters of the writers are updated."""
        if self._numbers[RAN] == 0:
            return None
        numbers, forces = self._numbers.tolist(), self._command.tolist()
        for writer, at in zip(self._writers, (SEQUENCE, TRUTH_SEQUENCE, DIALECT_SEQUENCE), strict=True):
            writer.sequence = numbers[at]
        said = (forces[:MOST], forces[MOST], bool(numbers[ARMED]), bool(numbers[GRIPPER_OPEN]))
        return Ran(numbers[NOW_US], numbers[TICKS], *said, numbers[LENGTH])


def code_of(rows: WorldRows, chain: Any, room: Room) -> Code | None:
    """The kernels for such a world, compiled or loaded if necessary; None where nothing is compiled."""
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
