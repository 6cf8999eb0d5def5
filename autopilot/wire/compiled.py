"""MAVLink 2 frames in machine code: what `codec` does for any message, for those of the simulator link.

A message is given by a type that `wire_record` makes from pymavlink's own class: a NamedTuple of its fields
in the order of the wire, arrays as tuples. Layout, id and CRC_EXTRA are those of the generated class.

    HIL_SENSOR = wire_record(mavlink.MAVLink_hil_sensor_message, __name__)

    end = put_frame(HIL_SENSOR, values, payload, buffer, at, Origin(sequence, 1, 26))
    if match_frame(HIL_SENSOR, datagram, start, payload):
        message = unpack_payload(HIL_SENSOR, payload)                   # message.time_usec, message.xacc, ...

All functions also work in Python, with the same bytes. Only plain frames are read here, those of MAVLink 2
without a signature; anything else in a datagram is left to `codec.decode`.
"""

from __future__ import annotations

from collections import namedtuple
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.row_moves import field_putter, field_taker, is_numbers, is_row

Bytes = NDArray[np.uint8]

HEADER = 10
MAX_PAYLOAD_BYTES = 256  # bytes of an array that holds any payload
MAX_FRAME_BYTES = HEADER + 255 + 2
_MAGIC = 0xFD
# (bytes, NumPy's type) of a number on the wire; times fit into 63 bits
_NUMBERS = {
    "float": (4, "float32"),
    "double": (8, "float64"),
    "uint64_t": (8, "int64"),
    "int64_t": (8, "int64"),
    "uint32_t": (4, "uint32"),
    "int32_t": (4, "int32"),
    "uint16_t": (2, "uint16"),
    "int16_t": (2, "int16"),
    "uint8_t": (1, "uint8"),
    "int8_t": (1, "int8"),
    "char": (1, "uint8"),  # a text is the numbers of its bytes
}


def _crc_tables() -> NDArray[np.int32]:
    """(8, 256) CRC-16/MCRF4XX of each byte followed by 0 ... 7 zero bytes."""
    values = np.arange(256)
    for _ in range(8):
        values = (values >> 1) ^ np.where(values & 1, 0x8408, 0)
    tables = [values]
    for _ in range(7):
        tables.append((tables[-1] >> 8) ^ values[tables[-1] & 0xFF])
    return np.array(tables, np.int32)


_CRC_TABLES = _crc_tables()


class _Layout(NamedTuple):
    """The layout of a message in a frame."""

    message_id: int
    crc_extra: int
    size: int  # bytes of the whole payload
    fields: tuple[tuple[int, int, str], ...]  # (first byte, how many or 0 for a single one, NumPy's type)


class Origin(NamedTuple):
    """The origin of a frame: its sequence number, and the system and component that send it."""

    sequence: int
    system: int
    component: int


_LAYOUTS: dict[Any, _Layout] = {}


def wire_record(message_type: Any, module: str) -> Any:
    """The record type of one of pymavlink's classes; a text in it is a tuple of the numbers of its bytes.

    It must be a variable of the module `module` with the name of the message, where numba finds it when it
    loads machine code.
    """
    kinds = dict(zip(message_type.fieldnames, message_type.fieldtypes, strict=True))
    fields, at = [], 0
    for name, count in zip(message_type.ordered_fieldnames, message_type.array_lengths, strict=True):
        size, number = _NUMBERS[kinds[name]]
        fields.append((at, count, number))
        at += size * max(count, 1)
    record = namedtuple(message_type.msgname, message_type.ordered_fieldnames, module=module)  # type: ignore[misc]
    _LAYOUTS[record] = _Layout(message_type.id, message_type.crc_extra, at, tuple(fields))
    return record


def _number_offsets(layout: _Layout) -> tuple[tuple[int, str], ...]:
    """The first byte and NumPy's type of each number."""
    sizes = {number: np.dtype(number).itemsize for _, _, number in layout.fields}
    return tuple(
        (at + i * sizes[number], number) for at, count, number in layout.fields for i in range(max(count, 1))
    )


def _number_sources(layout: _Layout) -> tuple[str, list[str]]:
    """Source code of the views of `payload` through which its numbers are accessed, and of each number."""
    views, found = set(), []
    for first, number in _number_offsets(layout):
        size = np.dtype(number).itemsize
        if first % size:  # an extension field: these are not ordered by size
            found.append(f"payload[{first} : {first + size}].view(np.{number})[0]")
        else:
            views.add(number)
            found.append(f"{number}s[{first // size}]")
    return "".join(f"    {view}s = payload.view(np.{view})\n" for view in sorted(views)), found


@cache
def _python_putter(record: Any) -> Any:
    """put(kind, values, payload, buffer, at, origin) for Python: an assignment for each number."""
    layout = _LAYOUTS[record]
    views, numbers = _number_sources(layout)
    lines = "".join(f"    {number} = values[{i}]\n" for i, number in enumerate(numbers))
    namespace: dict[str, Any] = {"np": np, "framed": _write_frame}
    exec(
        "def put(kind: Any, values: Any, payload: Any, buffer: Any, at: Any, origin: Any) -> Any:\n"
        f"{views}{lines}    return framed(payload, {layout.size}, {layout.message_id}, {layout.crc_extra}, "
        "buffer, at, origin)\n",
        namespace,
    )
    return namespace["put"]


@cache
def _kernel_putter(record: Any) -> Any:
    """The same for kernels: all stores together, which compiles faster."""
    layout = _LAYOUTS[record]
    size, message_id, crc_extra = layout.size, layout.message_id, layout.crc_extra
    put_fields = field_putter(_number_offsets(layout))

    def put(kind: Any, values: Any, payload: Any, buffer: Any, at: Any, origin: Any) -> Any:
        put_fields(values, payload)
        return _write_frame(payload, size, message_id, crc_extra, buffer, at, origin)

    return put


@cache
def _python_unpacker(record: Any) -> Any:
    """take(kind, payload) for Python."""
    layout = _LAYOUTS[record]
    views, numbers = _number_sources(layout)
    parts, i = [], 0
    for _, count, number in layout.fields:
        wide = "np.float64" if number.startswith("float") else "np.int64"
        each = [f"{wide}({one})" for one in numbers[i : i + max(count, 1)]]
        parts.append(f"({', '.join(each)},)" if count else each[0])
        i += max(count, 1)
    namespace: dict[str, Any] = {"np": np, "record": record}
    exec(
        f"def take(kind: Any, payload: Any) -> Any:\n{views}    return record({', '.join(parts)})\n",
        namespace,
    )
    return namespace["take"]


@cache
def _kernel_unpacker(record: Any) -> Any:
    """The same for kernels: all loads together."""
    layout = _LAYOUTS[record]
    parts = []
    for _, count, number in layout.fields:
        wide = types.float64 if number.startswith("float") else types.int64
        parts.append(types.UniTuple(wide, count) if count else wide)
    read_fields = field_taker(_number_offsets(layout), types.BaseTuple.from_types(parts, record))

    def take(kind: Any, payload: Any) -> Any:
        return read_fields(payload)

    return take


@cache
def _matcher(record: Any) -> Any:
    """find(kind, data, start, payload) for Python and for kernels."""
    layout = _LAYOUTS[record]
    namespace: dict[str, Any] = {"copied": _copy_payload}
    exec(
        "def find(kind: Any, data: Any, start: Any, payload: Any) -> Any:\n"
        f"    return copied(data, start, {layout.message_id}, {layout.size}, {layout.crc_extra}, payload)\n",
        namespace,
    )
    return namespace["find"]


@kernel
def _crc_after(crc: int, byte: int) -> int:
    return (crc >> 8) ^ int(_CRC_TABLES[0, (crc ^ byte) & 0xFF])


@kernel
def _checksum(data: Any, first: int, end: int, crc_extra: int) -> int:
    """CRC-16/MCRF4XX of the bytes from `first` to before `end`, and of `crc_extra`.

    Eight bytes at a time ("slicing by eight"): only two of their eight table entries depend on the checksum
    of the bytes before them, for which the processor would otherwise wait at each byte.
    """
    crc, at = 0xFFFF, first
    while at + 8 <= end:
        block = (
            _CRC_TABLES[7, (crc & 0xFF) ^ int(data[at])]
            ^ _CRC_TABLES[6, (crc >> 8) ^ int(data[at + 1])]
            ^ _CRC_TABLES[5, int(data[at + 2])]
            ^ _CRC_TABLES[4, int(data[at + 3])]
            ^ _CRC_TABLES[3, int(data[at + 4])]
            ^ _CRC_TABLES[2, int(data[at + 5])]
            ^ _CRC_TABLES[1, int(data[at + 6])]
            ^ _CRC_TABLES[0, int(data[at + 7])]
        )
        crc = int(block)
        at += 8
    for i in range(at, end):
        crc = _crc_after(crc, int(data[i]))
    return _crc_after(crc, crc_extra)


@kernel
def _write_frame(
    payload: Bytes, size: int, message_id: int, crc_extra: int, buffer: Bytes, at: int, origin: Origin
) -> int:
    """Write the frame of a payload of this size; returns where the next frame may begin."""
    length = size
    while length > 1 and payload[length - 1] == 0:
        length -= 1
    buffer[at] = _MAGIC
    buffer[at + 1] = length
    buffer[at + 2] = 0
    buffer[at + 3] = 0
    buffer[at + 4] = origin.sequence & 0xFF
    buffer[at + 5] = origin.system
    buffer[at + 6] = origin.component
    buffer[at + 7] = message_id & 0xFF
    buffer[at + 8] = (message_id >> 8) & 0xFF
    buffer[at + 9] = message_id >> 16
    body = at + HEADER
    for i in range(length):
        buffer[body + i] = payload[i]
    end = body + length
    crc = _checksum(buffer, at + 1, end, crc_extra)
    buffer[end] = crc & 0xFF
    buffer[end + 1] = crc >> 8
    return end + 2


@kernel
def frame_end(data: Any, start: int) -> int:
    """Where the plain frame ends that begins at `start` of a datagram; 0 if there is no whole one."""
    if start + HEADER + 2 > len(data) or data[start] != _MAGIC or data[start + 2] != 0:
        return 0
    end = start + HEADER + data[start + 1] + 2
    return end if end <= len(data) else 0


@kernel
def _copy_payload(data: Any, start: int, message_id: int, size: int, crc_extra: int, payload: Bytes) -> bool:
    """Copy the payload of the whole frame at `start` if its id is this one and its checksum is correct."""
    if data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16 != message_id:
        return False
    length = int(data[start + 1])
    end = start + HEADER + length
    if _checksum(data, start + 1, end, crc_extra) != data[end] | data[end + 1] << 8:
        return False
    kept = min(length, size)
    for i in range(kept):
        payload[i] = data[start + HEADER + i]
    for i in range(kept, size):
        payload[i] = 0
    return True


def put_frame(kind: Any, values: Any, payload: Bytes, buffer: Bytes, at: int, origin: Origin) -> int:
    """Write a frame at `at` of the buffer, trailing zeros of its payload cut; returns where the next one may
    begin.

    `payload` is scratch. A float beyond float32 is sent as infinite; integers must be within their fields.
    """
    return int(_python_putter(kind)(kind, values, payload, buffer, at, origin))


def match_frame(kind: Any, data: Any, start: int, payload: Bytes) -> bool:
    """Whether the frame at `start`, which `frame_end` found whole, is an intact one of this message.

    If so, its payload is written to `payload`, followed by zeros.
    """
    return bool(_matcher(kind)(kind, data, start, payload))


def unpack_payload(kind: Any, payload: Bytes) -> Any:
    """The record of this type that the bytes at the beginning of `payload` contain."""
    return _python_unpacker(kind)(kind, payload)


def _record_of(kind: Any) -> Any:
    record = kind.instance_class if isinstance(kind, types.NamedTupleClass) else None
    return record if record in _LAYOUTS else None


@overload(put_frame)
def _put_frame(kind: Any, values: Any, payload: Any, buffer: Any, at: Any, origin: Any) -> Any:
    record = _record_of(kind)
    if record is None or not (is_row(payload, types.uint8) and is_numbers(values)):
        return None
    return _kernel_putter(record)


@overload(match_frame)
def _match_frame(kind: Any, data: Any, start: Any, payload: Any) -> Any:
    record = _record_of(kind)
    return None if record is None else _matcher(record)


@overload(unpack_payload)
def _unpack_payload(kind: Any, payload: Any) -> Any:
    record = _record_of(kind)
    if record is None or not is_row(payload, types.uint8):
        return None
    return _kernel_unpacker(record)
