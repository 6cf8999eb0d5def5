"""Fence and rally points of a vehicle as the page draws them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from autopilot.wire.convert import Home
from autopilot.wire.convert.axes import ned_from_enu
from autopilot.wire.convert.geodesy import enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem

_POLYGONS = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: "inclusion",
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: "exclusion",
}
_CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: "inclusion",
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: "exclusion",
}


def fence_record(
    items: Sequence[WireItem], home: Home, parameters: Mapping[str, float]
) -> dict[str, Any] | None:
    """Zones, greatest distance and greatest height (m); None if there is no fence."""
    zones: list[dict[str, Any]] = []
    corners: list[list[float]] = []
    for item in items:
        if item.command in _POLYGONS:
            corners.append(_spot(item, home))
            if len(corners) == item.param1:
                zones.append({"kind": _POLYGONS[item.command], "polygon": corners})
                corners = []
        elif item.command in _CIRCLES and 0.0 < item.param1 < inf:
            zone = {
                "kind": _CIRCLES[item.command],
                "centre": _spot(item, home),
                "radius": round(item.param1, 3),
            }
            zones.append(zone)
    radius = parameters.get("GF_MAX_HOR_DIST", 0.0)
    height = parameters.get("GF_MAX_VER_DIST", 0.0)
    if not zones and radius <= 0.0 and height <= 0.0:
        return None
    return {"zones": zones, "radius": radius or None, "height": height or None}


def rally_record(items: Sequence[WireItem], home: Home) -> list[list[float]]:
    """Places on the ground: heights of rally points are not used."""
    return [[*_spot(item, home), 0.0] for item in items if item.command == mavlink.MAV_CMD_NAV_RALLY_POINT]


def _spot(item: WireItem, home: Home) -> list[float]:
    north, east, _ = ned_from_enu(enu_from_geodetic(round(item.x), round(item.y), 0, home))
    return [round(north, 3), round(east, 3)]
