"""The frames of the streams that are sent most often, in machine code, from an instant's row of numbers.

The bytes are those that `FrameWriter` makes of the same streams of `telemetry`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from autopilot.geometry.entry import entry_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import Row, unpack
from autopilot.services.instant import (
    Instant,
    attitude_of,
    attitude_quaternion_of,
    cascade_errors_of,
    load_setpoint_of,
    load_state_of,
    local_position_ned_of,
    rotor_state_of,
)
from autopilot.wire.codec import FrameWriter
from autopilot.wire.compiled import FRAME_ROOM, PAYLOAD_ROOM, Bytes, Origin, put_frame, wire_record
from autopilot.wire.dialect import plumbline as mavlink

ATTITUDE = wire_record(mavlink.MAVLink_attitude_message, __name__)
ATTITUDE_QUATERNION = wire_record(mavlink.MAVLink_attitude_quaternion_message, __name__)
LOCAL_POSITION_NED = wire_record(mavlink.MAVLink_local_position_ned_message, __name__)
LOAD_STATE = wire_record(mavlink.MAVLink_load_state_message, __name__)
LOAD_SETPOINT = wire_record(mavlink.MAVLink_load_setpoint_message, __name__)
CASCADE_ERRORS = wire_record(mavlink.MAVLink_cascade_errors_message, __name__)
ROTOR_STATE = wire_record(mavlink.MAVLink_rotor_state_message, __name__)

# a set of these streams is the sum of their bits, which rise in the order in which they are sent
BITS = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 1,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 2,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 4,
    mavlink.MAVLINK_MSG_ID_LOAD_STATE: 8,
    mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT: 16,
    mavlink.MAVLINK_MSG_ID_CASCADE_ERRORS: 32,
    mavlink.MAVLINK_MSG_ID_ROTOR_STATE: 64,
}
_OF_AUTOPILOT = 1 | 2 | 4  # the others leave from the component of the dialect

# a set of streams that are written together, or the keys of streams that are not written here
Part = int | tuple[int, ...]


@lru_cache(maxsize=256)
def parts_of(keys: tuple[int, ...]) -> tuple[Part, ...]:
    """Streams in the order in which they are sent, those together that are written together."""
    parts: list[Part] = []
    last: Part = 0
    for key in keys:
        bit = BITS.get(key, 0)
        if not bit:
            if isinstance(last, tuple):
                parts.pop()
            last = (*last, key) if isinstance(last, tuple) else (key,)
        elif isinstance(last, int) and 0 < last < bit:
            parts.pop()
            last |= bit
        else:
            last = bit
        parts.append(last)
    return tuple(parts)


@kernel
def put_streams(
    streams: int,
    instant: Row,
    system: int,
    component: int,
    sequence: int,
    dialect_component: int,
    dialect_sequence: int,
    payload: Bytes,
    buffer: Bytes,
) -> int:
    """Write the frames of a set of streams (`BITS`) at the begin of a buffer; how many bytes they have.

    `instant` is a packed `Instant`; sequence numbers are those of the first frame of each component.
    """
    s = unpack(Instant, instant, 0)
    at = 0
    if streams & 1:
        origin = Origin(sequence, system, component)
        at = put_frame(ATTITUDE, attitude_of(s), payload, buffer, at, origin)
        sequence += 1
    if streams & 2:
        origin = Origin(sequence, system, component)
        at = put_frame(ATTITUDE_QUATERNION, attitude_quaternion_of(s), payload, buffer, at, origin)
        sequence += 1
    if streams & 4:
        origin = Origin(sequence, system, component)
        at = put_frame(LOCAL_POSITION_NED, local_position_ned_of(s), payload, buffer, at, origin)
    if streams & 8:
        origin = Origin(dialect_sequence, system, dialect_component)
        at = put_frame(LOAD_STATE, load_state_of(s), payload, buffer, at, origin)
        dialect_sequence += 1
    if streams & 16:
        origin = Origin(dialect_sequence, system, dialect_component)
        at = put_frame(LOAD_SETPOINT, load_setpoint_of(s), payload, buffer, at, origin)
        dialect_sequence += 1
    if streams & 32:
        origin = Origin(dialect_sequence, system, dialect_component)
        at = put_frame(CASCADE_ERRORS, cascade_errors_of(s), payload, buffer, at, origin)
        dialect_sequence += 1
    if streams & 64:
        origin = Origin(dialect_sequence, system, dialect_component)
        at = put_frame(ROTOR_STATE, rotor_state_of(s), payload, buffer, at, origin)
    return at


class StreamFrames:
    """Makes the frames of these streams on one link, in the sequences of its two components."""

    def __init__(self, autopilot: FrameWriter, dialect: FrameWriter) -> None:
        self._autopilot = autopilot
        self._dialect = dialect
        self._payload = np.zeros(PAYLOAD_ROOM, np.uint8)
        self._buffer = np.zeros(len(BITS) * FRAME_ROOM, np.uint8)
        self._written = memoryview(self._buffer)
        self._put: Callable[..., int] | None = None  # the machine code, once it was asked for

    def frames(self, streams: int, instant: Row) -> bytes:
        """The frames of a set of streams (`BITS`), one behind the other."""
        autopilot, dialect = self._autopilot, self._dialect
        arguments = (
            *(streams, instant, autopilot.system, autopilot.component, autopilot.sequence),
            *(dialect.component, dialect.sequence, self._payload, self._buffer),
        )
        if self._put is None:
            self._put = entry_of(put_streams, *arguments)
        end = self._put(*arguments)
        autopilot.sequence = (autopilot.sequence + (streams & _OF_AUTOPILOT).bit_count()) & 0xFF
        dialect.sequence = (dialect.sequence + (streams & ~_OF_AUTOPILOT).bit_count()) & 0xFF
        return self._written[:end].tobytes()
