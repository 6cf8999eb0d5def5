"""The parameters of mission commands: how they are read, checked, written and described.

A field gives one or two attributes of the record that an item represents. Parameters are numbered as in
MAV_CMD: 1 ... 4 are floats, 5 and 6 are x and y (int32), 7 is z (float).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan, nan
from typing import Any, ClassVar, Protocol

from autopilot.geometry.frames import enu_from_ned, ned_from_enu
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.limits import FARTHEST_M, LOWEST_M
from autopilot.wire.items.records import (
    ABSOLUTE_FRAMES,
    GLOBAL_FRAMES,
    PLACE_FRAMES,
    MissionItemError,
    WireItem,
    wrong_frame,
)
from autopilot.wire.parameter_table import decimal_from_float32
from missions.model import Axis

WIRE_FIELD = ("param1", "param2", "param3", "param4", "x", "y", "z")
_WHOLE = (5, 6)
_INT32_MAX = 2**31 - 1
NOT_GIVEN = _INT32_MAX  # x or y without a value
_COUNTS = {1e3: "ms", 1e6: "us"}  # units of x and y by counts per second
_NO_PLACE_HINT = "; latitude and longitude are 0, so the place may be missing"
_PARAM_RESULT = (
    mavlink.MAV_MISSION_INVALID_PARAM1,
    mavlink.MAV_MISSION_INVALID_PARAM2,
    mavlink.MAV_MISSION_INVALID_PARAM3,
    mavlink.MAV_MISSION_INVALID_PARAM4,
    mavlink.MAV_MISSION_INVALID_PARAM5_X,
    mavlink.MAV_MISSION_INVALID_PARAM6_Y,
    mavlink.MAV_MISSION_INVALID_PARAM7,
)


class Field(Protocol):
    """One or two parameters of a command."""

    @property
    def attributes(self) -> tuple[str, ...]:
        """The attributes of the record that the field holds."""

    def read(self, seq: int, item: WireItem, home: Home) -> tuple[Any, ...]:
        """Their values; MissionItemError if one is out of its limits."""

    def write(self, seq: int, home: Home, *values: Any) -> dict[str, float]:
        """The fields of MISSION_ITEM_INT that hold these values; MissionItemError if they do not fit."""

    def describe(self) -> str:
        """Parameter, name and limits, for the documentation."""


@dataclass(frozen=True)
class Number:
    """A number within limits. x and y hold it as a whole number in units of 1/`per_unit`."""

    param: int
    attribute: str
    name: str
    unit: str
    low: float
    high: float
    per_unit: float = 1.0
    none: float | None = None  # the number on the wire that stands for None
    none_means: str = "none"
    magnitude: bool = False  # its sign does not count
    default: float | None = None  # what NaN means

    @property
    def attributes(self) -> tuple[str, ...]:
        return (self.attribute,)

    def read(self, seq: int, item: WireItem, home: Home) -> tuple[float | None]:
        sent: float = getattr(item, WIRE_FIELD[self.param - 1])
        if self.none is not None and sent == self.none:
            return (None,)
        if self.default is not None and isnan(sent):
            return (self.default,)
        value = abs(sent) if self.magnitude else sent / self.per_unit
        return (check(seq, self.param, self.name, value, self.unit, self.low, self.high),)

    def write(self, seq: int, home: Home, *values: Any) -> dict[str, float]:
        (value,) = values
        if value is None:
            assert self.none is not None, self.attribute
            value = self.none
        elif self.param in _WHOLE:
            longest = _INT32_MAX / self.per_unit
            check(seq, self.param, self.name, value, self.unit, -longest, longest)
            value = round(value * self.per_unit)
        return {WIRE_FIELD[self.param - 1]: value}

    def describe(self) -> str:
        low, high, counted = self.low, self.high, ""
        if self.param in _WHOLE:
            longest = _INT32_MAX / self.per_unit
            low, high, counted = max(low, -longest), min(high, longest), f" in {_COUNTS[self.per_unit]}"
        none_text = "" if self.none is None else f", {self.none:g} {self.none_means}"
        default_text = "" if self.default is None else f", NaN as {self.default:g}"
        return (
            f"{_label(self.param)} {self.name} {low:.6g} ... {high:.6g} {self.unit}".rstrip()
            + counted
            + none_text
            + default_text
        )


@dataclass(frozen=True)
class Fall(Number):
    """The fall of a term, which may be 0 only if the term is held for ever (y -1)."""

    def read(self, seq: int, item: WireItem, home: Home) -> tuple[float | None]:
        low = 0.0 if item.y == -1 else self.low
        return (check(seq, self.param, self.name, item.param4, self.unit, low, self.high),)


@dataclass(frozen=True)
class Choice:
    """One of several whole numbers, each with a meaning."""

    param: int
    attribute: str
    name: str
    meanings: Mapping[int, Any]

    @property
    def attributes(self) -> tuple[str, ...]:
        return (self.attribute,)

    def read(self, seq: int, item: WireItem, home: Home) -> tuple[Any]:
        sent = getattr(item, WIRE_FIELD[self.param - 1])
        allowed = f"one of {self._listed()}"
        return (self.meanings[choice(seq, self.param, self.name, sent, tuple(self.meanings), allowed)],)

    def write(self, seq: int, home: Home, *values: Any) -> dict[str, float]:
        (code,) = (code for code, meaning in self.meanings.items() if meaning == values[0])
        return {WIRE_FIELD[self.param - 1]: float(code)}

    def describe(self) -> str:
        return f"{_label(self.param)} {self.name}: {self._listed()}"

    def _listed(self) -> str:
        """The numbers, each with its meaning if that is another word."""
        return ", ".join(
            str(code) if code == meaning else f"{code} {meaning}" for code, meaning in self.meanings.items()
        )


# PLUMBLINE_LOAD_SIGNAL_TERM.param1 and the sign of the amplitude; ned_from_enu of the unit vectors
_AXIS_CODE: dict[Axis, tuple[int, float]] = {"x": (1, 1.0), "y": (0, 1.0), "z": (2, -1.0)}
_AXIS_OF_CODE: dict[int, tuple[Axis, float]] = {code: (axis, s) for axis, (code, s) in _AXIS_CODE.items()}


@dataclass(frozen=True)
class Amplitude:
    """Axis and amplitude of a term: NED on the wire, ENU in the record, so z changes its sign."""

    attributes: ClassVar[tuple[str, ...]] = ("axis", "amplitude_m")

    def read(self, seq: int, item: WireItem, home: Home) -> tuple[Axis, float]:
        axis, sign = _AXIS_OF_CODE[choice(seq, 1, "axis", item.param1, tuple(_AXIS_OF_CODE))]
        return axis, sign * check(seq, 2, "amplitude", item.param2, "m", -FARTHEST_M, FARTHEST_M)

    def write(self, seq: int, home: Home, *values: Any) -> dict[str, float]:
        code, sign = _AXIS_CODE[values[0]]
        return {"param1": float(code), "param2": sign * values[1]}

    def describe(self) -> str:
        return f"p1 axis: 0 north, 1 east, 2 down; p2 amplitude {-FARTHEST_M:g} ... {FARTHEST_M:g} m"


@dataclass(frozen=True)
class Displacement:
    """A place in m from the first point of a trajectory: NED on the wire, ENU in the record."""

    attributes: ClassVar[tuple[str, ...]] = ("east_m", "north_m", "up_m")

    def read(self, seq: int, item: WireItem, home: Home) -> tuple[float, float, float]:
        ned = (item.param1, item.param2, item.param3)
        north, east, down = (
            check(seq, param, name, value, "m", -FARTHEST_M, FARTHEST_M)
            for param, (name, value) in enumerate(zip(("north", "east", "down"), ned, strict=True), 1)
        )
        return enu_from_ned((north, east, down))

    def write(self, seq: int, home: Home, *values: Any) -> dict[str, float]:
        north, east, down = ned_from_enu((values[0], values[1], values[2]))
        return {"param1": north, "param2": east, "param3": down}

    def describe(self) -> str:
        return f"p1, p2, p3 north, east and down of the first point {-FARTHEST_M:g} ... {FARTHEST_M:g} m"


@dataclass(frozen=True)
class Place:
    """A place in m from home: latitude and longitude, or north and east in MAV_FRAME_LOCAL_NED."""

    attributes: ClassVar[tuple[str, ...]] = ("east_m", "north_m")

    def read(self, seq: int, item: WireItem, home: Home) -> tuple[float, float]:
        hint = ""
        if item.frame in GLOBAL_FRAMES:
            hint = _NO_PLACE_HINT if item.x == item.y == 0 else ""
            _check_degrees(seq, 5, "latitude", item.x, 90.0)
            _check_degrees(seq, 6, "longitude", item.y, 180.0)
            east, north, _ = enu_from_geodetic(item.x, item.y, 0, home)
        elif item.frame == mavlink.MAV_FRAME_LOCAL_NED:
            east, north, _ = enu_from_ned((item.x / 1e4, item.y / 1e4, 0.0))
        else:
            raise wrong_frame(seq, item, PLACE_FRAMES)
        check(seq, 5, "place north of home", north, "m", -FARTHEST_M, FARTHEST_M, hint)
        check(seq, 6, "place east of home", east, "m", -FARTHEST_M, FARTHEST_M, hint)
        return east, north

    def write(self, seq: int, home: Home, *values: Any) -> dict[str, float]:
        east, north = values
        check(seq, 5, "east or north of home", max(abs(east), abs(north)), "m", 0.0, FARTHEST_M)
        latitude, longitude, _ = geodetic_from_enu((east, north, 0.0), home)
        return {"x": latitude, "y": longitude}

    def describe(self) -> str:
        return f"x, y place within {FARTHEST_M / 1e3:g} km of home"


def _check_degrees(seq: int, param: int, name: str, coordinate: int, limit: float) -> None:
    is_given = coordinate != NOT_GIVEN
    degrees, hint = (coordinate * 1e-7, "") if is_given else (nan, "; it is not given")
    check(seq, param, name, degrees, "deg", -limit, limit, hint)


@dataclass(frozen=True)
class HomePlace:
    """The place of home: written for ground stations that draw the item, not read."""

    attributes: ClassVar[tuple[str, ...]] = ()

    def read(self, seq: int, item: WireItem, home: Home) -> tuple[()]:
        return ()

    def write(self, seq: int, home: Home, *values: Any) -> dict[str, float]:
        latitude, longitude, _ = geodetic_from_enu((0.0, 0.0, 0.0), home)
        return {"x": latitude, "y": longitude}

    def describe(self) -> str:
        return "x, y not used"


@dataclass(frozen=True)
class Height:
    """Height of the load in m above home; it must be above the ground."""

    attributes: ClassVar[tuple[str, ...]] = ("altitude_m",)

    def read(self, seq: int, item: WireItem, home: Home) -> tuple[float]:
        if item.frame not in PLACE_FRAMES:
            raise wrong_frame(seq, item, PLACE_FRAMES)
        height = item.z
        if item.frame in ABSOLUTE_FRAMES:
            height -= home.altitude_m
        elif item.frame == mavlink.MAV_FRAME_LOCAL_NED:
            height = enu_from_ned((0.0, 0.0, height))[2]
        return (check(seq, 7, "height above home", height, "m", LOWEST_M, FARTHEST_M),)

    def write(self, seq: int, home: Home, *values: Any) -> dict[str, float]:
        return {"z": values[0]}

    def describe(self) -> str:
        return "z height"


def check(
    seq: int, param: int, name: str, value: float, unit: str, low: float, high: float, hint: str = ""
) -> float:
    """`value`, a float32, as the decimal that was entered, if it lies within its limits; NaN does not. `hint`
    ends the text of the refusal."""
    decimal = decimal_from_float32(value)
    if low <= decimal <= high:
        return decimal
    stated = f"{name} = {value:.7g} {unit}".rstrip()
    text = f"{stated}; must be {low:.7g} ... {high:.7g}{hint}"
    raise MissionItemError(seq, text, _PARAM_RESULT[param - 1])


def choice(
    seq: int, param: int, name: str, value: float, allowed: Sequence[int], allowed_text: str | None = None
) -> int:
    """`value` as a whole number, if it is one of those allowed."""
    if value in allowed:
        return int(value)
    expected = allowed_text or f"one of {', '.join(map(str, sorted(allowed)))}"
    text = f"{name} = {value:.7g}; must be {expected}"
    raise MissionItemError(seq, text, _PARAM_RESULT[param - 1])


def _label(param: int) -> str:
    return f"p{param}" if param < 5 else WIRE_FIELD[param - 1]
