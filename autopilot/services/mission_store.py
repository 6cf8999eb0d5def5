"""An accepted mission, and its bytes on disk.

    magic "PLMI" | uint16 version | uint16 count | count records | uint32 CRC-32 of all before

little-endian. A record is MISSION_ITEM_INT without its addresses, so the items that are read back equal the
uploaded ones bit for bit, NaN included.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import MissionItemError, WireItem, located_steps

_MAGIC = b"PLMI"
_VERSION = 1
_HEADER = struct.Struct("<4sHH")
_RECORD = struct.Struct("<BHBBffffiif")
_CRC = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class StoredMission:
    """An accepted mission: the items as they were uploaded."""

    items: tuple[WireItem, ...] = ()


@dataclass(frozen=True, slots=True)
class CorruptMission:
    """Stored bytes that are not a mission, and the reason."""

    reason: str


def serialise(items: tuple[WireItem, ...]) -> bytes:
    """The bytes that `deserialise` reads."""
    records = b"".join(
        _RECORD.pack(
            item.frame,
            item.command,
            item.current,
            item.autocontinue,
            item.param1,
            item.param2,
            item.param3,
            item.param4,
            item.x,
            item.y,
            item.z,
        )
        for item in items
    )
    body = _HEADER.pack(_MAGIC, _VERSION, len(items)) + records
    return body + _CRC.pack(zlib.crc32(body))


def plan_id(items: tuple[WireItem, ...]) -> int:
    """Number of this version of a plan, the same after a restart; 0: there is no plan."""
    if not items:
        return 0
    crc: int = _CRC.unpack(serialise(items)[-_CRC.size :])[0]
    return crc or 1


def deserialise(data: bytes, home: Home) -> StoredMission | CorruptMission:
    """The mission in `data`; `CorruptMission` if `serialise` did not write it."""
    items = deserialise_items(data)
    if isinstance(items, CorruptMission):
        return items
    try:
        located_steps(items, home)
    except MissionItemError as error:
        return CorruptMission(str(error))
    return StoredMission(items)


def deserialise_items(data: bytes) -> tuple[WireItem, ...] | CorruptMission:
    """The items in `data`, of any kind."""
    if len(data) < _HEADER.size + _CRC.size or not data.startswith(_MAGIC):
        return CorruptMission(f"{len(data)} bytes that do not begin as a mission file")
    _, version, count = _HEADER.unpack_from(data)
    if version != _VERSION:
        return CorruptMission(f"version {version}; this program reads version {_VERSION}")
    if len(data) != _HEADER.size + count * _RECORD.size + _CRC.size:
        return CorruptMission(f"{len(data)} bytes; {count} items need another length")
    body, (crc,) = data[: -_CRC.size], _CRC.unpack(data[-_CRC.size :])
    if zlib.crc32(body) != crc:
        return CorruptMission("its checksum is wrong")
    return tuple(WireItem(*record) for record in _RECORD.iter_unpack(body[_HEADER.size :]))
