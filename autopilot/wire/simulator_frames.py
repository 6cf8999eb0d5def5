"""The messages of the simulator link as records of `compiled`, and the answer to a tick in machine code."""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import Row
from autopilot.wire.compiled import (
    Bytes,
    Origin,
    frame_end,
    match_frame,
    put_frame,
    unpack_payload,
    wire_record,
)
from autopilot.wire.convert.simulator import (
    NO_FORCES,
    Forces,
    forces_from_row,
    hil_actuator_controls_values,
    read_hil_actuator_controls,
)
from autopilot.wire.dialect import plumbline as mavlink

HIL_SENSOR = wire_record(mavlink.MAVLink_hil_sensor_message, __name__)
ODOMETRY = wire_record(mavlink.MAVLink_odometry_message, __name__)
LOAD_SENSOR = wire_record(mavlink.MAVLink_load_sensor_message, __name__)
HIL_GPS = wire_record(mavlink.MAVLink_hil_gps_message, __name__)
HIL_ACTUATOR_CONTROLS = wire_record(mavlink.MAVLink_hil_actuator_controls_message, __name__)
HIL_STATE_QUATERNION = wire_record(mavlink.MAVLink_hil_state_quaternion_message, __name__)
LOAD_STATE = wire_record(mavlink.MAVLink_load_state_message, __name__)
ROTOR_STATE = wire_record(mavlink.MAVLink_rotor_state_message, __name__)
ESC_STATUS = wire_record(mavlink.MAVLink_esc_status_message, __name__)

_SYSTEM = 5  # the byte of a frame that names its sender

Answer = tuple[bool, int, Forces, bool, bool, float]


@kernel
def put_answer(
    buffer: Bytes,
    payload: Bytes,
    sequence: int,
    system: int,
    component: int,
    time_us: int,
    forces: Row,
    armed: bool,
    lockstep: bool,
    gripper_open: bool,
    reel_rate: float,
) -> int:
    """Write HIL_ACTUATOR_CONTROLS at the beginning of a buffer; returns its number of bytes. `forces`: 14, in
    N; `payload` is scratch of MAX_PAYLOAD_BYTES bytes."""
    values = hil_actuator_controls_values(
        time_us, forces_from_row(forces, 0), armed, lockstep, gripper_open, reel_rate
    )
    return put_frame(HIL_ACTUATOR_CONTROLS, values, payload, buffer, 0, Origin(sequence, system, component))


@kernel
def read_answer(datagram: bytes, system: int, payload: Bytes) -> Answer:
    """Whether a datagram is exactly the plain frame of an answer of this system; and `time_us`, `forces` (N),
    `armed`, `gripper_open` and `reel_rate` of this answer."""
    is_plain = len(datagram) > 0 and frame_end(datagram, 0) == len(datagram)
    if not (
        is_plain and datagram[_SYSTEM] == system and match_frame(HIL_ACTUATOR_CONTROLS, datagram, 0, payload)
    ):
        return (False, 0, NO_FORCES, False, False, 0.0)
    controls = read_hil_actuator_controls(unpack_payload(HIL_ACTUATOR_CONTROLS, payload))
    return (
        True,
        controls.time_us,
        controls.forces,
        controls.armed,
        controls.gripper_open,
        controls.reel_rate,
    )
