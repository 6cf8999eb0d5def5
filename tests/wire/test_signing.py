"""Signatures: pymavlink is the reference both ways; wrong, old or unsigned frames are not accepted."""

from __future__ import annotations

import hashlib
import os
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.signing import MAX_TIMESTAMP, UNITS_PER_S, NoKeyError, Signing, key_of_text, timestamp_of

KEY = bytes(range(32))
NOW = timestamp_of(1_767_225_600_000_000)


def frame(signing: Signing, link_id: int = 3, seq: int = 1) -> bytes:
    return FrameWriter(255, 190).frame(
        m.MAVLink_mission_set_current_message(1, 1, seq), signing.signer(link_id)
    )


def accepts(signing: Signing, data: bytes) -> bool:
    (received,), junk = decode(data)
    assert junk == 0
    return signing.accepts(received.frame, received.message.get_msgId(), received.system, received.component)


def pymavlink(key: bytes = KEY, timestamp: int = NOW) -> Any:
    link = m.MAVLink(None, srcSystem=255, srcComponent=190)
    link.signing.secret_key = key
    link.signing.timestamp = timestamp
    link.signing.link_id = 3
    link.signing.sign_outgoing = True
    return link


def test_frames_are_those_of_pymavlink() -> None:
    ours = frame(Signing(KEY, NOW - 1))
    theirs = m.MAVLink_mission_set_current_message(1, 1, 1).pack(pymavlink())
    assert ours == bytes(theirs)


def test_pymavlink_hears_us_and_nobody_else() -> None:
    signing = Signing(KEY, NOW)
    reader = pymavlink()
    heard = reader.parse_buffer(bytearray(frame(signing)))
    assert [message.get_signed() for message in heard] == [True]
    reader = pymavlink(os.urandom(32))
    reader.robust_parsing = True
    assert all(message.get_type() == "BAD_DATA" for message in reader.parse_buffer(bytearray(frame(signing))))


def test_we_hear_pymavlink() -> None:
    link = pymavlink()
    ours = Signing(KEY, NOW)
    for seq in range(3):
        assert accepts(ours, bytes(m.MAVLink_mission_set_current_message(1, 1, seq).pack(link)))


def test_a_frame_is_heard_once_and_none_before_it() -> None:
    sender, receiver = Signing(KEY, NOW), Signing(KEY, NOW)
    first, second = frame(sender), frame(sender)
    assert accepts(receiver, second)
    assert not accepts(receiver, second)
    assert not accepts(receiver, first)
    assert accepts(receiver, frame(sender, link_id=4))


def test_a_new_sender_may_be_a_minute_behind() -> None:
    for behind_s, heard in ((0, True), (59, True), (61, False), (1e6, False)):
        sender = Signing(KEY, NOW - round(behind_s * UNITS_PER_S))
        assert accepts(Signing(KEY, NOW), frame(sender)) is heard


def test_times_follow_whoever_is_ahead() -> None:
    receiver = Signing(KEY, NOW)
    assert accepts(receiver, frame(Signing(KEY, NOW + 1_000_000)))
    assert receiver.timestamp == NOW + 1_000_001
    receiver.advance(NOW)
    assert receiver.timestamp == NOW + 1_000_001
    at_the_end = Signing(KEY, MAX_TIMESTAMP)
    assert len(frame(at_the_end)) == len(frame(Signing(KEY, NOW)))


def test_unsigned_only_what_changes_nothing() -> None:
    signing = Signing(KEY, NOW)
    writer = FrameWriter(255, 190)
    heartbeat = m.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    radio = m.MAVLink_radio_status_message(0, 0, 0, 0, 0, 0, 0)
    assert accepts(signing, writer.frame(heartbeat))
    assert accepts(signing, writer.frame(radio))
    for message in (
        m.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
        m.MAVLink_param_request_list_message(1, 1),
        m.MAVLink_setup_signing_message(1, 1, list(KEY), 0),
        m.MAVLink_file_transfer_protocol_message(0, 1, 1, [0] * 251),
    ):
        assert not accepts(signing, writer.frame(message))
    assert not accepts(signing, bytes(heartbeat.pack(pymavlink(os.urandom(32)))))  # signed wrongly


@given(place=st.integers(0, 100), flip=st.integers(1, 255))
def test_no_changed_byte_is_heard(place: int, flip: int) -> None:
    good = frame(Signing(KEY, NOW))
    bad = bytearray(good)
    bad[place % len(bad)] ^= flip
    for received in decode(bytes(bad))[0]:
        assert not Signing(KEY, NOW).accepts(received.frame, 41, received.system, received.component)


def test_senders_are_not_remembered_without_end() -> None:
    receiver = Signing(KEY, NOW)
    sender = Signing(KEY, NOW)
    heard = [accepts(receiver, frame(sender, link_id=i)) for i in range(256)]
    assert all(heard)
    other = FrameWriter(254, 190).frame(m.MAVLink_mission_set_current_message(1, 1, 1), sender.signer(0))
    assert not accepts(receiver, other)


def test_keys_in_files() -> None:
    assert key_of_text("00" * 31 + "ff\n") == bytes(31) + b"\xff"
    assert key_of_text(" correct horse\n") == hashlib.sha256(b"correct horse").digest()
    for bad in ("", "  \n", "two\nlines"):
        with pytest.raises(NoKeyError):
            key_of_text(bad)
    with pytest.raises(ValueError, match="must be 32"):
        Signing(b"short")
