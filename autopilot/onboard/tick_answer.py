"""What follows the tick of the flight software, in machine code: the vehicle's condition, and the answer."""

from __future__ import annotations

import numpy as np

from autopilot.core.health import update_condition
from autopilot.estimation.inbox import is_valid_imu
from autopilot.estimation.records import ImuReading
from autopilot.geometry.entry import kernel_address_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import Row, unpack
from autopilot.wire.compiled import Bytes
from autopilot.wire.simulator_frames import put_answer


@kernel
def answer_tick(
    condition: Row,
    imu: Row,
    forces: Row,
    battery: Row,
    fields: int,
    has_fix: bool,
    now_us: int,
    dt: float,
    buffer: Bytes,
    payload: Bytes,
    sequence: int,
    system: int,
    component: int,
    armed: bool,
    lockstep: bool,
    released: bool,
    reel_rate: float,
) -> tuple[int, bool]:
    """Update the `Condition` to this tick (`update_condition`) and write HIL_ACTUATOR_CONTROLS to the
    beginning of a buffer (`put_answer`). Returns its number of bytes, and whether the inertial sample is
    sane."""
    update_condition(condition, imu, forces, battery, fields, has_fix, now_us, dt)
    end = put_answer(
        buffer,
        payload,
        sequence,
        system,
        component,
        now_us,
        forces,
        armed,
        lockstep,
        released,
        reel_rate,
    )
    return end, is_valid_imu(unpack(ImuReading, imu, 0))


def address_of_answer() -> int:
    """The address of `answer_tick`, compiled or loaded if necessary."""
    row, scratch = np.zeros(1), np.zeros(1, np.uint8)
    rows, buffers, flags = (row, row, row, row), (scratch, scratch), (False, False, False, 0.0)
    return kernel_address_of(answer_tick, *rows, 0, False, 0, 0.0, *buffers, 0, 0, 0, *flags)
