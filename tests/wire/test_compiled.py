"""Frames in machine code are those of pymavlink, byte for byte, and no received bytes harm them."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from autopilot.geometry.kernel import kernel
from autopilot.wire import simulator_frames as frames
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.compiled import (
    MAX_FRAME_BYTES,
    MAX_PAYLOAD_BYTES,
    Bytes,
    Origin,
    frame_end,
    match_frame,
    put_frame,
    unpack_payload,
    wire_record,
)
from autopilot.wire.convert.simulator import read_hil_actuator_controls
from autopilot.wire.dialect import plumbline as mavlink
from tests.doubles.messages import hil_actuator_controls_message

KINDS = (
    "HIL_SENSOR",
    "ODOMETRY",
    "LOAD_SENSOR",
    "HIL_GPS",
    "HIL_ACTUATOR_CONTROLS",
    "HIL_STATE_QUATERNION",
    "LOAD_STATE",
    "ROTOR_STATE",
)
RANGES = {
    "uint64_t": (0, 2**53),
    "uint32_t": (0, 2**32 - 1),
    "int32_t": (-(2**31), 2**31 - 1),
    "uint16_t": (0, 2**16 - 1),
    "int16_t": (-(2**15), 2**15 - 1),
    "uint8_t": (0, 255),
    "int8_t": (-128, 127),
}
SENSOR, CONTROLS = frames.HIL_SENSOR, frames.HIL_ACTUATOR_CONTROLS
quick = settings(max_examples=60, deadline=None, derandomize=True)


def class_of(kind: str) -> Any:
    return getattr(mavlink, f"MAVLink_{kind.lower()}_message")


@cache
def numbers_of(kind: str) -> st.SearchStrategy[tuple[list[Any], Any]]:
    """The numbers of a message in the order of the wire, and pymavlink's object of them."""
    message_type = class_of(kind)
    types = dict(zip(message_type.fieldnames, message_type.fieldtypes, strict=True))
    lengths = message_type.array_lengths
    parts = []
    for name, length in zip(message_type.ordered_fieldnames, lengths, strict=True):
        one = st.floats(width=32) if types[name] == "float" else st.integers(*RANGES[types[name]])
        parts.append(st.lists(st.just(0) | one, min_size=max(length, 1), max_size=max(length, 1)))

    def both(fields: list[list[Any]]) -> tuple[list[Any], Any]:
        given_fields = [field if n else field[0] for field, n in zip(fields, lengths, strict=True)]
        message = message_type(*(given_fields[place] for place in message_type.orders))
        return [number for field in fields for number in field], message

    return st.tuples(*parts).map(both)


@kernel
def put_sensor(values: Any, payload: Bytes, buffer: Bytes, at: int, sequence: int) -> int:
    return put_frame(SENSOR, values, payload, buffer, at, Origin(sequence, 1, 26))


@kernel
def sensor_in(data: bytes, start: int, payload: Bytes) -> tuple[int, bool, int, float]:
    end = frame_end(data, start)
    if end == 0 or not match_frame(SENSOR, data, start, payload):
        return (end, False, 0, 0.0)
    message = unpack_payload(SENSOR, payload)
    return (end, True, message.time_usec, message.zgyro)


def same(one: Any, other: Any) -> bool:
    return one == other or (math.isnan(one) and math.isnan(other))


@pytest.mark.parametrize("kind", KINDS)
@given(data=st.data(), sequence=st.integers(0, 255))
@quick
def test_a_frame_is_that_of_pymavlink_and_its_record_comes_back(
    kind: str, data: st.DataObject, sequence: int
) -> None:
    numbers, message = data.draw(numbers_of(kind))
    record = getattr(frames, kind)
    payload, buffer = np.full(MAX_PAYLOAD_BYTES, 0xAA, np.uint8), np.full(2 * MAX_FRAME_BYTES, 0xAA, np.uint8)
    end = put_frame(record, tuple(numbers), payload, buffer, 7, Origin(sequence, 1, 26))
    frame = bytes(buffer[7:end])
    link = mavlink.MAVLink(None, srcSystem=1, srcComponent=26)
    link.seq = sequence
    assert frame == message.pack(link)
    assert (bytes(buffer[:7]), buffer[end]) == (b"\xaa" * 7, 0xAA)

    padded = b"#" + frame + b"\xfd"
    assert frame_end(padded, 1) == 1 + len(frame)
    assert match_frame(record, padded, 1, payload)
    read = unpack_payload(record, payload)
    for name in message.ordered_fieldnames:
        found, sent = getattr(read, name), getattr(message, name)
        pairs = zip(found, sent, strict=True) if isinstance(sent, list) else ((found, sent),)
        assert all(same(one, other) for one, other in pairs), name


@given(numbers_of("HIL_SENSOR"), st.integers(0, 255))
@quick
def test_machine_code_writes_and_reads_what_python_does(made: tuple[list[Any], Any], sequence: int) -> None:
    numbers, message = made
    values = (int(numbers[0]), *map(float, numbers[1:-2]), int(numbers[-2]), int(numbers[-1]))
    payload, buffer = np.zeros(MAX_PAYLOAD_BYTES, np.uint8), np.zeros(MAX_FRAME_BYTES, np.uint8)
    end = put_sensor(values, payload, buffer, 0, sequence)
    writer = FrameWriter(1, 26)
    writer.sequence = sequence
    frame = writer.frame(message)
    assert bytes(buffer[:end]) == frame
    found = sensor_in(frame, 0, payload)
    assert found[:3] == (end, True, message.time_usec)
    assert same(found[3], message.zgyro)


def test_a_number_beyond_single_precision_is_sent_as_infinite() -> None:
    payload, buffer = np.zeros(MAX_PAYLOAD_BYTES, np.uint8), np.zeros(MAX_FRAME_BYTES, np.uint8)
    end = put_sensor((1, 1e300, -1e300, *(0.0,) * 11, 0, 0), payload, buffer, 0, 0)
    message = decode(bytes(buffer[:end]))[0][0].message
    assert (message.xacc, message.yacc) == (math.inf, -math.inf)


def test_times_of_64_bits_are_read_as_negative_and_do_not_raise() -> None:
    frame = FrameWriter(1, 1).frame(mavlink.MAVLink_hil_sensor_message(2**64 - 1, *(0.0,) * 13, 0))
    assert sensor_in(frame, 0, np.zeros(MAX_PAYLOAD_BYTES, np.uint8))[:3] == (len(frame), True, -1)


SENSOR_FRAME = FrameWriter(1, 26).frame(mavlink.MAVLink_hil_sensor_message(4000, *range(1, 14), 63))
BARE = FrameWriter(1, 26).frame(mavlink.MAVLink_hil_sensor_message(0, *(0.0,) * 13, 0))


@given(
    datagram=st.binary(max_size=120) | st.binary(max_size=40).map(lambda tail: SENSOR_FRAME + tail),
    at=st.integers(0, 140),
    to=st.integers(0, 255),
    start=st.integers(0, 130),
)
@example(datagram=BARE, at=200, to=0, start=0)
@example(datagram=b"\xfd\xff", at=200, to=0, start=0)
@settings(max_examples=400, deadline=None, derandomize=True)
def test_what_is_found_in_any_bytes_is_what_the_general_decoder_finds(
    datagram: bytes, at: int, to: int, start: int
) -> None:
    bytes_in = bytearray(datagram)
    if at < len(bytes_in):
        bytes_in[at] = to
    data, payload = bytes(bytes_in), np.zeros(MAX_PAYLOAD_BYTES, np.uint8)
    first = start % (len(data) + 1)
    end, found, _, _ = sensor_in(data, first, payload)
    assert 0 <= end <= len(data)
    plain = [
        one
        for one in decode(data[first:end])[0]
        if one.frame == data[first:end] and one.message.get_type() == "HIL_SENSOR"
    ]
    assert found == bool(plain)


def test_a_signed_frame_and_one_of_version_1_are_left_to_the_general_decoder() -> None:
    signed = bytearray(SENSOR_FRAME)
    signed[2] = 1
    assert frame_end(bytes(signed) + bytes(13), 0) == 0
    assert frame_end(b"\xfe" + SENSOR_FRAME[1:], 0) == 0


def test_a_text_is_written_as_the_numbers_of_its_bytes() -> None:
    record = wire_record(mavlink.MAVLink_named_value_float_message, __name__)
    payload, buffer = np.zeros(MAX_PAYLOAD_BYTES, np.uint8), np.zeros(MAX_FRAME_BYTES, np.uint8)
    name = tuple(b"SWING".ljust(10, b"\0"))
    end = put_frame(record, (7, 0.5, *name), payload, buffer, 0, Origin(3, 1, 1))
    link = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    link.seq = 3
    assert bytes(buffer[:end]) == mavlink.MAVLink_named_value_float_message(7, b"SWING", 0.5).pack(link)
    assert match_frame(record, bytes(buffer[:end]), 0, payload)
    assert unpack_payload(record, payload).name == name


# ---- the answer to a tick


@given(
    st.tuples(
        *(st.integers(0, 2**53), st.tuples(*(st.floats(width=32, allow_nan=False),) * 14)),
        *(st.booleans(), st.booleans(), st.booleans(), st.floats(-2.0, 2.0)),
    ),
    st.integers(0, 255),
)
@quick
def test_the_answer_is_the_message_and_is_read_as_the_message(answer: Any, sequence: int) -> None:
    time_us, forces, armed, lockstep, gripper_open, reel_rate = answer
    payload, buffer = np.zeros(MAX_PAYLOAD_BYTES, np.uint8), np.zeros(MAX_FRAME_BYTES, np.uint8)
    asked = (armed, lockstep, gripper_open, reel_rate)
    end = frames.put_answer(buffer, payload, sequence, 1, 1, time_us, np.array(forces), *asked)
    writer = FrameWriter(1, 1)
    writer.sequence = sequence
    frame = writer.frame(hil_actuator_controls_message(*answer))
    assert bytes(buffer[:end]) == frame
    said = read_hil_actuator_controls(decode(frame)[0][0].message)
    read = (said.time_us, said.forces, said.armed, said.gripper_open, said.reel_rate)
    assert frames.read_answer(frame, 1, payload) == (True, *read)


@pytest.mark.parametrize(
    "datagram",
    [b"", b"\xfd", SENSOR_FRAME, b"#" * 60],
    ids=["nothing", "a begin", "another message", "rubbish"],
)
def test_what_is_no_answer_is_none(datagram: bytes) -> None:
    assert not frames.read_answer(datagram, 1, np.zeros(MAX_PAYLOAD_BYTES, np.uint8))[0]


def test_an_answer_of_another_system_or_beside_another_frame_is_left_to_the_general_decoder() -> None:
    frame = FrameWriter(2, 1).frame(hil_actuator_controls_message(0, (1.0,) * 14, True, True))
    payload = np.zeros(MAX_PAYLOAD_BYTES, np.uint8)
    assert frames.read_answer(frame, 2, payload)[0]
    assert not frames.read_answer(frame, 1, payload)[0]
    assert not frames.read_answer(frame + frame, 2, payload)[0]
