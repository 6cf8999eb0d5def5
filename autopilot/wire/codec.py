"""MAVLink frames from messages and back: bytes in, bytes out, no state but a sequence counter.

Layouts (struct format, field order, CRC_EXTRA) are read from pymavlink's own generated classes, so the frames
are byte for byte those of pymavlink, at a fifth of its time. Every datagram is parsed afresh: no rubbish can
reach over its end and swallow what comes next.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

from fastcrc.crc16 import mcrf4xx

from autopilot.wire.dialect import plumbline as mavlink

_MAGIC_V1 = 0xFE
_MAGIC_V2 = 0xFD
MAGICS = (_MAGIC_V1, _MAGIC_V2)  # the first byte of a frame
_HEADER_V1 = 6
_HEADER_V2 = 10
_CRC = 2
_SIGNATURE = 13
LONGEST_FRAME = _HEADER_V2 + 255 + _CRC + _SIGNATURE
_SIGNED = 0x01  # the only incompatibility flag that is defined

_HEADER2 = struct.Struct("<BBBBBBBHB")  # the MAVLink 2 header; the message id is 24 bits, low part first
_FLOAT32_MAX = 3.4028234663852886e38
_CHECKSUM = struct.Struct("<H")


class Received(NamedTuple):
    """One message with its origin; `frame` is the whole frame as it arrived."""

    message: Any  # pymavlink's class of the message
    system: int
    component: int
    sequence: int
    frame: bytes


class _Layout:
    """How one message class lies in a payload."""

    __slots__ = (
        "attributes",
        "crc_extra",
        "has_text",
        "id_high",
        "id_low",
        "pack",
        "places",
        "reorder",
        "single",
        "size",
        "spread",
        "type",
        "unpack_from",
    )

    def __init__(self, message_type: Any) -> None:
        fields: list[str] = message_type.ordered_fieldnames
        lengths: list[int] = message_type.array_lengths
        types = dict(zip(message_type.fieldnames, message_type.fieldtypes, strict=True))
        text = {name for name in fields if types[name] == "char"}

        self.type = message_type
        self.crc_extra = bytes((message_type.crc_extra,))
        self.id_low = message_type.id & 0xFFFF
        self.id_high = message_type.id >> 16
        self.pack: Callable[..., bytes] = message_type.unpacker.pack
        self.unpack_from: Callable[[bytes, int], tuple[Any, ...]] = message_type.unpacker.unpack_from
        self.size: int = message_type.unpacker.size
        self.single = len(fields) == 1

        # pymavlink keeps what was given for a char array beside the str that it shows
        self.attributes = attrgetter(*(f"_{name}_raw" if name in text else name for name in fields))
        # arrays of numbers, the last first, so that spreading one does not move the others
        self.spread = tuple(
            (place, length)
            for place, (name, length) in reversed(list(enumerate(zip(fields, lengths, strict=True))))
            if length and name not in text
        )

        self.has_text = bool(text)
        orders: list[int] = message_type.orders
        self.reorder = itemgetter(*orders) if orders != sorted(orders) else None
        # (first value, count or 0) of each field, in the order of the constructor, where there are arrays
        self.places: tuple[tuple[int, int], ...] = ()
        if self.spread:
            first = 0
            places = []
            for name, length in zip(fields, lengths, strict=True):
                count = 0 if name in text else length
                places.append((first, count))
                first += count or 1
            self.places = tuple(places[order] for order in orders)

    def payload(self, message: Any) -> bytes:
        """The fields of `message`, in wire order, not truncated."""
        values: Any = [self.attributes(message)] if self.single else self.attributes(message)
        if self.spread:
            values = list(values)
            for place, length in self.spread:
                values[place : place + 1] = values[place][:length]
        try:
            return self.pack(*values)
        except OverflowError:  # a float that no float32 holds
            return self.pack(*map(_within_float32, values))

    def message(self, payload: bytes, start: int) -> Any:
        """pymavlink's object for the full-length payload at `start`."""
        values: Any = self.unpack_from(payload, start)
        if self.places:
            values = [values[i : i + count] if count else values[i] for i, count in self.places]
            values = [list(value) if type(value) is tuple else value for value in values]
        elif self.reorder:
            values = self.reorder(values)
        if self.has_text:
            values = [value.rstrip(b"\0") if type(value) is bytes else value for value in values]
        return self.type(*values)


_BY_ID = {message_id: _Layout(message_type) for message_id, message_type in mavlink.mavlink_map.items()}
_BY_TYPE = {layout.type: layout for layout in _BY_ID.values()}


def _within_float32(value: Any) -> Any:
    if isinstance(value, float) and math.isfinite(value) and abs(value) > _FLOAT32_MAX:
        return math.copysign(math.inf, value)
    return value


class FrameWriter:
    """Makes the MAVLink 2 frames of one component on one link; owns their sequence counter."""

    def __init__(self, system: int, component: int) -> None:
        self.system = system
        self.component = component
        self.sequence = 0

    def frame(self, message: Any, sign: Callable[[bytes], bytes] | None = None) -> bytes:
        """The frame of a message of our dialect, trailing zeros of its payload cut; signed by `sign`.

        A float beyond float32 is sent as infinite. An integer outside its field raises struct.error, as in
        pymavlink; the builders of `convert` and `telemetry` saturate.
        """
        layout = _BY_TYPE[type(message)]
        payload = layout.payload(message).rstrip(b"\0") or b"\0"
        sequence = self.sequence
        frame = (
            _HEADER2.pack(
                _MAGIC_V2,
                len(payload),
                0 if sign is None else _SIGNED,
                0,
                sequence,
                self.system,
                self.component,
                layout.id_low,
                layout.id_high,
            )
            + payload
        )
        self.sequence = (sequence + 1) & 0xFF
        frame += _CHECKSUM.pack(mcrf4xx(frame[1:] + layout.crc_extra))
        return frame if sign is None else sign(frame)


def announced_length(data: bytes, start: int) -> int:
    """How long the frame at `start` says it is; 0 if none begins there or the data ends too soon."""
    if start + 2 >= len(data) or data[start] not in MAGICS:
        return 0
    if data[start] == _MAGIC_V1:
        return _HEADER_V1 + data[start + 1] + _CRC
    return _HEADER_V2 + data[start + 1] + _CRC + (_SIGNATURE if data[start + 2] & _SIGNED else 0)


def whole_frames(stream: bytes) -> int:
    """How much of a byte stream can be decoded; what is behind may be the begin of a frame."""
    start = 0
    while start < len(stream):
        if stream[start] not in MAGICS:
            start += 1
            continue
        length = announced_length(stream, start)
        if not length or start + length > len(stream):
            break
        start += length
    return start


# bytes of header, payload and signature; incompatibility flags, sequence, system, component, message id
_Header = tuple[int, int, int, int, int, int, int, int]


def _header(datagram: bytes, start: int, end: int) -> _Header | None:
    """The frame header at `start`, if there is one and its frame ends within the datagram."""
    length = announced_length(datagram, start)
    if not length or start + length > end:
        return None
    if datagram[start] == _MAGIC_V1:
        _, payload, sequence, system, component, message_id = datagram[start : start + _HEADER_V1]
        return _HEADER_V1, payload, 0, 0, sequence, system, component, message_id
    _, payload, flags, _, sequence, system, component, low, high = _HEADER2.unpack_from(datagram, start)
    if flags & ~_SIGNED:
        return None  # laid out in a way that is not known
    return (
        _HEADER_V2,
        payload,
        _SIGNATURE if flags else 0,
        flags,
        sequence,
        system,
        component,
        low | high << 16,
    )


def _received(datagram: bytes, start: int, header: _Header, layout: _Layout) -> Received | None:
    """The message of the frame at `start`, or None if its checksum is wrong."""
    header_length, payload, signature, flags, sequence, system, component, _ = header
    body = start + header_length
    tail = body + payload
    checksum = mcrf4xx(datagram[start + 1 : tail] + layout.crc_extra)
    if checksum != datagram[tail] | datagram[tail + 1] << 8:
        return None
    if payload < layout.size:
        message = layout.message(datagram[body:tail].ljust(layout.size, b"\0"), 0)
    else:
        message = layout.message(datagram, body)
    frame = datagram[start : tail + _CRC + signature]
    origin = message._header
    origin.mlen = payload
    origin.incompat_flags = flags
    origin.seq = sequence
    origin.srcSystem = system
    origin.srcComponent = component
    message._crc = checksum
    message._msgbuf = frame
    return Received(message, system, component, sequence, frame)


def decode(datagram: bytes) -> tuple[list[Received], int]:
    """The messages of a datagram in their order, and how many of its bytes were not part of one.

    Whatever the bytes are, nothing is raised: behind a byte that begins no frame, or begins one with a wrong
    checksum, the search goes on at the next byte. A frame of an unknown id cannot be checked; it is stepped
    over whole where it ends with the datagram or before what may be another frame.
    """
    received: list[Received] = []
    end = len(datagram)
    good = 0
    start = 0
    while start < end:
        header = _header(datagram, start, end)
        if header is None:
            start += 1
            continue
        length = header[0] + header[1] + _CRC + header[2]
        layout = _BY_ID.get(header[7])
        if layout is None:
            after = start + length
            start = after if after == end or datagram[after] in MAGICS else start + 1
            continue
        one = _received(datagram, start, header, layout)
        if one is None:
            start += 1
            continue
        received.append(one)
        good += length
        start += length
    return received, end - good


class Origin(NamedTuple):
    """What the header of a frame says of its message."""

    message_id: int
    system: int
    component: int


def origin_of(frame: bytes) -> Origin | None:
    """The origin of a frame that is whole, undamaged and of a known id, its message not read; or None."""
    header = _header(frame, 0, len(frame))
    if header is None or header[0] + header[1] + _CRC + header[2] != len(frame):
        return None
    layout = _BY_ID.get(header[7])
    tail = header[0] + header[1]
    if layout is None or mcrf4xx(frame[1:tail] + layout.crc_extra) != frame[tail] | frame[tail + 1] << 8:
        return None
    return Origin(header[7], header[5], header[6])


def payload_of(frame: bytes) -> bytes:
    """The payload of a whole frame; MAVLink 2 cuts its trailing zeros."""
    begin = _HEADER_V1 if frame[0] == _MAGIC_V1 else _HEADER_V2
    return frame[begin : begin + frame[1]]
