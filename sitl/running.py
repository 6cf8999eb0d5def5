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
    types.UniTuple(types.float64, 14),
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
    command: Row  # of the last answer: forces of 14 rotors (N), rate of the winch (m/s)
    rows: WorldRows
    chain: Any
    newest: Row
    statement: Row
    buffer: Bytes
    payload: Bytes
    code: Code


def new_numbers() -> Ints:
    """Room for `Running.numbers`."""
    return np.zeros(_NUMBERS, np.int64)


def code_of(
    rows: WorldRows, chain: Any, newest: Row, statement: Row, buffer: Bytes, payload: Bytes
) -> Code | None:
    """The kernels for such a world, compiled or loaded where need be; None where nothing is compiled."""
    if not hasattr(world_tick, "overloads"):
        return None
    truth_rows = (rows.world, rows.model, rotors_of(rows), statement)
    return Code(
        native_address_of(answer_in, b"", VEHICLE_SYSTEM, payload),
        native_address_of(world_tick, rows, rows.rotors[ASKED], False, 0.0, chain),
        native_address_of(put_sensors, rows, 0, newest, statement, buffer, payload, 0),
        native_address_of(put_truth, *truth_rows, buffer, payload, 0, 0),
    )
