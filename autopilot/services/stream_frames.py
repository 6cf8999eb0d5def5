"""The frames of the streams that are sent most often, in machine code, from the row of an instant.

The bytes are those that `FrameWriter` writes for the same streams of `telemetry`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import isnan
from typing import Any

import numpy as np

from autopilot.geometry.entry import entry_point_of, kernel_address_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3
from autopilot.geometry.packed import Row, packed, unpack
from autopilot.services.instant import (
    DEBUG_VECTORS,
    NAMED_VALUES,
    Instant,
    altitude_of,
    attitude_of,
    attitude_quaternion_of,
    attitude_target_of,
    cascade_errors_of,
    debug_vectors_of,
    global_position_int_of,
    load_setpoint_of,
    load_state_of,
    local_position_ned_of,
    named_values_of,
    position_target_local_ned_of,
    rotor_state_of,
    servo_output_raw_of,
    vfr_hud_of,
)
from autopilot.wire.codec import FrameWriter
from autopilot.wire.compiled import MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES, Bytes, Origin, put_frame, wire_record
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.telemetry import boot_ms
from autopilot.wire.dialect import plumbline as mavlink

ATTITUDE = wire_record(mavlink.MAVLink_attitude_message, __name__)
ATTITUDE_QUATERNION = wire_record(mavlink.MAVLink_attitude_quaternion_message, __name__)
LOCAL_POSITION_NED = wire_record(mavlink.MAVLink_local_position_ned_message, __name__)
GLOBAL_POSITION_INT = wire_record(mavlink.MAVLink_global_position_int_message, __name__)
ALTITUDE = wire_record(mavlink.MAVLink_altitude_message, __name__)
VFR_HUD = wire_record(mavlink.MAVLink_vfr_hud_message, __name__)
POSITION_TARGET_LOCAL_NED = wire_record(mavlink.MAVLink_position_target_local_ned_message, __name__)
ATTITUDE_TARGET = wire_record(mavlink.MAVLink_attitude_target_message, __name__)
SERVO_OUTPUT_RAW = wire_record(mavlink.MAVLink_servo_output_raw_message, __name__)
DEBUG_VECT = wire_record(mavlink.MAVLink_debug_vect_message, __name__)
NAMED_VALUE_FLOAT = wire_record(mavlink.MAVLink_named_value_float_message, __name__)
LOAD_STATE = wire_record(mavlink.MAVLink_load_state_message, __name__)
LOAD_SETPOINT = wire_record(mavlink.MAVLink_load_setpoint_message, __name__)
CASCADE_ERRORS = wire_record(mavlink.MAVLink_cascade_errors_message, __name__)
ROTOR_STATE = wire_record(mavlink.MAVLink_rotor_state_message, __name__)

# a set of these streams is the sum of their bits, which increase in the order of sending
_COMPILED_STREAMS = (
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_ALTITUDE,
    mavlink.MAVLINK_MSG_ID_VFR_HUD,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
    mavlink.MAVLINK_MSG_ID_DEBUG_VECT,
    mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
    mavlink.MAVLINK_MSG_ID_LOAD_STATE,  # from here on they are sent from the component of the dialect
    mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT,
    mavlink.MAVLINK_MSG_ID_CASCADE_ERRORS,
    mavlink.MAVLINK_MSG_ID_ROTOR_STATE,
)
BITS = {key: 1 << i for i, key in enumerate(_COMPILED_STREAMS)}
_MAX_FRAMES = len(BITS) + len(DEBUG_VECTORS) + len(NAMED_VALUES)
MAX_STREAMS_BYTES = _MAX_FRAMES * MAX_FRAME_BYTES  # bytes that hold all of them


def _name(name: bytes) -> tuple[int, ...]:
    return tuple(name.ljust(10, b"\0"))


_POSITION, _VELOCITY, _CABLE, _ERROR = (_name(name) for name in DEBUG_VECTORS)
_TENSION, _SWING, _DISTANCE, _PSI_R, _PSI_Q = (_name(name) for name in NAMED_VALUES)

# a set of streams that are written together, or the keys of streams that are not written by this module
StreamGroup = int | tuple[int, ...]


@lru_cache(maxsize=256)
def stream_groups(keys: tuple[int, ...]) -> tuple[StreamGroup, ...]:
    """Streams in the order of sending, grouped into those that are written together."""
    groups: list[StreamGroup] = []
    last: StreamGroup = 0
    for key in keys:
        bit = BITS.get(key, 0)
        if not bit:
            if isinstance(last, tuple):
                groups.pop()
            last = (*last, key) if isinstance(last, tuple) else (key,)
        elif isinstance(last, int) and 0 < last < bit:
            groups.pop()
            last |= bit
        else:
            last = bit
        groups.append(last)
    return tuple(groups)


@kernel
def _put(
    kind: Any, values: Any, payload: Bytes, buffer: Bytes, at: int, origin: Origin
) -> tuple[int, Origin]:
    """Write a frame; return where the next one begins, and its origin."""
    end = put_frame(kind, values, payload, buffer, at, origin)
    return end, Origin(origin.sequence + 1, origin.system, origin.component)


@kernel
def _put_vector(
    now_us: int, vector: Vec3, name: Any, payload: Bytes, buffer: Bytes, at: int, origin: Origin
) -> tuple[int, Origin]:
    return _put(DEBUG_VECT, (now_us, *vector, *name), payload, buffer, at, origin)


@kernel
def _put_value(
    now_us: int, value: float, name: Any, payload: Bytes, buffer: Bytes, at: int, origin: Origin
) -> tuple[int, Origin]:
    return _put(NAMED_VALUE_FLOAT, (boot_ms(now_us), value, *name), payload, buffer, at, origin)


@kernel
def put_streams(
    streams: int,
    instant: Row,
    home: Row,
    system: int,
    component: int,
    sequence: int,
    dialect_component: int,
    dialect_sequence: int,
    payload: Bytes,
    buffer: Bytes,
) -> tuple[int, int, int]:
    """Write the frames of a set of streams (`BITS`) to the beginning of a buffer.

    `instant` is a packed `Instant`, `home` a packed `Home`; sequence numbers are those of the first frame of
    each component. Returns the number of bytes, and the sequence numbers of the next frames.
    """
    s, home_record = unpack(Instant, instant, 0), unpack(Home, home, 0)
    at = 0
    origin = Origin(sequence, system, component)
    if streams & 1:
        at, origin = _put(ATTITUDE, attitude_of(s), payload, buffer, at, origin)
    if streams & 2:
        at, origin = _put(ATTITUDE_QUATERNION, attitude_quaternion_of(s), payload, buffer, at, origin)
    if streams & 4:
        at, origin = _put(LOCAL_POSITION_NED, local_position_ned_of(s), payload, buffer, at, origin)
    if streams & 8:
        at, origin = _put(
            GLOBAL_POSITION_INT, global_position_int_of(s, home_record), payload, buffer, at, origin
        )
    if streams & 16:
        at, origin = _put(ALTITUDE, altitude_of(s, home_record), payload, buffer, at, origin)
    if streams & 32:
        at, origin = _put(VFR_HUD, vfr_hud_of(s, home_record), payload, buffer, at, origin)
    if streams & 64 and not isnan(s.x_quad_d[0]):
        at, origin = _put(
            POSITION_TARGET_LOCAL_NED, position_target_local_ned_of(s), payload, buffer, at, origin
        )
    if streams & 128:
        at, origin = _put(ATTITUDE_TARGET, attitude_target_of(s), payload, buffer, at, origin)
    if streams & 256:
        at, origin = _put(SERVO_OUTPUT_RAW, servo_output_raw_of(s), payload, buffer, at, origin)
    if streams & 512:
        position, velocity, cable, error = debug_vectors_of(s)
        at, origin = _put_vector(s.now_us, position, _POSITION, payload, buffer, at, origin)
        at, origin = _put_vector(s.now_us, velocity, _VELOCITY, payload, buffer, at, origin)
        at, origin = _put_vector(s.now_us, cable, _CABLE, payload, buffer, at, origin)
        at, origin = _put_vector(s.now_us, error, _ERROR, payload, buffer, at, origin)
    if streams & 1024:
        tension, swing, distance, psi_r, psi_q = named_values_of(s)
        at, origin = _put_value(s.now_us, tension, _TENSION, payload, buffer, at, origin)
        at, origin = _put_value(s.now_us, swing, _SWING, payload, buffer, at, origin)
        at, origin = _put_value(s.now_us, distance, _DISTANCE, payload, buffer, at, origin)
        at, origin = _put_value(s.now_us, psi_r, _PSI_R, payload, buffer, at, origin)
        at, origin = _put_value(s.now_us, psi_q, _PSI_Q, payload, buffer, at, origin)
    own_sequence = origin.sequence
    origin = Origin(dialect_sequence, system, dialect_component)
    if streams & 2048:
        at, origin = _put(LOAD_STATE, load_state_of(s), payload, buffer, at, origin)
    if streams & 4096:
        at, origin = _put(LOAD_SETPOINT, load_setpoint_of(s), payload, buffer, at, origin)
    if streams & 8192:
        at, origin = _put(CASCADE_ERRORS, cascade_errors_of(s), payload, buffer, at, origin)
    if streams & 16384:
        at, origin = _put(ROTOR_STATE, rotor_state_of(s), payload, buffer, at, origin)
    return at, own_sequence & 0xFF, origin.sequence & 0xFF


def address_of_streams(instant: Row) -> int:
    """The address of `put_streams` for such an instant, compiled or loaded if necessary."""
    scratch = np.zeros(1, np.uint8)
    return kernel_address_of(put_streams, 0, instant, instant, 0, 0, 0, 0, 0, scratch, scratch)


class StreamFrames:
    """Writes the frames of these streams on one link, with the sequence numbers of its two components."""

    def __init__(self, autopilot: FrameWriter, dialect: FrameWriter, home: Home) -> None:
        self.autopilot = autopilot
        self.dialect = dialect
        self.home = packed(home)
        self.payload = np.zeros(MAX_PAYLOAD_BYTES, np.uint8)
        self._buffer = np.zeros(MAX_STREAMS_BYTES, np.uint8)
        self._buffer_view = self._buffer.data
        self._put: Callable[..., tuple[int, int, int]] | None = None  # machine code, after the first call

    def frames(self, streams: int, instant: Row) -> bytes:
        """The frames of a set of streams (`BITS`), one after the other."""
        autopilot, dialect = self.autopilot, self.dialect
        arguments = (
            *(streams, instant, self.home, autopilot.system, autopilot.component, autopilot.sequence),
            *(dialect.component, dialect.sequence, self.payload, self._buffer),
        )
        if self._put is None:
            self._put = entry_point_of(put_streams, *arguments)
        end, autopilot.sequence, dialect.sequence = self._put(*arguments)
        return self._buffer_view[:end].tobytes()
