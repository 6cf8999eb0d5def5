"""Columns are what pymavlink reads from the same frames, for every message of the dialect."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.columns import Columns

COUNT = 7


def frames_of(message_id: int, rng: np.random.Generator) -> tuple[list[bytes], list[object]]:
    """Frames of random payloads, often shortened as if they ended in zeros, and what pymavlink reads."""
    kind = mavlink.mavlink_map[message_id]
    link = mavlink.MAVLink(None)
    frames = []
    for sequence in range(COUNT):
        payload = rng.bytes(int(rng.integers(1, kind.unpacker.size + 1)))
        payload = payload.rstrip(b"\0") or b"\0"
        frame = bytes((0xFD, len(payload), 0, 0, sequence, 1, 1)) + message_id.to_bytes(3, "little") + payload
        check = mavlink.x25crc(frame[1:] + bytes((kind.crc_extra,))).crc
        frames.append(frame + check.to_bytes(2, "little"))
    return frames, [link.decode(bytearray(frame)) for frame in frames]


@pytest.mark.parametrize("message_id", sorted(mavlink.mavlink_map))
def test_every_field_is_read_as_pymavlink_reads_it(message_id: int) -> None:
    frames, messages = frames_of(message_id, np.random.default_rng(message_id))
    kind = mavlink.mavlink_map[message_id]
    columns = Columns(message_id, frames)
    for name, type_name in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        if type_name == "char":
            continue
        expected = np.array([getattr(message, name) for message in messages], dtype=np.float64)
        np.testing.assert_array_equal(columns[name], expected)
        if "int" in type_name and "64" not in type_name:
            np.testing.assert_array_equal(columns.integers(name), expected.astype(np.int64))


def test_several_fields_stand_side_by_side() -> None:
    message_id = mavlink.MAVLINK_MSG_ID_LOAD_STATE
    columns = Columns(message_id, frames_of(message_id, np.random.default_rng(1))[0])
    np.testing.assert_array_equal(columns["x y z"], np.stack([columns[n] for n in "xyz"], axis=-1))


def test_no_frames_are_empty_columns() -> None:
    columns = Columns(mavlink.MAVLINK_MSG_ID_CASCADE_ERRORS, [])
    assert columns["psi_r"].shape == (0,) and columns["e_x"].shape == (0, 3)
