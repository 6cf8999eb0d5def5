"""Flight logs in PX4's ULog format, version 1: bytes out, no file.

A log consists of its definitions (`header`), followed by messages in the order of their time. Flight
Review, PlotJuggler and pyulog read it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from typing import NamedTuple

MAGIC = b"ULog\x01\x12\x35"
_VERSION = 1
_HEAD = struct.Struct("<HB")  # size of what follows, kind
_TIME = struct.Struct("<Q")
_FLAGS = bytes(40)  # nothing incompatible, no data appended
_DEFAULT_OF_THE_SYSTEM = 1
_CODES = {
    "uint64_t": "Q",
    "int64_t": "q",
    "double": "d",
    "uint32_t": "I",
    "int32_t": "i",
    "float": "f",
    "uint16_t": "H",
    "int16_t": "h",
    "uint8_t": "B",
    "int8_t": "b",
    "bool": "?",
    "char": "c",
}
_MAX_TEXT_BYTES = 1000
RECORD_HEAD = 5  # bytes before the time of a record


class Topic(NamedTuple):
    """One kind of record: a name and the fields behind its time, each `type name` or `type[n] name`.

    Fields are ordered by size, the largest first, as PX4 packs them.
    """

    name: str
    fields: tuple[str, ...]

    @property
    def format(self) -> str:
        """The format as written in the log."""
        return f"{self.name}:uint64_t timestamp;" + "".join(f"{field};" for field in self.fields)

    @property
    def packer(self) -> struct.Struct:
        """Time and all numbers of a record, one after the other."""
        code = "<Q"
        for field in self.fields:
            kind, bracket, count = field.split(" ")[0].partition("[")
            code += f"{int(count.rstrip(']')) if bracket else ''}{_CODES[kind]}"
        return struct.Struct(code)

    @property
    def numbers(self) -> tuple[tuple[int, bool, int], ...]:
        """(size in bytes, whether it is a float, first byte in the record) of each number behind the time."""
        found, at = [], _TIME.size
        for field in self.fields:
            kind, bracket, count = field.split(" ")[0].partition("[")
            size = struct.calcsize("<" + _CODES[kind])
            for _ in range(int(count.rstrip("]")) if bracket else 1):
                found.append((size, _CODES[kind] in "fd", at))
                at += size
        return tuple(found)


class UlogWriter:
    """Makes the bytes of one log."""

    def __init__(self, topics: Iterable[Topic]) -> None:
        self._topics = tuple(topics)
        packers = [topic.packer for topic in self._topics]
        # whole messages: head, number of the topic, record
        self._records = [struct.Struct("<HBH" + packer.format[1:]) for packer in packers]
        self._sizes = [2 + packer.size for packer in packers]

    def header(
        self,
        time_us: int,
        info: Mapping[str, str | int],
        parameters: Mapping[str, float],
        defaults: Mapping[str, float],
    ) -> bytes:
        """Header, definitions and subscriptions; `defaults` are those that differ from the parameters."""
        parts = [MAGIC + bytes((_VERSION,)) + _TIME.pack(time_us), _message(b"B", _FLAGS)]
        parts += [_info(name, value) for name, value in info.items()]
        parts += [_message(b"F", topic.format.encode()) for topic in self._topics]
        parts += [parameter(name, value) for name, value in parameters.items()]
        for name, value in defaults.items():
            default = bytes((_DEFAULT_OF_THE_SYSTEM,)) + _keyed("float", name, struct.pack("<f", value))
            parts.append(_message(b"Q", default))
        for number, topic in enumerate(self._topics):
            parts.append(_message(b"A", struct.pack("<BH", 0, number) + topic.name.encode()))
        return b"".join(parts)

    def record(self, topic: int, time_us: int, *numbers: float) -> bytes:
        """One record of the topic with this number, its arrays spread out."""
        return self._records[topic].pack(self._sizes[topic], 0x44, topic, time_us, *numbers)  # 'D'


def parameter(name: str, value: float) -> bytes:
    """A message with the value of a parameter from here on."""
    return _message(b"P", _keyed("float", name, struct.pack("<f", value)))


def text(time_us: int, severity: int, line: str) -> bytes:
    """A logged text; MAV_SEVERITY 0 ... 7 is its level in the log."""
    level = ord("0") + min(max(severity, 0), 7)
    return _message(b"L", bytes((level,)) + _TIME.pack(time_us) + line.encode()[:_MAX_TEXT_BYTES])


def dropout(duration_ms: int) -> bytes:
    """Messages which state that the records of `duration_ms` are missing here."""
    whole, rest = divmod(duration_ms, 0xFFFF)  # the most that one message can state
    return b"".join(_message(b"O", struct.pack("<H", part)) for part in (*(0xFFFF,) * whole, rest))


def _message(kind: bytes, body: bytes) -> bytes:
    return _HEAD.pack(len(body), kind[0]) + body


def _keyed(kind: str, name: str, value: bytes) -> bytes:
    key = f"{kind} {name}".encode()
    return bytes((len(key),)) + key + value


def _info(name: str, value: str | int) -> bytes:
    if isinstance(value, str):
        encoded = value.encode()
        return _message(b"I", _keyed(f"char[{len(encoded)}]", name, encoded))
    return _message(b"I", _keyed("uint32_t", name, struct.pack("<I", value)))
