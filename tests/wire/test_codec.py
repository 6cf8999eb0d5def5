"""The codec equals pymavlink's, byte for byte, and nothing that arrives can make it fail."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.wire.codec import MAX_FRAME_BYTES, FrameWriter, Received, decode
from autopilot.wire.convert.simulator import ACCEL, GYRO
from autopilot.wire.dialect import plumbline as mavlink
from tests.doubles.messages import hil_sensor_message

CLASSES = sorted(mavlink.mavlink_map.values(), key=lambda message_type: message_type.msgname)
SAMPLES = 12  # random messages of each class
HEARTBEAT = FrameWriter(1, 1).frame(mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3))
VECTOR = (1.0, 2.0, 3.0)
SENSOR = FrameWriter(1, 26).frame(
    hil_sensor_message(4000, VECTOR, VECTOR, VECTOR, 1e5, 12.0, 20.0, ACCEL | GYRO)
)

Sample = Callable[[Any, np.random.Generator], Any]
Fields = Callable[[Any], dict[str, Any]]
quick = settings(max_examples=200, deadline=None, derandomize=True)


def kinds(received: list[Received]) -> list[str]:
    return [one.message.get_type() for one in received]


def unknown_frame(message_id: int, payload: bytes) -> bytes:
    header = struct.pack(
        "<BBBBBBBHB", 0xFD, len(payload), 0, 0, 0, 1, 1, message_id & 0xFFFF, message_id >> 16
    )
    return header + payload + b"\x12\x34"


@pytest.mark.parametrize("message_type", CLASSES, ids=lambda message_type: message_type.msgname)
def test_every_message_is_written_and_read_as_pymavlink_does(
    message_type: Any, any_message: Sample, fields_of: Fields, reference: Callable[..., Any]
) -> None:
    rng = np.random.default_rng(message_type.id)
    ours, theirs = FrameWriter(1, 25), reference()
    for _ in range(SAMPLES):
        message = any_message(message_type, rng)
        frame = ours.frame(message)
        assert frame == message.pack(theirs)
        assert frame[0] == 0xFD
        theirs.seq = (theirs.seq + 1) % 256

        received, junk = decode(frame)
        assert (len(received), junk) == (1, 0)
        expected = reference().decode(bytearray(frame))
        one = received[0]
        assert fields_of(one.message) == fields_of(expected)
        assert type(one.message) is message_type
        assert one.message.get_header().__dict__ == expected.get_header().__dict__
        assert one.message.get_crc() == expected.get_crc()
        assert bytes(one.message.get_msgbuf()) == frame == one.frame
        assert (one.system, one.component, one.sequence) == (1, 25, frame[4])
        assert FrameWriter(1, 25).frame(one.message)[10:-2] == frame[10:-2]


@pytest.mark.parametrize("message_type", CLASSES, ids=lambda message_type: message_type.msgname)
def test_zeros_leave_one_byte_of_payload(message_type: Any, reference: Callable[..., Any]) -> None:
    lengths = dict(zip(message_type.ordered_fieldnames, message_type.array_lengths, strict=True))
    kinds_of = dict(zip(message_type.fieldnames, message_type.fieldtypes, strict=True))
    zeros = [
        b"" if kinds_of[name] == "char" else [0] * lengths[name] if lengths[name] else 0
        for name in message_type.fieldnames
    ]
    message = message_type(*zeros)
    frame = FrameWriter(1, 25).frame(message)
    assert frame == message.pack(reference())
    assert len(frame) == 13
    assert len(decode(frame)[0]) == 1


@given(st.sampled_from(CLASSES), st.integers(0, 2**32 - 1), st.integers(0, 255), st.integers(1, 255))
@quick
def test_any_message_of_any_sender(
    any_message: Sample,
    reference: Callable[..., Any],
    message_type: Any,
    seed: int,
    sequence: int,
    system: int,
) -> None:
    message = any_message(message_type, np.random.default_rng(seed))
    writer = FrameWriter(system, 7)
    writer.sequence = sequence
    frame = writer.frame(message)
    assert frame == message.pack(reference(system, 7, sequence))
    assert writer.sequence == (sequence + 1) % 256
    assert decode(frame)[0][0].sequence == sequence


def test_a_float_beyond_float32_is_sent_as_infinite() -> None:
    message = mavlink.MAVLink_rotor_state_message(0, [1e39, -1e300, 1.0, float("nan")], 0.0, 1.96, 0, 0)
    force = decode(FrameWriter(1, 25).frame(message))[0][0].message.force
    assert force[:3] == [float("inf"), float("-inf"), 1.0]
    assert force[3] != force[3]


def test_a_refused_message_takes_no_sequence_number() -> None:
    writer = FrameWriter(1, 1)
    with pytest.raises(struct.error):
        writer.frame(mavlink.MAVLink_mission_current_message(70000))
    assert writer.sequence == 0


def test_signed_frames_are_read_and_their_signature_ignored(reference: Callable[..., Any]) -> None:
    signing = reference()
    signing.signing.secret_key = bytes(range(32))
    signing.signing.sign_outgoing = True
    frame = mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3).pack(signing)
    assert len(frame) == 21 + 13
    received, junk = decode(HEARTBEAT + frame + SENSOR)
    assert (kinds(received), junk) == (["HEARTBEAT", "HEARTBEAT", "HIL_SENSOR"], 0)
    assert received[1].frame == frame


@pytest.mark.parametrize("message_type", [c for c in CLASSES if c.id < 256], ids=lambda c: c.msgname)
def test_mavlink_1_is_read(
    message_type: Any, any_message: Sample, fields_of: Fields, reference: Callable[..., Any]
) -> None:
    message = any_message(message_type, np.random.default_rng(1))
    frame = message.pack(reference(), force_mavlink1=True)
    assert frame[0] == 0xFE
    received, junk = decode(frame + HEARTBEAT)
    assert junk == 0
    assert len(received) == 2
    assert fields_of(received[0].message) == fields_of(reference().decode(bytearray(frame)))


def test_a_longer_payload_of_a_newer_dialect_is_read() -> None:
    message = mavlink.MAVLink_heartbeat_message(2, 12, 81, 7, 3, 3)
    payload = message.unpacker.pack(7, 2, 12, 81, 3, 3) + b"\x01\x02\x03"
    body = struct.pack("<BBBBBBHB", len(payload), 0, 0, 9, 1, 1, 0, 0) + payload
    crc = mavlink.x25crc(body + bytes((message.crc_extra,))).crc
    received, junk = decode(b"\xfd" + body + struct.pack("<H", crc))
    assert junk == 0
    assert received[0].message.custom_mode == 7


@given(st.binary(max_size=600))
@quick
def test_nothing_raises(datagram: bytes) -> None:
    received, junk = decode(datagram)
    assert junk + sum(len(one.frame) for one in received) == len(datagram)


NO_MAGIC = st.binary(max_size=40).map(lambda data: data.replace(b"\xfd", b"\0").replace(b"\xfe", b"\0"))


@given(NO_MAGIC, NO_MAGIC, NO_MAGIC)
@quick
def test_frames_between_rubbish_are_found(before: bytes, between: bytes, after: bytes) -> None:
    received, junk = decode(before + HEARTBEAT + between + SENSOR + after)
    assert kinds(received) == ["HEARTBEAT", "HIL_SENSOR"]
    assert junk == len(before + between + after)


@pytest.mark.parametrize(
    "rubbish", [b"\xfd", b"\xfd\xff", b"\xfe\xff", b"\xfd\x09\x00\x00", HEARTBEAT[:-1], b"\0" * 9]
)
def test_a_false_beginning_swallows_nothing(rubbish: bytes) -> None:
    received, junk = decode(rubbish + HEARTBEAT + SENSOR)
    assert (kinds(received), junk) == (["HEARTBEAT", "HIL_SENSOR"], len(rubbish))


@given(st.integers(0, len(SENSOR) * 8 - 1))
@quick
def test_a_flipped_bit_loses_that_frame_alone(bit: int) -> None:
    damaged = bytearray(SENSOR)
    damaged[bit // 8] ^= 1 << bit % 8
    received, _ = decode(HEARTBEAT + bytes(damaged) + HEARTBEAT)
    assert kinds(received) == ["HEARTBEAT", "HEARTBEAT"]


@given(st.integers(0, len(SENSOR) - 1))
@quick
def test_a_cut_frame_is_junk(length: int) -> None:
    received, junk = decode(HEARTBEAT + SENSOR[:length])
    assert (kinds(received), junk) == (["HEARTBEAT"], length)


@given(st.binary(max_size=255))
@quick
def test_an_unknown_id_is_stepped_over_whole(payload: bytes) -> None:
    frame = unknown_frame(60199, payload)
    received, junk = decode(HEARTBEAT + frame + SENSOR)
    assert (kinds(received), junk) == (["HEARTBEAT", "HIL_SENSOR"], len(frame))


def test_a_frame_inside_an_unknown_frame_is_not_read() -> None:
    frame = unknown_frame(60199, HEARTBEAT)
    assert decode(frame) == ([], len(frame))


def test_an_unknown_incompatibility_flag_is_refused() -> None:
    frame = bytearray(HEARTBEAT)
    frame[2] = 0x02
    crc = mavlink.x25crc(bytes(frame[1:-2]) + bytes((mavlink.MAVLink_heartbeat_message.crc_extra,))).crc
    frame[-2:] = struct.pack("<H", crc)
    received, junk = decode(bytes(frame))
    assert (received, junk) == ([], len(frame))


def test_no_frame_is_longer_than_it_says(any_message: Sample) -> None:
    rng = np.random.default_rng(0)
    writer = FrameWriter(1, 1)
    assert max(len(writer.frame(any_message(c, rng))) for c in CLASSES) <= MAX_FRAME_BYTES - 13


def test_the_search_for_messages_has_an_end_where_that_is_asked_for():
    good = FrameWriter(1, 1).frame(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))
    unknown = bytes((0xFD, 200, 0, 0, 0, 1, 1, 0xFF, 0xFF, 0xFF)) + bytes(202)
    for junk, found in ((b"\0" * 64, 2), (b"\0" * 65, 1), (b"\xfe" * 65, 1), (unknown * 3, 2)):
        received, rest = decode(good + junk + good, 64)
        assert len(received) == found
        assert rest == len(junk) + (2 - found) * len(good)
    assert len(decode(good + b"\xfe" * 500 + good)[0]) == 2
