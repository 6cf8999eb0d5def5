"""Fence, rally points and waypoints of a vehicle as the page draws them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from math import ceil, inf, isfinite
from typing import Any

from autopilot.wire.convert.axes import ned_from_enu
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem

_POLYGONS = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: "inclusion",
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: "exclusion",
}
_POINT = mavlink.PLUMBLINE_LOAD_TRAJECTORY_POINT
_MAX_POINTS = 200  # of trajectories that are drawn; each has a mark
_POSITION_COMMANDS = {
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
    mavlink.MAV_CMD_NAV_LAND,
}
_HEIGHT_ABOVE_HOME = {  # by frame: whether its heights are above home
    mavlink.MAV_FRAME_GLOBAL: False,
    mavlink.MAV_FRAME_GLOBAL_INT: False,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT: True,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: True,
}
_CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: "inclusion",
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: "exclusion",
}


def fence_record(
    items: Sequence[WireItem], home: Home, parameters: Mapping[str, float]
) -> dict[str, Any] | None:
    """Zones, maximum distance and maximum height (m); None if there is no fence."""
    zones: list[dict[str, Any]] = []
    corners: list[list[float]] = []
    for item in items:
        if item.command in _POLYGONS:
            corners.append(_north_east(item, home))
            if len(corners) == item.param1:
                zones.append({"kind": _POLYGONS[item.command], "polygon": corners})
                corners = []
        elif item.command in _CIRCLES and 0.0 < item.param1 < inf:
            zone = {
                "kind": _CIRCLES[item.command],
                "centre": _north_east(item, home),
                "radius": round(item.param1, 3),
            }
            zones.append(zone)
    radius = parameters.get("GF_MAX_HOR_DIST", 0.0)
    height = parameters.get("GF_MAX_VER_DIST", 0.0)
    if not zones and radius <= 0.0 and height <= 0.0:
        return None
    return {"zones": zones, "radius": radius or None, "height": height or None}


def rally_record(items: Sequence[WireItem], home: Home) -> list[list[float]]:
    """Positions of the rally points on the ground: their heights are not used."""
    return [
        [*_north_east(item, home), 0.0] for item in items if item.command == mavlink.MAV_CMD_NAV_RALLY_POINT
    ]


def waypoints_record(items: Sequence[WireItem], home: Home) -> list[list[float]]:
    """The positions that a mission specifies, in order, beginning with home; not the path between them. The
    points of a trajectory count from the position before it; of many, some are left out."""
    places: list[list[float]] = [[0.0, 0.0, 0.0]]
    for is_trajectory, found in groupby(items, lambda item: item.command == _POINT):
        if is_trajectory:
            places += _trajectory_points(list(found), places[-1])
            continue
        for item in found:
            if (
                item.command not in _POSITION_COMMANDS
                or item.frame not in _HEIGHT_ABOVE_HOME
                or not -inf < item.z < inf
            ):
                continue
            north, east = _north_east(item, home) if item.x or item.y else places[-1][:2]
            ground = 0.0 if _HEIGHT_ABOVE_HOME[item.frame] else home.altitude_m
            height = 0.0 if item.command == mavlink.MAV_CMD_NAV_LAND else item.z - ground
            places.append([north, east, round(-height, 3)])
    return places if len(places) > 1 else []


def _trajectory_points(items: Sequence[WireItem], begin: list[float]) -> list[list[float]]:
    """Places along trajectories in a row, the first of which begins at `begin`."""
    places = [begin]
    for item in items:
        point = (item.param1, item.param2, item.param3)
        if item.x == 0:
            begin = places[-1]
        elif all(map(isfinite, point)):
            places.append([round(a + b, 3) for a, b in zip(begin, point, strict=True)])
    every = ceil(len(places) / _MAX_POINTS)
    return [*places[1:-1:every], places[-1]] if len(places) > 1 else []


def _north_east(item: WireItem, home: Home) -> list[float]:
    north, east, _ = ned_from_enu(enu_from_geodetic(round(item.x), round(item.y), 0, home))
    return [round(north, 3), round(east, 3)]
