"""The contents of the files that are generated when they are read: packed parameters, the mission, metadata.

`param.pck` and `mission.dat` are ArduPilot's formats, which MAVProxy and pymavlink read; the metadata are
the JSON files of MAVLink's component information protocol, from which QGroundControl takes texts, units and
ranges.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Mapping
from typing import Any

from autopilot.services.file_tree import FileGenerator, checksum
from autopilot.services.files import Path
from autopilot.services.identity import Identity
from autopilot.services.mission_store import StoredMission
from autopilot.wire.codec import within_float32
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from autopilot.wire.parameter_table import ParameterTable

PARAMETERS: Path = ("@PARAM", "param.pck")
MISSION: Path = ("@MISSION", "mission.dat")
GENERAL: Path = ("etc", "extras", "component_general.json")
PARAMETER_METADATA: Path = ("etc", "extras", "parameters.json")

_MAGIC, _MAGIC_WITH_DEFAULTS = 0x671B, 0x671C
_INT32_TYPE, _FLOAT_TYPE, _HAS_DEFAULT = 3, 4, 0x10
_MAX_COMMON = 15  # letters that a name may share with the one before it, a field of four bits
_HEADER = struct.Struct("<HHH")
_MISSION_MAGIC = 0x763D
_MISSION_HEADER = struct.Struct("<5H")
_ITEM = struct.Struct("<ffffiifHHBBBBBB")  # MISSION_ITEM_INT as it is transferred
_PARAMETER_METADATA = 1  # COMP_METADATA_TYPE


def parameter_pack(table: ParameterTable, query: Mapping[str, str], integers: bool = False) -> bytes:
    """All parameters; `withdefaults=1` adds the defaults, `start` and `count` select a part.

    A record consists of the type and flags, the length of the name and of the part that it shares with the
    name before, the rest of the name, the value, and the default if it differs.
    """
    defaults = query.get("withdefaults") == "1"
    start, count = _as_integer(query.get("start"), 0), _as_integer(query.get("count"), len(table))
    part = (PARAMETERS, defaults, start, count, integers)
    return table.cached(part, lambda: _packed(table, defaults, start, count, integers))


def _packed(table: ParameterTable, defaults: bool, start: int, count: int, integers: bool) -> bytes:
    names = table.names[start : start + count]
    packed = [_HEADER.pack(_MAGIC_WITH_DEFAULTS if defaults else _MAGIC, len(names), len(table))]
    previous = b""
    for text in names:
        name = text.encode()
        common = min(_common_length(previous, name), _MAX_COMMON, len(name) - 1)
        value, default = table[text], table.describe(text).default
        flags = _HAS_DEFAULT if defaults and default != value else 0
        rest = name[common:]
        numbers = (value, default) if flags else (value,)
        kind, letter = (_INT32_TYPE, "i") if integers and table.describe(text).integer else (_FLOAT_TYPE, "f")
        packed.append(bytes((kind | flags, common | (len(rest) - 1) << 4)) + rest)
        encoded = map(round if letter == "i" else within_float32, numbers)
        packed.append(struct.pack(f"<{len(numbers)}{letter}", *encoded))
        previous = name
    return b"".join(packed)


def mission_pack(items: tuple[WireItem, ...]) -> bytes:
    """The items as MISSION_ITEM_INT, one after the other."""
    header = _MISSION_HEADER.pack(_MISSION_MAGIC, mavlink.MAV_MISSION_TYPE_MISSION, 0, 0, len(items))
    return header + b"".join(
        _ITEM.pack(
            item.param1,
            item.param2,
            item.param3,
            item.param4,
            item.x,
            item.y,
            item.z,
            seq,
            item.command,
            0,
            0,
            item.frame,
            item.current,
            item.autocontinue,
            mavlink.MAV_MISSION_TYPE_MISSION,
        )
        for seq, item in enumerate(items)
    )


def parameter_metadata(table: ParameterTable, integers: bool = False) -> bytes:
    """Metadata of the parameters; those of the simulator without a range, which only the simulator knows."""
    return table.cached((PARAMETER_METADATA, integers), lambda: _metadata(table, integers))


def _metadata(table: ParameterTable, integers: bool) -> bytes:
    listed = []
    for name in table.names:
        description = table.describe(name)
        record: dict[str, Any] = {
            "name": name,
            "type": "Int32" if integers and description.integer else "Float",
            "shortDesc": description.text,
            "units": description.unit,
            "group": name.partition("_")[0],
            "decimalPlaces": 0 if description.integer else 6,
            "rebootRequired": description.fixed,
        }
        if name not in table.remote_names:
            record |= {"default": description.default, "min": description.low, "max": description.high}
        listed.append({key: value for key, value in record.items() if _is_json_value(value)})
    return _json({"version": 3, "parameters": listed})


def general_metadata(identity: Identity, table: ParameterTable) -> bytes:
    """The general file: which metadata exist, and where."""
    metadata = parameter_metadata(table, identity.integer_parameters)
    return _json(
        {
            "version": 1,
            "vendorName": "Plumbline",
            "modelName": "quadrotor with a load on a cable",
            "firmwareVersion": ".".join(map(str, identity.version)),
            "metadataTypes": [
                {"type": _PARAMETER_METADATA, "uri": _uri(PARAMETER_METADATA), "fileCrc": checksum(metadata)}
            ],
        }
    )


def generated_files(
    identity: Identity, table: ParameterTable, mission: Callable[[], StoredMission]
) -> dict[Path, FileGenerator]:
    """All generated files by path; `mission` returns the mission in force."""
    return {
        PARAMETERS: lambda query: parameter_pack(table, query, identity.integer_parameters),
        MISSION: lambda query: mission_pack(mission().items),
        GENERAL: lambda query: general_metadata(identity, table),
        PARAMETER_METADATA: lambda query: parameter_metadata(table, identity.integer_parameters),
    }


def metadata_message(identity: Identity, table: ParameterTable, now_us: int) -> Any:
    """COMPONENT_METADATA: where the general file is."""
    crc = checksum(general_metadata(identity, table))
    return mavlink.MAVLink_component_metadata_message(_boot_ms(now_us), crc, _uri(GENERAL).encode())


def information_message(identity: Identity, table: ParameterTable, now_us: int) -> Any:
    """COMPONENT_INFORMATION, the older form of COMPONENT_METADATA."""
    crc = checksum(general_metadata(identity, table))
    return mavlink.MAVLink_component_information_message(
        _boot_ms(now_us), crc, _uri(GENERAL).encode(), 0, b""
    )


def _boot_ms(now_us: int) -> int:
    return now_us // 1000 & 0xFFFFFFFF


def _uri(path: Path) -> str:
    return f"mftp:///{'/'.join(path)}"


def _json(record: Any) -> bytes:
    return json.dumps(record, separators=(",", ":"), allow_nan=False).encode()


def _is_json_value(value: Any) -> bool:
    return not (isinstance(value, float) and not math.isfinite(value))


def _common_length(a: bytes, b: bytes) -> int:
    """Number of equal bytes at the beginning of both."""
    count = 0
    for x, y in zip(a, b, strict=False):
        if x != y:
            break
        count += 1
    return count


def _as_integer(text: str | None, default: int) -> int:
    return int(text) if text is not None and text.isascii() and text.isdigit() else default
