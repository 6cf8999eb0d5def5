"""The value of a parameter in PARAM_VALUE and PARAM_SET: a float, or an INT32 in the field of one."""

from __future__ import annotations

import math
import struct

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_table import decimal_from_float32

_FLOAT32, _INT32 = struct.Struct("<f"), struct.Struct("<i")


def encode_parameter_value(value: float, whole: bool, bytewise: bool) -> tuple[float, int]:
    """`value` as PARAM_VALUE and PARAM_SET carry it, and its MAV_PARAM_TYPE.

    An INT32 (`whole`) travels in the field of a float: by its bits (PX4) or by its value (ArduPilot).
    """
    if not whole:
        return value, mavlink.MAV_PARAM_TYPE_REAL32
    number = round(value)
    wire_value: float = _FLOAT32.unpack(_INT32.pack(number))[0] if bytewise else float(number)
    return wire_value, mavlink.MAV_PARAM_TYPE_INT32


def decode_parameter_value(wire_value: float, kind: int) -> float:
    """The value that a PARAM_VALUE or PARAM_SET of this MAV_PARAM_TYPE represents.

    The encoding of an INT32 is recognised: the bits of one below 1e9, read as a float, are not a whole
    number, except for 0.
    """
    if kind != mavlink.MAV_PARAM_TYPE_INT32 or wire_value.is_integer() or math.isinf(wire_value):
        return decimal_from_float32(wire_value)
    return float(_INT32.unpack(_FLOAT32.pack(wire_value))[0])
