"""MAVLink frames from messages and back: bytes in, bytes out, no state but a sequence counter.

Layouts (struct format, field order, CRC_EXTRA) are read from pymavlink's own generated classes, so the frames
are byte for byte those of pymavlink. Messages that are sent often are given as `Fields`, the values of a
message in the order of the wire, and become a frame without an object in between; a received message becomes
an object when it is first read. Every datagram is parsed separately, so noise in one cannot swallow the next.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from operator import attrgetter, itemgetter
from typing import Any

from fastcrc.crc16 import mcrf4xx

from autopilot.wire.dialect import plumbline as mavlink

_MAGIC_V1 = 0xFE
_MAGIC_V2 = 0xFD
MAGICS = (_MAGIC_V1, _MAGIC_V2)  # the first byte of a frame
_HEADER_V1 = 6
_HEADER_V2 = 10
_CRC = 2
_SIGNATURE = 13
MAX_FRAME_BYTES = _HEADER_V2 + 255 + _CRC + _SIGNATURE
_SIGNED = 0x01  # the only incompatibility flag that is defined

_HEADER2 = struct.Struct("<BBBBBBBHB")  # the MAVLink 2 header; the message id is 24 bits, low part first
FLOAT32_MAX = 3.4028234663852886e38


class Layout:
    """The layout of one message class in a payload, and in a frame."""

    __slots__ = (
        "attributes",
        "crc_extra",
        "extra",
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
        self.crc_extra: int = message_type.crc_extra
        self.extra = bytes((self.crc_extra,))
        self.id_low = message_type.id & 0xFFFF
        self.id_high = message_type.id >> 16
        payload: str = message_type.unpacker.format
        # from behind the magic byte to CRC_EXTRA: all bytes that the checksum covers
        self.pack: Callable[..., bytes] = struct.Struct(f"<BBBBBBHB{payload[1:]}B").pack
        self.unpack_from: Callable[[bytes, int], tuple[Any, ...]] = message_type.unpacker.unpack_from
        self.size: int = message_type.unpacker.size
        self.single = len(fields) == 1

        # pymavlink keeps the given bytes of a char array beside the str that it shows
        self.attributes = attrgetter(*(f"_{name}_raw" if name in text else name for name in fields))
        # arrays of numbers, the last first, so that spreading one does not move those still to be spread
        self.spread = tuple(
            (place, length)
            for place, (name, length) in reversed(list(enumerate(zip(fields, lengths, strict=True))))
            if length and name not in text
        )

        self.has_text = bool(text)
        orders: list[int] = message_type.orders
        self.reorder = itemgetter(*orders) if orders != sorted(orders) else None
        # (first value, count or 0) of each field, in the order of the constructor, if there are arrays
        self.places: tuple[tuple[int, int], ...] = ()
        if self.spread:
            first = 0
            places = []
            for name, length in zip(fields, lengths, strict=True):
                count = 0 if name in text else length
                places.append((first, count))
                first += count or 1
            self.places = tuple(places[order] for order in orders)

    def values(self, message: Any) -> tuple[Any, ...]:
        """The values of pymavlink's object in the order of the wire, arrays spread out."""
        if self.single:
            return (self.attributes(message),)
        if not self.spread:
            return self.attributes(message)
        values = list(self.attributes(message))
        for place, length in self.spread:
            values[place : place + 1] = values[place][:length]
        return tuple(values)

    def number(self, name: str) -> tuple[int, struct.Struct]:
        """The offset in the payload of a field that is a single number, and the struct that reads it."""
        kinds = re.findall(r"\d*[a-zA-Z]", self.type.unpacker.format)
        place = self.type.ordered_fieldnames.index(name)
        return struct.calcsize("<" + "".join(kinds[:place])), struct.Struct("<" + kinds[place])

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


# A message as the values of its fields in the order of the wire, arrays spread out.
Fields = tuple[Layout, tuple[Any, ...]]

_BY_ID = {message_id: Layout(message_type) for message_id, message_type in mavlink.mavlink_map.items()}
_BY_TYPE = {layout.type: layout for layout in _BY_ID.values()}


def layout_of(message_type: Any) -> Layout:
    """The layout of one of pymavlink's classes of our dialect."""
    return _BY_TYPE[message_type]


def within_float32(value: Any) -> Any:
    """The value as a float field holds it: one that is too large becomes infinite."""
    if isinstance(value, float) and math.isfinite(value) and abs(value) > FLOAT32_MAX:
        return math.copysign(math.inf, value)
    return value


class FrameWriter:
    """Writes the MAVLink 2 frames of one component on one link, with its sequence counter."""

    def __init__(self, system: int, component: int) -> None:
        self.system = system
        self.component = component
        self.sequence = 0

    def frame(self, message: Any, sign: Callable[[bytes], bytes] | None = None) -> bytes:
        """The frame of a message of our dialect, trailing zeros of its payload cut; signed by `sign`.

        `message` is `Fields` or an object of pymavlink's. A float beyond float32 is sent as infinite. An
        integer outside its field raises struct.error, as in pymavlink; the builders of `convert` and
        `telemetry` saturate.
        """
        layout: Layout
        if type(message) is tuple:
            layout, values = message
        else:
            layout = _BY_TYPE[type(message)]
            values = layout.values(message)
        size, extra, sequence = layout.size, layout.crc_extra, self.sequence
        head = (
            *(size, 0 if sign is None else _SIGNED, 0, sequence, self.system, self.component),
            *(layout.id_low, layout.id_high),
        )
        try:
            body = layout.pack(*head, *values, extra)
        except OverflowError:  # a float beyond float32
            body = layout.pack(*head, *map(within_float32, values), extra)
        if not body[-2]:
            kept = body[_HEADER_V2 - 1 : -1].rstrip(b"\0") or b"\0"
            body = b"%c%b%b%c" % (len(kept), body[1 : _HEADER_V2 - 1], kept, extra)
        self.sequence = (sequence + 1) & 0xFF
        frame = b"\xfd%b%b" % (body[:-1], mcrf4xx(body).to_bytes(2, "little"))
        return frame if sign is None else sign(frame)


def announced_length(data: bytes, start: int) -> int:
    """Length of the frame at `start` by its header; 0 if none begins there or the data ends too soon."""
    if start + 2 >= len(data) or data[start] not in MAGICS:
        return 0
    if data[start] == _MAGIC_V1:
        return _HEADER_V1 + data[start + 1] + _CRC
    return _HEADER_V2 + data[start + 1] + _CRC + (_SIGNATURE if data[start + 2] & _SIGNED else 0)


def split_frames(frames: bytes) -> list[bytes]:
    """The single frames of bytes in which our own frames follow one another."""
    found, start = [], 0
    while start < len(frames):
        end = start + announced_length(frames, start)
        found.append(frames[start:end])
        start = end
    return found


def decodable_length(stream: bytes) -> int:
    """How many bytes of a stream can be decoded; the bytes behind them may be the beginning of a frame."""
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


class Received:
    """One message with its origin; `frame` is the whole frame as it arrived, with a correct checksum."""

    __slots__ = ("_message", "component", "frame", "id", "sequence", "system")

    def __init__(self, message_id: int, system: int, component: int, sequence: int, frame: bytes) -> None:
        self.id = message_id
        self.system = system
        self.component = component
        self.sequence = sequence
        self.frame = frame
        self._message: Any = None

    @property
    def message(self) -> Any:
        """pymavlink's object of the message, created when it is first read."""
        if self._message is None:
            self._message = self._decoded()
        return self._message

    def _decoded(self) -> Any:
        frame, layout = self.frame, _BY_ID[self.id]
        body = _HEADER_V2 if frame[0] == _MAGIC_V2 else _HEADER_V1
        payload = frame[1]
        tail = body + payload
        if payload < layout.size:
            message = layout.message(frame[body:tail].ljust(layout.size, b"\0"), 0)
        else:
            message = layout.message(frame, body)
        origin = message._header
        origin.mlen = payload
        origin.incompat_flags = frame[2] if body == _HEADER_V2 else 0
        origin.seq = self.sequence
        origin.srcSystem = self.system
        origin.srcComponent = self.component
        message._crc = frame[tail] | frame[tail + 1] << 8
        message._msgbuf = frame
        return message


class FieldReader:
    """Reads one number of a message from its frame without decoding the rest."""

    def __init__(self, message_type: Any, name: str) -> None:
        self._offset, self._number = _BY_TYPE[message_type].number(name)

    def read(self, frame: bytes) -> Any:
        """The field of a whole frame; bytes that were cut off the payload are zero."""
        body = _HEADER_V2 if frame[0] == _MAGIC_V2 else _HEADER_V1
        begin = body + self._offset
        end = begin + self._number.size
        if end > body + frame[1]:
            return self._number.unpack(frame[begin : body + frame[1]].ljust(self._number.size, b"\0"))[0]
        return self._number.unpack_from(frame, begin)[0]


def message_at(data: bytes, start: int) -> tuple[Received | None, int]:
    """The message whose frame begins at `start`, and where the frame ends.

    None and 0 where no frame begins, or the frame is cut off, damaged or has an unknown flag; None and its
    end where the frame is whole, but of an unknown id, so that it cannot be checked.
    """
    end = len(data)
    magic = data[start]
    if magic == _MAGIC_V2 and start + _HEADER_V2 + _CRC <= end:
        _, payload, flags, _, sequence, system, component, low, high = _HEADER2.unpack_from(data, start)
        message_id = low | high << 16
        tail = start + _HEADER_V2 + payload
        stop = tail + _CRC + (_SIGNATURE if flags else 0)
        if flags and flags != _SIGNED:
            return None, 0
    elif magic == _MAGIC_V1 and start + _HEADER_V1 + _CRC <= end:
        _, payload, sequence, system, component, message_id = data[start : start + _HEADER_V1]
        tail = start + _HEADER_V1 + payload
        stop = tail + _CRC
    else:
        return None, 0
    if stop > end:
        return None, 0
    layout = _BY_ID.get(message_id)
    if layout is None:
        return None, stop
    if mcrf4xx(layout.extra, mcrf4xx(data[start + 1 : tail])) != data[tail] | data[tail + 1] << 8:
        return None, 0
    return Received(message_id, system, component, sequence, data[start:stop]), stop


def decode(datagram: bytes, max_skipped: int | None = None) -> tuple[list[Received], int]:
    """The messages of a datagram in their order, and how many of its bytes were not part of one.

    Nothing is raised, whatever the bytes are: behind a byte that begins no frame, or a frame with a wrong
    checksum, the search continues at the next byte. Because searching costs time, it ends when more than
    `max_skipped` bytes were not part of a message (None: no limit). A frame of an unknown id cannot be
    checked; it is skipped as a whole if it ends with the datagram or before what may be another frame.
    """
    received: list[Received] = []
    end = len(datagram)
    good = unknown = 0  # bytes of messages, and of whole frames that cannot be checked
    start = 0
    while start < end:
        if max_skipped is not None and start - good - unknown > max_skipped:
            break
        message, stop = message_at(datagram, start)
        if message is not None:
            received.append(message)
            good += stop - start
        elif stop and (stop == end or datagram[stop] in MAGICS):
            unknown += stop - start
        else:
            stop = start + 1
        start = stop
    return received, end - good


def payload_of(frame: bytes) -> bytes:
    """The payload of a whole frame; MAVLink 2 cuts its trailing zeros."""
    begin = _HEADER_V1 if frame[0] == _MAGIC_V1 else _HEADER_V2
    return frame[begin : begin + frame[1]]
