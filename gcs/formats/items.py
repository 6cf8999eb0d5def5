"""The common parts of mission files: conversion of their numbers, and items with their place in the file."""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from autopilot.wire.parameter_table import decimal_from_float32
from gcs.errors import InputError

NO_COORDINATE = 2**31 - 1  # a coordinate that is not given
_FLOAT32 = struct.Struct("<f")
_GLOBAL = frozenset(
    {
        mavlink.MAV_FRAME_GLOBAL,
        mavlink.MAV_FRAME_GLOBAL_INT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
    }
)
_LOCAL = frozenset(
    {mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_ENU, mavlink.MAV_FRAME_LOCAL_OFFSET_NED}
)


# which only messages have: ground stations take an item of a file with another frame for one of another kind
_FRAMES_OF_MESSAGES = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}


class FormatError(InputError):
    """An invalid file; the text says where and what."""


class FileItem(NamedTuple):
    """A mission item and its place in the file."""

    item: WireItem
    where: str


def item_of(
    frame: int, command: int, current: int, autocontinue: int, params: list[float], where: str
) -> WireItem:
    """The item of a row of a file: seven parameters in degrees and metres, NaN for what is not given."""
    for name, value, maximum in (("frame", frame, 255), ("command", command, 65535)):
        if not 0 <= value <= maximum:
            raise FormatError(f"{where}: {name} {value}; must be 0 ... {maximum}")
    x, y = (_coordinate(value, frame, number, where) for number, value in ((5, params[4]), (6, params[5])))
    p1, p2, p3, p4, _, _, z = (_float32(value, number, where) for number, value in enumerate(params, start=1))
    flags = (int(current == 1), int(bool(autocontinue)))
    return WireItem(frame, command, *flags, p1, p2, p3, p4, x, y, z)


def params_of(item: WireItem) -> list[float]:
    """The seven parameters of an item in degrees and metres, with enough digits to restore the item."""
    floats = [decimal_from_float32(value) for value in (item.param1, item.param2, item.param3, item.param4)]
    scale = _scale(item.frame)
    places = [math.nan if value == NO_COORDINATE else value / scale for value in (item.x, item.y)]
    return [*floats, *places, decimal_from_float32(item.z)]


def frame_in_file(item: WireItem) -> int:
    """The frame of an item as files have it: that of the same meaning without _INT."""
    return _FRAMES_OF_MESSAGES.get(item.frame, item.frame)


def _scale(frame: int) -> float:
    """The factor of MISSION_ITEM_INT for its coordinates: for degrees, metres, or other numbers."""
    if frame in _GLOBAL:
        return 1e7
    return 1e4 if frame in _LOCAL else 1.0


def _coordinate(value: float, frame: int, number: int, where: str) -> int:
    if math.isnan(value):
        return NO_COORDINATE
    scaled = value * _scale(frame)
    if not abs(scaled) < NO_COORDINATE:
        raise FormatError(f"{where}: parameter {number} = {value:g} is beyond what an item holds")
    return round(scaled)


def _float32(value: float, number: int, where: str) -> float:
    try:
        rounded: float = _FLOAT32.unpack(_FLOAT32.pack(value))[0]
    except OverflowError:
        raise FormatError(f"{where}: parameter {number} = {value:g} is beyond what an item holds") from None
    return rounded
