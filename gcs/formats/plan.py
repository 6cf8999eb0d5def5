"""QGroundControl's .plan: JSON with a mission of simple and complex items, a fence and rally points."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from autopilot.wire.convert.geodesy import Home, home_from_text
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from gcs.formats.items import FileItem, FormatError, frame_in_file, item_of, params_of
from gcs.formats.jumps import redirected, target_of

_TRANSECT = "TransectStyleComplexItem"  # surveys and corridors contain the simple items that they consist of
_PARAMS = 7
_ABOVE_SEA_LEVEL, _ABOVE_HOME = mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
_INSIDE_POLYGON = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
_OUTSIDE_POLYGON = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
_INSIDE_CIRCLE = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
_OUTSIDE_CIRCLE = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
_RETURN = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT


class Plan(NamedTuple):
    """The content of a file; `not_converted` has a line for each part for which there are no mission items.

    Fence, rally points and the planned home are None if the file does not mention them. `counts_home`: the
    list begins with the home, if its first item can be that.
    """

    items: list[FileItem]
    not_converted: list[str]
    fence: tuple[WireItem, ...] | None = None
    rally: tuple[WireItem, ...] | None = None
    home: Home | None = None
    counts_home: bool = False


def read_plan(text: str) -> Plan:
    """The items of a plan; complex items are replaced by the simple ones that QGroundControl has stored."""
    try:
        document = json.loads(text)
    except RecursionError:
        raise FormatError("not JSON: lists or objects within each other are too many") from None
    except json.JSONDecodeError as error:
        raise FormatError(f"not JSON: {error}") from None
    except ValueError:  # an integer of thousands of digits
        raise FormatError("not JSON: a number has too many digits") from None
    if not isinstance(document, dict) or document.get("fileType") != "Plan":
        raise FormatError('"fileType" must be "Plan"')
    mission = _member(document, "mission", dict, "mission")
    entries: list[tuple[dict[str, Any], str]] = []
    not_converted: list[str] = []
    for number, entry in enumerate(_member(mission, "items", list, "mission.items")):
        where = f"mission.items[{number}]"
        if not isinstance(entry, dict):
            raise FormatError(f"{where}: must be an object")
        if entry.get("type") == "ComplexItem":
            entries += _complex(entry, where, not_converted)
        elif entry.get("type", "SimpleItem") == "SimpleItem":
            entries.append((entry, where))
        else:
            raise FormatError(f"{where}.type: {entry['type']!r}; must be SimpleItem or ComplexItem")
    return Plan(
        _numbered_items(entries), not_converted, _fence(document), _rally(document), _planned_home(mission)
    )


def write_plan(
    items: Sequence[WireItem], home: Home, fence: Sequence[WireItem] = (), rally: Sequence[WireItem] = ()
) -> str:
    """The text of a plan with these items, all of them simple, and fence and rally points."""
    place = [home.latitude_deg, home.longitude_deg, home.altitude_m]
    entries = [
        {
            "type": "SimpleItem",
            "autoContinue": bool(item.autocontinue),
            "command": item.command,
            "doJumpId": number,
            "frame": frame_in_file(item),
            "params": [_json_number(value, number) for value in params_of(item)],
        }
        for number, item in enumerate(redirected(items, lambda target: target + 1), start=1)
    ]
    record = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "Plumbline",
        "mission": {
            "version": 2,
            "firmwareType": mavlink.MAV_AUTOPILOT_PX4,
            "vehicleType": mavlink.MAV_TYPE_QUADROTOR,
            "cruiseSpeed": 15,
            "hoverSpeed": 5,
            "globalPlanAltitudeMode": 1,  # heights above home
            "plannedHomePosition": place,
            "items": entries,
        },
        "geoFence": _fence_record(fence),
        "rallyPoints": {"version": 2, "points": [params_of(item)[4:] for item in rally]},
    }
    return json.dumps(record, indent=4, allow_nan=False) + "\n"


def _numbered_items(entries: list[tuple[dict[str, Any], str]]) -> list[FileItem]:
    """The items of simple entries with their places. Jumps lead to the number of an item in this list, in
    place of the `doJumpId` that it has in the file."""
    items = [_simple(entry, where) for entry, where in entries]
    numbers: dict[int, int] = {}
    for number, (entry, _) in enumerate(entries):
        given = entry.get("doJumpId")
        numbers.setdefault(given if isinstance(given, int) else number + 1, number)
    for item, where in items:
        target = target_of(item)
        if target is not None and target not in numbers:
            raise FormatError(f"{where}: jumps to the item with doJumpId {target}, which there is not")
    moved = redirected((item for item, _ in items), numbers.__getitem__)
    return [FileItem(item, where) for item, (_, where) in zip(moved, items, strict=True)]


def _json_number(value: float, number: int) -> float | None:
    if math.isinf(value):
        raise FormatError(f"item {number - 1}: a parameter is infinite, for which JSON has no number")
    return None if math.isnan(value) else value


def _simple(entry: dict[str, Any], where: str) -> FileItem:
    params = _member(entry, "params", list, f"{where}.params")
    if len(params) != _PARAMS:
        raise FormatError(f"{where}.params: {len(params)} numbers; must be {_PARAMS}")
    numbers = [_number(value, f"{where}.params[{place}]") for place, value in enumerate(params)]
    frame = _integer(entry, "frame", where)
    command = _integer(entry, "command", where)
    autocontinue = entry.get("autoContinue", True) is not False
    return FileItem(item_of(frame, command, 0, int(autocontinue), numbers, where), where)


def _complex(
    entry: dict[str, Any], where: str, not_converted: list[str]
) -> Iterator[tuple[dict[str, Any], str]]:
    """The simple items that a complex one consists of, each with its place in the file."""
    kind = str(entry.get("complexItemType", "?"))
    transect = entry.get(_TRANSECT)
    if not isinstance(transect, dict) or not isinstance(transect.get("Items"), list) or not transect["Items"]:
        not_converted.append(f"{where}: {kind} holds no items; make it of waypoints in the ground station")
        return
    for number, inner in enumerate(transect["Items"]):
        place = f"{where}.{_TRANSECT}.Items[{number}]"
        if not isinstance(inner, dict):
            raise FormatError(f"{place}: must be an object")
        yield inner, place


def _planned_home(mission: dict[str, Any]) -> Home | None:
    """The place from which QGroundControl plans the mission; None if it is not known there."""
    where = "mission.plannedHomePosition"
    place = mission.get("plannedHomePosition")
    if place is None:
        return None
    if not isinstance(place, list) or len(place) != 3:
        raise FormatError(f"{where}: must be a list of 3 numbers")
    latitude, longitude, altitude = (_number(one, where) for one in place)
    if math.isnan(latitude) or math.isnan(longitude):
        return None
    if math.isnan(altitude):  # the height of the ground is not known
        altitude = 0.0
    try:
        return home_from_text(f"{latitude!r},{longitude!r},{altitude!r}")
    except ValueError as error:
        raise FormatError(f"{where}: {error}") from None


def _fence(record: dict[str, Any]) -> tuple[WireItem, ...] | None:
    """The items of the fence, as QGroundControl creates them; None if the file has no fence."""
    if "geoFence" not in record:
        return None
    fence = _member(record, "geoFence", dict, "geoFence")
    if fence.get("polygon"):
        raise FormatError("geoFence.polygon: a fence of an older format; open and save it in QGroundControl")
    items: list[WireItem] = []
    for number, entry in enumerate(_optional_list(fence, "polygons", "geoFence")):
        where = f"geoFence.polygons[{number}]"
        corners = _member(_object(entry, where), "polygon", list, f"{where}.polygon")
        if not corners:
            raise FormatError(f"{where}.polygon: has no corners")
        command = _INSIDE_POLYGON if entry.get("inclusion", True) else _OUTSIDE_POLYGON
        for corner, corner_place in enumerate(corners):
            place = f"{where}.polygon[{corner}]"
            items.append(
                _area_item(
                    _ABOVE_SEA_LEVEL,
                    command,
                    len(corners),
                    (*_coordinates(corner_place, 2, place), 0.0),
                    place,
                )
            )
    for number, entry in enumerate(_optional_list(fence, "circles", "geoFence")):
        where = f"geoFence.circles[{number}]"
        circle = _member(_object(entry, where), "circle", dict, f"{where}.circle")
        command = _INSIDE_CIRCLE if entry.get("inclusion", True) else _OUTSIDE_CIRCLE
        radius = _number(circle.get("radius"), f"{where}.circle.radius")
        centre = _coordinates(circle.get("center"), 2, f"{where}.circle.center")
        items.append(_area_item(_ABOVE_SEA_LEVEL, command, radius, (*centre, 0.0), where))
    if fence.get("breachReturn"):
        return_point = _coordinates(fence["breachReturn"], 3, "geoFence.breachReturn")
        items.append(_area_item(_ABOVE_HOME, _RETURN, 0.0, return_point, "geoFence.breachReturn"))
    return tuple(items)


def _fence_record(items: Sequence[WireItem]) -> dict[str, Any]:
    record: dict[str, Any] = {"version": 2, "circles": [], "polygons": []}
    remaining = list(items)
    while remaining:
        item = remaining[0]
        position = params_of(item)[4:6]
        count = 1
        if item.command in (_INSIDE_POLYGON, _OUTSIDE_POLYGON):
            count = max(int(item.param1), 1)
            corners = [params_of(vertex)[4:6] for vertex in remaining[:count]]
            inclusion = item.command == _INSIDE_POLYGON
            record["polygons"].append({"version": 1, "inclusion": inclusion, "polygon": corners})
        elif item.command in (_INSIDE_CIRCLE, _OUTSIDE_CIRCLE):
            circle = {"center": position, "radius": params_of(item)[0]}
            inclusion = item.command == _INSIDE_CIRCLE
            record["circles"].append({"version": 1, "inclusion": inclusion, "circle": circle})
        elif item.command == _RETURN:
            record["breachReturn"] = params_of(item)[4:]
        del remaining[:count]
    return record


def _rally(record: dict[str, Any]) -> tuple[WireItem, ...] | None:
    if "rallyPoints" not in record:
        return None
    points = _optional_list(_member(record, "rallyPoints", dict, "rallyPoints"), "points", "rallyPoints")
    items = []
    for number, point in enumerate(points):
        where = f"rallyPoints.points[{number}]"
        items.append(
            _area_item(
                _ABOVE_HOME, mavlink.MAV_CMD_NAV_RALLY_POINT, 0.0, _coordinates(point, 3, where), where
            )
        )
    return tuple(items)


def _area_item(frame: int, command: int, first: float, place: Sequence[float], where: str) -> WireItem:
    return item_of(frame, command, 0, 0, [first, 0.0, 0.0, 0.0, *place], where)


def _coordinates(value: Any, size: int, where: str) -> list[float]:
    """Latitude, longitude and, if `size` is three, height."""
    if not isinstance(value, list) or len(value) != size:
        raise FormatError(f"{where}: must be a list of {size} numbers")
    numbers = [_number(one, where) for one in value]
    if any(math.isnan(one) for one in numbers):
        raise FormatError(f"{where}: must be a list of {size} numbers")
    return numbers


def _optional_list(record: dict[str, Any], name: str, where: str) -> list[Any]:
    """A member that is a list; empty if it is missing."""
    value: list[Any] = _member(record, name, list, f"{where}.{name}") if name in record else []
    return value


def _object(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise FormatError(f"{where}: must be an object")
    return value


def _member(record: dict[str, Any], name: str, kind: type, where: str) -> Any:
    value = record.get(name)
    if not isinstance(value, kind):
        raise FormatError(f"{where}: must be {'an object' if kind is dict else 'a list'}")
    return value


def _integer(entry: dict[str, Any], name: str, where: str) -> int:
    value = entry.get(name)
    if not isinstance(value, int) or isinstance(value, bool):
        raise FormatError(f"{where}.{name}: {value!r}; must be a whole number")
    return value


def _number(value: Any, where: str) -> float:
    if value is None:
        return math.nan
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise FormatError(f"{where}: {value!r}; must be a number or null")
    try:
        return float(value)
    except OverflowError:
        raise FormatError(f"{where}: a number of {len(str(value))} digits is too great") from None
