"""Telemetry logs: records of 8 bytes (big-endian microseconds since 1970) and one raw frame.

The format of MAVProxy, Mission Planner and QGroundControl; `pymavlink.mavutil.mavlink_connection` reads it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import BinaryIO, TypeVar

from autopilot.wire.codec import LONGEST_FRAME, MAGICS, Origin, Received, announced_length, decode, origin_of

_STAMP = struct.Struct(">Q")
_CHUNK = 1 << 16

T = TypeVar("T")


class TlogWriter:
    """Appends records to a binary file that somebody else opens and closes."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def write(self, unix_us: int, *frames: bytes) -> None:
        """A record for each frame, all of the same time."""
        stamp = _STAMP.pack(unix_us)
        self._file.write(b"".join([stamp + frame for frame in frames]))


def read_tlog(source: Path | str | BinaryIO) -> Iterator[tuple[int, Received]]:
    """(unix_us, message) of each record, in the order of the file.

    A record cut off at the end is left out. Damaged stretches are stepped over, as are frames of unknown ids.
    """
    return _from(source, _message)


def read_frames(source: Path | str | BinaryIO) -> Iterator[tuple[int, tuple[Origin, bytes]]]:
    """(unix_us, (origin, frame)) of the same records, their messages unread."""
    return _from(source, _frame)


def _message(frame: bytes) -> Received | None:
    received, junk = decode(frame)
    return received[0] if received and not junk else None


def _frame(frame: bytes) -> tuple[Origin, bytes] | None:
    origin = origin_of(frame)
    return None if origin is None else (origin, frame)


def _from(source: Path | str | BinaryIO, read: Callable[[bytes], T | None]) -> Iterator[tuple[int, T]]:
    if isinstance(source, Path | str):
        with Path(source).open("rb") as file:
            yield from _read(file, read)
    else:
        yield from _read(source, read)


def _read(file: BinaryIO, read: Callable[[bytes], T | None]) -> Iterator[tuple[int, T]]:
    buffer = b""
    while chunk := file.read(_CHUNK):
        buffer += chunk
        used = yield from _records(buffer, len(buffer) - _STAMP.size - LONGEST_FRAME, read)
        buffer = buffer[used:]
    yield from _records(buffer, len(buffer), read)


def _records(
    buffer: bytes, before: int, read: Callable[[bytes], T | None]
) -> Generator[tuple[int, T], None, int]:
    """The records that begin before offset `before`; returns the offset behind the last."""
    start = 0
    while start < before:
        begin = start + _STAMP.size
        length = announced_length(buffer, begin)
        end = begin + length
        if not length or end > len(buffer):
            start += 1
            continue
        found = read(buffer[begin:end])
        if found is not None:
            yield _STAMP.unpack_from(buffer, start)[0], found
            start = end
        elif end + _STAMP.size < len(buffer) and buffer[end + _STAMP.size] in MAGICS:
            start = end  # a frame that is damaged or unknown, but whole
        else:
            start += 1
    return start
