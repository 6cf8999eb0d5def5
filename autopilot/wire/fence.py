"""The fence: where load and vehicle may be; and rally points: where a return may lead.

As in PX4: inside at least one of the inclusion zones if there are any, outside all exclusion zones, within a
distance and a height of home. Zones are horizontal areas that apply at any height, ENU from home.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import hypot, inf

from autopilot.geometry.linear import Vec3
from autopilot.wire.command_names import numbered_name
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import MissionItemError, WireItem
from autopilot.wire.items.limits import FARTHEST_M
from autopilot.wire.polygon_shape import EastNorth, shape_problem

_INSIDE_POLYGON = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
_OUTSIDE_POLYGON = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
_INSIDE_CIRCLE = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
_OUTSIDE_CIRCLE = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
_POLYGONS = (_INSIDE_POLYGON, _OUTSIDE_POLYGON)
_CIRCLES = (_INSIDE_CIRCLE, _OUTSIDE_CIRCLE)
_RETURN = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT
_FRAMES = (
    mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_INT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
)


@dataclass(frozen=True, slots=True)
class Polygon:
    """An area with straight sides; `inclusion`: stay inside it, otherwise outside it."""

    inclusion: bool
    corners: tuple[EastNorth, ...]

    def contains(self, x: float, y: float) -> bool:
        """Whether the point is inside: a ray from it to the east crosses an odd number of sides."""
        inside = False
        x1, y1 = self.corners[-1]
        for x2, y2 in self.corners:
            if (y1 > y) != (y2 > y) and x < x1 + (y - y1) / (y2 - y1) * (x2 - x1):
                inside = not inside
            x1, y1 = x2, y2
        return inside

    def distance_to_edge(self, x: float, y: float) -> float:
        """Distance (m) of the point from the nearest side."""
        nearest = inf
        x1, y1 = self.corners[-1]
        for x2, y2 in self.corners:
            along_x, along_y = x2 - x1, y2 - y1
            squared = along_x * along_x + along_y * along_y
            share = ((x - x1) * along_x + (y - y1) * along_y) / squared if squared > 0.0 else 0.0
            share = min(max(share, 0.0), 1.0)
            nearest = min(nearest, hypot(x - x1 - share * along_x, y - y1 - share * along_y))
            x1, y1 = x2, y2
        return nearest

    def moved(self, east_m: float, north_m: float) -> Polygon:
        """The same area elsewhere."""
        return replace(self, corners=tuple((x + east_m, y + north_m) for x, y in self.corners))


@dataclass(frozen=True, slots=True)
class Disc:
    """A round area."""

    inclusion: bool
    centre: EastNorth
    radius: float

    def contains(self, x: float, y: float) -> bool:
        """Whether the point is inside."""
        return hypot(x - self.centre[0], y - self.centre[1]) <= self.radius

    def distance_to_edge(self, x: float, y: float) -> float:
        """Distance (m) of the point from the circle."""
        return abs(hypot(x - self.centre[0], y - self.centre[1]) - self.radius)

    def moved(self, east_m: float, north_m: float) -> Disc:
        """The same area elsewhere."""
        return replace(self, centre=(self.centre[0] + east_m, self.centre[1] + north_m))


Zone = Polygon | Disc


@dataclass(frozen=True, slots=True)
class Fence:
    """All zones."""

    zones: tuple[Zone, ...] = ()

    def violation(self, x: float, y: float) -> str:
        """Why the point may not be flown over, or an empty string."""
        inclusions = [zone for zone in self.zones if zone.inclusion]
        if inclusions and not any(zone.contains(x, y) for zone in inclusions):
            return "outside the fence"
        if any(zone.contains(x, y) for zone in self.zones if not zone.inclusion):
            return "in an exclusion zone of the fence"
        return ""

    def depth(self, x: float, y: float) -> float:
        """Distance (m) of a point that may not be flown over from the edge of the nearest inclusion zone, or
        of the exclusion zones in which it lies."""
        inclusions = [zone for zone in self.zones if zone.inclusion]
        if inclusions and not any(zone.contains(x, y) for zone in inclusions):
            return min(zone.distance_to_edge(x, y) for zone in inclusions)
        forbidding = [zone for zone in self.zones if not zone.inclusion and zone.contains(x, y)]
        return max((zone.distance_to_edge(x, y) for zone in forbidding), default=0.0)

    def moved(self, east_m: float, north_m: float) -> Fence:
        """The same fence elsewhere."""
        return Fence(tuple(zone.moved(east_m, north_m) for zone in self.zones))


NO_FENCE = Fence()


class _Items:
    """The items of one kind of plan; `noun` names one of them in errors."""

    def __init__(self, noun: str, home: Home) -> None:
        self._noun = noun
        self._home = home

    def error(self, seq: int, text: str, result: int) -> MissionItemError:
        """The error that refuses an item."""
        return MissionItemError(seq, text, result, self._noun)

    def east_north(self, seq: int, item: WireItem) -> EastNorth:
        """The place of an item; MissionItemError if it has none, or one too far away."""
        if item.frame not in _FRAMES:
            text = f"frame {item.frame}; must be one of 0, 3, 5, 6"
            raise self.error(seq, text, mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
        if abs(item.x) > 900_000_000:
            raise self.error(seq, "no latitude", mavlink.MAV_MISSION_INVALID_PARAM5_X)
        if abs(item.y) > 1_800_000_000:
            raise self.error(seq, "no longitude", mavlink.MAV_MISSION_INVALID_PARAM6_Y)
        east, north, _ = enu_from_geodetic(item.x, item.y, 0, self._home)
        distance = hypot(east, north)
        if distance > FARTHEST_M:
            if item.x == item.y == 0:
                text = "no place is given: latitude and longitude are 0"
            else:
                text = f"{distance / 1e3:.0f} km from home; must be at most {FARTHEST_M / 1e3:g} km"
            north_is_wrong = abs(north) >= abs(east)
            result = (
                mavlink.MAV_MISSION_INVALID_PARAM5_X
                if north_is_wrong
                else mavlink.MAV_MISSION_INVALID_PARAM6_Y
            )
            raise self.error(seq, text, result)
        return east, north


def read_fence(items: Sequence[WireItem], home: Home) -> Fence:
    """The fence that the items describe, or MissionItemError for the first that cannot be part of one."""
    return _read_fence(tuple(items), home)


@lru_cache(maxsize=1)
def _read_fence(items: tuple[WireItem, ...], home: Home) -> Fence:
    """The same; cached, as an upload is checked before it is acknowledged, and read when it is taken over."""
    fence_items = _Items("fence item", home)
    zones: list[Zone] = []
    corners: list[EastNorth] = []
    expected, kind = 0, 0
    for seq, item in enumerate(items):
        if corners and item.command != kind:
            text = f"a corner was expected: the polygon before it has {expected} and {len(corners)} came"
            raise fence_items.error(seq, text, mavlink.MAV_MISSION_INVALID)
        if item.command in _POLYGONS:
            if not item.param1 >= 3.0 or not float(item.param1).is_integer():
                text = f"a polygon of {item.param1:g} corners; must be 3 or more"
                raise fence_items.error(seq, text, mavlink.MAV_MISSION_INVALID_PARAM1)
            if corners and item.param1 != expected:
                text = f"a polygon of {expected} corners, and one of its corners says {item.param1:g}"
                raise fence_items.error(seq, text, mavlink.MAV_MISSION_INVALID_PARAM1)
            kind, expected = item.command, int(item.param1)
            corners.append(fence_items.east_north(seq, item))
            if len(corners) == expected:
                problem = shape_problem(corners, seq + 1 - expected)
                if problem:
                    raise fence_items.error(problem.number, problem.text, mavlink.MAV_MISSION_INVALID)
                zones.append(Polygon(kind == _INSIDE_POLYGON, tuple(corners)))
                corners = []
        elif item.command in _CIRCLES:
            if not 0.0 < item.param1 < 1e6:
                text = f"radius = {item.param1:g} m; must be > 0 and < 1000 km"
                raise fence_items.error(seq, text, mavlink.MAV_MISSION_INVALID_PARAM1)
            centre = fence_items.east_north(seq, item)
            zones.append(Disc(item.command == _INSIDE_CIRCLE, centre, item.param1))
        elif item.command == _RETURN:
            fence_items.east_north(seq, item)
        else:
            text = f"{numbered_name(item.command)} is no part of a fence"
            raise fence_items.error(seq, text, mavlink.MAV_MISSION_UNSUPPORTED)
    if corners:
        text = f"the last polygon has {expected} corners, and {len(corners)} came"
        raise fence_items.error(len(items) - 1, text, mavlink.MAV_MISSION_INVALID)
    return Fence(tuple(zones))


def read_rally(items: Sequence[WireItem], home: Home) -> tuple[Vec3, ...]:
    """The places that the items name, at the height of the ground, or MissionItemError."""
    rally_points = _Items("rally point", home)
    places: list[Vec3] = []
    for seq, item in enumerate(items):
        if item.command != mavlink.MAV_CMD_NAV_RALLY_POINT:
            text = f"{numbered_name(item.command)} is no rally point"
            raise rally_points.error(seq, text, mavlink.MAV_MISSION_UNSUPPORTED)
        east, north = rally_points.east_north(seq, item)
        places.append((east, north, 0.0))
    return tuple(places)


# by MAV_MISSION_TYPE
AREA_READERS: dict[int, Callable[[tuple[WireItem, ...], Home], object]] = {
    mavlink.MAV_MISSION_TYPE_FENCE: read_fence,
    mavlink.MAV_MISSION_TYPE_RALLY: read_rally,
}
