"""Ticks of the world that machine code can run without Python: the data for them, and their results.

Most ticks are alike: an answer comes, the world moves, frames of sensors and truth are sent. `HilSimulator`
determines until when nothing else is due (`tick_batch`), a loop in machine code runs these ticks
(`sitl.shell.tick_loop`), and `HilSimulator.finish_batch` takes over the resulting state of the world.
Everything else is left to `HilSimulator`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from autopilot.geometry.addresses import call_kernel_returning
from autopilot.geometry.entry import kernel_address_of
from autopilot.geometry.packed import Row
from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.wire.codec import FrameWriter
from autopilot.wire.compiled import Bytes
from autopilot.wire.simulator_frames import read_answer
from sitl.messages import VEHICLE_SYSTEM, put_sensors, put_truth
from sitl.plant.rotors import REQUESTED
from sitl.sensor_log import NOT_LOGGED, LogRows, put_instant
from sitl.world import WorldRows, rotors_of, world_tick

Ints = NDArray[np.int64]

# entries of `TickBatch.numbers`
NOW_US, TICKS, TICK_US, UNTIL_US, TRUTH_EVERY = range(5)
SEQUENCE, TRUTH_SEQUENCE, DIALECT_SEQUENCE = range(5, 8)  # of the next frames of the three components
LENGTH = 8  # bytes of the sensors' frames in the buffer
TICKS_RUN = 9  # ticks that were run in this call
ARMED, GRIPPER_OPEN = 10, 11  # of the last answer
_NUMBERS = 12

call_read_answer: Any = call_kernel_returning(
    types.boolean,
    types.int64,
    types.UniTuple(types.float64, MAX_ROTORS),
    types.boolean,
    types.boolean,
    types.float64,
)
call_put_sensors: Any = call_kernel_returning(types.int64, types.int64)


class KernelAddresses(NamedTuple):
    """Addresses of kernels."""

    read_answer: int
    world_tick: int
    put_sensors: int
    put_truth: int
    put_instant: int  # 0: nothing is logged


class TickBatch(NamedTuple):
    """The data of the next ticks, up to but without the tick at `numbers[UNTIL_US]`, which needs Python."""

    numbers: Ints
    command: Row  # of the last answer: forces of the greatest number of rotors (N), rate of the winch (m/s)
    rows: WorldRows
    chain: Any
    latest: Row
    constants: Row
    buffer: Bytes
    payload: Bytes
    log: LogRows
    code: KernelAddresses


class Writers(NamedTuple):
    """The writers of the frames of a tick."""

    sensors: FrameWriter
    truth: FrameWriter
    dialect: FrameWriter


class FrameBuffers(NamedTuple):
    """The arrays from which and to which the frames of a tick are written."""

    latest: Row
    constants: Row
    buffer: Bytes
    payload: Bytes


class BatchResult(NamedTuple):
    """The present tick of the world, and the contents of the last answer."""

    now_us: int
    ticks: int
    forces: list[float]  # N, of the greatest number of rotors
    reel_rate: float  # m/s
    armed: bool
    gripper_open: bool
    sensor_bytes: int  # bytes of the sensors' frames of the last tick that was sent


class BatchBuilder:
    """Assembles `TickBatch`, and reads the results from it."""

    def __init__(self, writers: Writers) -> None:
        self._writers = writers
        self._numbers, self._command = np.zeros(_NUMBERS, np.int64), np.zeros(MAX_ROTORS + 1)
        self._code: KernelAddresses | None = None  # after its first use

    def next_batch(
        self,
        times: tuple[int, int, int, int, int],
        rows: WorldRows,
        chain: Any,
        buffers: FrameBuffers,
        log: LogRows,
    ) -> TickBatch | None:
        """The data of the next ticks. `times`: the time now (us), the number of this tick, the duration of a
        tick (us), the time of the first tick that is left to Python (us), and the number of ticks from one
        truth to the next. None where nothing is compiled."""
        self._code = self._code or kernel_addresses(rows, chain, buffers, log)
        if self._code is None:
            return None
        self._numbers[:] = *times, *(writer.sequence for writer in self._writers), 0, 0, 0, 0
        return TickBatch(self._numbers, self._command, rows, chain, *buffers, log, self._code)

    def result(self) -> BatchResult | None:
        """The results; None: there were no ticks. The sequence counters of the writers are updated."""
        if self._numbers[TICKS_RUN] == 0:
            return None
        numbers, forces = self._numbers.tolist(), self._command.tolist()
        for writer, at in zip(self._writers, (SEQUENCE, TRUTH_SEQUENCE, DIALECT_SEQUENCE), strict=True):
            writer.sequence = numbers[at]
        last_answer = (
            forces[:MAX_ROTORS],
            forces[MAX_ROTORS],
            bool(numbers[ARMED]),
            bool(numbers[GRIPPER_OPEN]),
        )
        return BatchResult(numbers[NOW_US], numbers[TICKS], *last_answer, numbers[LENGTH])


def kernel_addresses(
    rows: WorldRows, chain: Any, buffers: FrameBuffers, log: LogRows
) -> KernelAddresses | None:
    """The kernels for such a world, compiled or loaded if necessary; None where nothing is compiled."""
    if not hasattr(world_tick, "overloads"):
        return None
    latest, constants, buffer, payload = buffers
    truth_rows = (rows.world, rows.model, rotors_of(rows), constants)
    return KernelAddresses(
        kernel_address_of(read_answer, b"", VEHICLE_SYSTEM, payload),
        kernel_address_of(world_tick, rows, rows.rotors[REQUESTED], False, 0.0, chain),
        kernel_address_of(put_sensors, rows, 0, latest, constants, buffer, payload, 0),
        kernel_address_of(put_truth, *truth_rows, buffer, payload, 0, 0),
        0 if log is NOT_LOGGED else kernel_address_of(put_instant, log, rows, buffer, 0),
    )
