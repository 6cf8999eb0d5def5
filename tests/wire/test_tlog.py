"""Telemetry logs: written here, read here and by pymavlink."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.tlog import TlogWriter, read_tlog, write_common

BOOT_US = 1_767_225_600_000_000  # 2026-01-01, as in lockstep flights
quick = settings(max_examples=100, deadline=None, derandomize=True)


def _records(count: int) -> list[tuple[int, bytes]]:
    autopilot, dialect = FrameWriter(1, 1), FrameWriter(1, 25)
    records = []
    for i in range(count):
        attitude = mavlink.MAVLink_attitude_message(i, 0.1 * i, 0.0, 0.0, 0.0, 0.0, 0.0)
        rotors = mavlink.MAVLink_rotor_state_message(i, [1.0, 2.0, 3.0, float(i)], 0.0, 1.96, 0, 2)
        records.append((BOOT_US + 4000 * i, autopilot.frame(attitude)))
        records.append((BOOT_US + 4000 * i, dialect.frame(rotors)))
    return records


def _written(records: list[tuple[int, bytes]]) -> bytes:
    file = io.BytesIO()
    writer = TlogWriter(file)
    for unix_us, frame in records:
        writer.write(unix_us, frame)
    return file.getvalue()


def _read(data: bytes) -> list[tuple[int, bytes]]:
    return [(unix_us, received.frame) for unix_us, received in read_tlog(io.BytesIO(data))]


def test_what_was_written_is_read(tmp_path: Path) -> None:
    records = _records(2000)  # more than the reader takes in at once
    path = tmp_path / "flight.tlog"
    path.write_bytes(_written(records))
    for source in (path, str(path)):
        assert [(unix_us, received.frame) for unix_us, received in read_tlog(source)] == records


def test_a_record_is_a_big_endian_time_and_the_frame() -> None:
    ((unix_us, frame), *_) = records = _records(1)
    assert _written(records)[: 8 + len(frame)] == unix_us.to_bytes(8, "big") + frame


@given(st.integers(0, 300))
@quick
def test_a_cut_end_loses_one_record(cut: int) -> None:
    records = _records(4)
    data = _written(records)
    whole, size = [], 0
    for unix_us, frame in records:
        size += 8 + len(frame)
        if size <= len(data) - cut:
            whole.append((unix_us, frame))
    assert _read(data[: max(0, len(data) - cut)]) == whole


@given(st.binary(max_size=2000))
@quick
def test_rubbish_is_no_log(data: bytes) -> None:
    _read(data)


def test_a_damaged_record_is_stepped_over() -> None:
    records = _records(3)
    damaged = bytearray(_written(records))
    damaged[8 + 10] ^= 0xFF  # the payload of the first frame
    assert _read(bytes(damaged)) == records[1:]


def test_an_unknown_message_is_stepped_over() -> None:
    records = _records(1)
    strange = bytes((0xFD, 4, 0, 0, 0, 1, 1, 0x27, 0xEB, 0)) + b"abcd\x12\x34"
    assert _read(_written([records[0], (BOOT_US, strange), records[1]])) == records


def test_an_empty_log_is_empty() -> None:
    assert _read(b"") == []


@pytest.fixture
def mavutil(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setenv("MAVLINK20", "1")
    from pymavlink import mavutil

    before = dict(os.environ), mavutil.mavlink, mavutil.current_dialect
    yield mavutil
    mavutil.mavlink, mavutil.current_dialect = before[1], before[2]


def test_pymavlink_reads_it(tmp_path: Path, mavutil: Any) -> None:
    records = _records(50)
    path = tmp_path / "flight.tlog"
    path.write_bytes(_written(records))
    mavutil.set_dialect("common")
    log = mavutil.mavlink_connection(str(path))
    seen = [(m._timestamp, m.roll) for m in iter(lambda: log.recv_match(type="ATTITUDE"), None)]
    assert [when for when, _ in seen] == [unix_us * 1e-6 for unix_us, _ in records[::2]]
    # float32 of the angle
    assert [roll for _, roll in seen] == pytest.approx([0.1 * i for i in range(50)], rel=1e-7)


def test_pymavlink_with_our_dialect_reads_our_messages(tmp_path: Path, mavutil: Any) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(_written(_records(50)))
    mavutil.mavlink = mavlink
    log = mavutil.mavlink_connection(str(path))
    seen = [m.force[3] for m in iter(lambda: log.recv_match(type="ROTOR_STATE"), None)]
    assert seen == [float(i) for i in range(50)]


def test_a_log_for_common_tools_is_the_same_without_the_dialect(tmp_path: Path) -> None:
    writer = FrameWriter(1, 1)
    ours = mavlink.MAVLink_rotor_state_message(1, [0.0] * 4, 0.0, 1.96, 0, 2)
    known = mavlink.MAVLink_attitude_message(1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    whole, common = tmp_path / "flight.tlog", tmp_path / "flight.common.tlog"
    with whole.open("wb") as file:
        log = TlogWriter(file)
        for unix_us in range(3):
            log.write(unix_us, writer.frame(known), writer.frame(ours))
    write_common(whole, common)
    records = [
        (unix_us, one.frame) for unix_us, one in read_tlog(whole) if one.message.get_type() == "ATTITUDE"
    ]
    assert [(unix_us, one.frame) for unix_us, one in read_tlog(common)] == records and len(records) == 3
