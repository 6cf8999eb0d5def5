"""A tick of the simulated world in machine code. The callers receive its answer and send its frames.

`move_on` takes an answer and moves the world to the next tick, whose truth (`put_truth_due`) and sensors
(`put_sensors_next`) can then be written, unless more must be sent at that tick (`goes_on`): see
`sitl.running`.
"""

from __future__ import annotations

from math import isfinite

from autopilot.geometry.addresses import ask_kernel_at, bytes_at, call_kernel_at
from autopilot.geometry.kernel import kernel
from autopilot.vehicle.layout import MOST
from autopilot.wire.compiled import FRAME_ROOM, Bytes
from sitl.hil import LEAST_SNAP
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
    Running,
    ask_answer,
    ask_sensors,
)
from sitl.sim_core import SNAP_SPEED
from sitl.world import rotors_of

TRUTH_OF_A_TICK = (1 + DIALECT_FRAMES) * FRAME_ROOM  # bytes


@kernel
def move_on(run: Running, address: int, size: int) -> bool:
    """Move the world on with the answer in the `size` bytes at `address`; False if these are not the plain
    answer to this tick."""
    numbers, rows, code = run.numbers, run.rows, run.code
    asked, rotors = rows.rotors[ASKED], rows.rotor_table.shape[0]
    said = ask_answer(code.answer_in, (bytes_at(address, size), VEHICLE_SYSTEM, run.payload))
    plain, time_us, forces, armed, gripper_open, reel_rate = said
    total = 0.0
    for i in range(MOST):
        total += forces[i]
    if not plain or time_us != numbers[NOW_US] or not isfinite(total):
        return False
    asked[:] = 0.0
    for i in range(MOST):
        run.command[i] = forces[i]
        if armed and i < rotors:
            asked[i] = forces[i]
    run.command[MOST] = reel_rate
    numbers[ARMED], numbers[GRIPPER_OPEN] = armed, gripper_open
    call_kernel_at(code.world_tick, (rows, asked, gripper_open, reel_rate, run.chain))
    numbers[NOW_US] += numbers[TICK_US]
    numbers[TICKS] += 1
    numbers[RAN] += 1
    return True


@kernel
def goes_on(run: Running) -> bool:
    """Whether nothing but sensors and truth must be sent at this tick."""
    return bool(run.numbers[NOW_US] < run.numbers[UNTIL_US] and run.rows.world[SNAP_SPEED] <= LEAST_SNAP)


@kernel
def put_truth_due(run: Running, room: Bytes) -> int:
    """Write the truth of this tick if it is due; returns its number of bytes."""
    numbers, rows = run.numbers, run.rows
    if numbers[TICKS] % numbers[TRUTH_EVERY] != 0:
        return 0
    truth = (rows.world, rows.model, rotors_of(rows), run.statement, room, run.payload)
    length = ask_kernel_at(run.code.put_truth, (*truth, numbers[TRUTH_SEQUENCE], numbers[DIALECT_SEQUENCE]))
    numbers[TRUTH_SEQUENCE] = (numbers[TRUTH_SEQUENCE] + 1) & 0xFF
    numbers[DIALECT_SEQUENCE] = (numbers[DIALECT_SEQUENCE] + DIALECT_FRAMES) & 0xFF
    return int(length)


@kernel
def put_sensors_next(run: Running) -> int:
    """Write the sensors of this tick into `run.buffer`; returns their number of bytes."""
    numbers = run.numbers
    length, sequence = ask_sensors(
        run.code.put_sensors,
        (run.rows, numbers[NOW_US], run.newest, run.statement, run.buffer, run.payload, numbers[SEQUENCE]),
    )
    numbers[LENGTH], numbers[SEQUENCE] = length, sequence
    return int(length)
