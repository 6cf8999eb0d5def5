"""A tick of the simulated world in machine code. The callers receive its answer and send its frames.

`advance_with_answer` moves the world with an answer to the next tick, whose truth (`put_truth_if_due`) and
sensors (`put_next_sensors`) can then be written, unless more must be sent at that tick (`can_continue`): see
`sitl.tick_batch`.
"""

from __future__ import annotations

from math import isfinite

from autopilot.geometry.addresses import bytes_at, call_int_kernel_at, call_kernel_at
from autopilot.geometry.kernel import kernel
from autopilot.vehicle.layout import MAX_ROTORS
from autopilot.wire.compiled import MAX_FRAME_BYTES, Bytes
from sitl.hil import MIN_SNAP_SPEED
from sitl.messages import DIALECT_FRAMES, VEHICLE_SYSTEM
from sitl.plant.rotors import REQUESTED
from sitl.sensor_log import has_room
from sitl.sim_core import SNAP_SPEED
from sitl.tick_batch import (
    ARMED,
    DIALECT_SEQUENCE,
    GRIPPER_OPEN,
    LENGTH,
    NOW_US,
    SEQUENCE,
    TICK_US,
    TICKS,
    TICKS_RUN,
    TRUTH_EVERY,
    TRUTH_SEQUENCE,
    UNTIL_US,
    TickBatch,
    call_put_sensors,
    call_read_answer,
)
from sitl.world import rotors_of

MAX_TRUTH_BYTES = (1 + DIALECT_FRAMES) * MAX_FRAME_BYTES  # bytes


@kernel
def advance_with_answer(batch: TickBatch, address: int, size: int) -> bool:
    """Move the world on with the answer in the `size` bytes at `address`; False if these are not the plain
    answer to this tick."""
    numbers, rows, code = batch.numbers, batch.rows, batch.code
    requested, rotors = rows.rotors[REQUESTED], rows.rotor_table.shape[0]
    answer = call_read_answer(code.read_answer, (bytes_at(address, size), VEHICLE_SYSTEM, batch.payload))
    is_plain, time_us, forces, armed, gripper_open, reel_rate = answer
    total = 0.0
    for i in range(MAX_ROTORS):
        total += forces[i]
    if not is_plain or time_us != numbers[NOW_US] or not isfinite(total):
        return False
    requested[:] = 0.0
    for i in range(MAX_ROTORS):
        batch.command[i] = forces[i]
        if armed and i < rotors:
            requested[i] = forces[i]
    batch.command[MAX_ROTORS] = reel_rate
    numbers[ARMED], numbers[GRIPPER_OPEN] = armed, gripper_open
    call_kernel_at(code.world_tick, (rows, requested, gripper_open, reel_rate, batch.chain))
    numbers[NOW_US] += numbers[TICK_US]
    numbers[TICKS] += 1
    numbers[TICKS_RUN] += 1
    return True


@kernel
def can_continue(batch: TickBatch) -> bool:
    """Whether nothing but sensors and truth must be sent at this tick, and its sensors can be logged."""
    return bool(
        batch.numbers[NOW_US] < batch.numbers[UNTIL_US]
        and batch.rows.world[SNAP_SPEED] <= MIN_SNAP_SPEED
        and has_room(batch.log)
    )


@kernel
def put_truth_if_due(batch: TickBatch, buffer: Bytes) -> int:
    """Write the truth of this tick if it is due; returns its number of bytes."""
    numbers, rows = batch.numbers, batch.rows
    if numbers[TICKS] % numbers[TRUTH_EVERY] != 0:
        return 0
    truth = (rows.world, rows.model, rotors_of(rows), batch.constants, buffer, batch.payload)
    length = call_int_kernel_at(
        batch.code.put_truth, (*truth, numbers[TRUTH_SEQUENCE], numbers[DIALECT_SEQUENCE])
    )
    numbers[TRUTH_SEQUENCE] = (numbers[TRUTH_SEQUENCE] + 1) & 0xFF
    numbers[DIALECT_SEQUENCE] = (numbers[DIALECT_SEQUENCE] + DIALECT_FRAMES) & 0xFF
    return int(length)


@kernel
def put_next_sensors(batch: TickBatch) -> int:
    """Write the sensors of this tick into `batch.buffer`, and log them; returns their number of bytes."""
    numbers = batch.numbers
    length, sequence = call_put_sensors(
        batch.code.put_sensors,
        (
            batch.rows,
            numbers[NOW_US],
            batch.latest,
            batch.constants,
            batch.buffer,
            batch.payload,
            numbers[SEQUENCE],
        ),
    )
    numbers[LENGTH], numbers[SEQUENCE] = length, sequence
    if batch.code.put_instant != 0:
        call_kernel_at(batch.code.put_instant, (batch.log, batch.rows, batch.buffer, length))
    return int(length)
