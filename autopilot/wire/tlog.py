"""Telemetry logs: records of 8 bytes (big-endian microseconds since 1970) and one raw frame.

The format of MAVProxy, Mission Planner and QGroundControl; `pymavlink.mavutil.mavlink_connection` reads it.
"""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import BinaryIO

from autopilot.wire.codec import MAGICS, MAX_FRAME_BYTES, Received, announced_length, message_at
from autopilot.wire.dialect import plumbline as mavlink

_STAMP = struct.Struct(">Q")
_CHUNK = 1 << 16
_DIALECT_ID = mavlink.MAVLINK_MSG_ID_LOAD_STATE >> 8  # of every message of the dialect, 60100 ...


class TlogWriter:
    """Appends records to a binary file that the caller opens and closes."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def write(self, unix_us: int, *frames: bytes) -> None:
        """A record for each frame, all of the same time."""
        stamp = _STAMP.pack(unix_us)
        self._file.write(b"".join([stamp + frame for frame in frames]))


def write_common(source: Path, target: Path) -> None:
    """Copy a log without the messages of the private dialect, at which some tools stop."""
    with target.open("wb") as file:
        writer = TlogWriter(file)
        for unix_us, received in read_tlog(source):
            if received.id >> 8 != _DIALECT_ID:
                writer.write(unix_us, received.frame)


def read_tlog(source: Path | str | BinaryIO) -> Iterator[tuple[int, Received]]:
    """(unix_us, message) of each record, in the order of the file.

    A record cut off at the end is left out. Damaged stretches and frames of unknown ids are skipped.
    """
    if isinstance(source, Path | str):
        with Path(source).open("rb") as file:
            yield from _read(file)
    else:
        yield from _read(source)


def _read(file: BinaryIO) -> Iterator[tuple[int, Received]]:
    buffer = b""
    while chunk := file.read(_CHUNK):
        buffer += chunk
        used = yield from _records(buffer, len(buffer) - _STAMP.size - MAX_FRAME_BYTES)
        buffer = buffer[used:]
    yield from _records(buffer, len(buffer))


def _records(buffer: bytes, before: int) -> Generator[tuple[int, Received], None, int]:
    """The records that begin before offset `before`; returns the offset behind the last."""
    start = 0
    while start < before:
        begin = start + _STAMP.size
        received, end = message_at(buffer, begin) if begin < len(buffer) else (None, 0)
        if received is not None:
            yield _STAMP.unpack_from(buffer, start)[0], received
            start = end
            continue
        end = begin + announced_length(buffer, begin)
        # a frame that is damaged or unknown, but whole
        whole = begin < end < len(buffer) - _STAMP.size and buffer[end + _STAMP.size] in MAGICS
        start = end if whole else start + 1
    return start
