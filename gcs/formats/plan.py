"""QGroundControl's .plan: JSON with a mission of simple and complex items, a fence and rally points."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.mission_items import WireItem
from gcs.formats.items import FileItem, FormatError, item_of, params_of

_TRANSECT = "TransectStyleComplexItem"  # surveys and corridors hold the items they stand for
_PARAMS = 7


class Plan(NamedTuple):
    """What is in a file; `lost` are the parts for which there are no mission items, a line each."""

    items: list[FileItem]
    lost: list[str]


def read_plan(text: str) -> Plan:
    """The items of a plan, complex ones taken apart into the simple ones that QGroundControl has stored."""
    try:
        record = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"not JSON: {error}") from None
    if not isinstance(record, dict) or record.get("fileType") != "Plan":
        raise FormatError('"fileType" must be "Plan"')
    mission = _member(record, "mission", dict, "mission")
    items: list[FileItem] = []
    lost: list[str] = []
    for number, entry in enumerate(_member(mission, "items", list, "mission.items")):
        where = f"mission.items[{number}]"
        if not isinstance(entry, dict):
            raise FormatError(f"{where}: must be an object")
        if entry.get("type") == "ComplexItem":
            items += _complex(entry, where, lost)
        elif entry.get("type", "SimpleItem") == "SimpleItem":
            items.append(_simple(entry, where))
        else:
            raise FormatError(f"{where}.type: {entry['type']!r}; must be SimpleItem or ComplexItem")
    lost += _outside(record)
    return Plan(items, lost)


def write_plan(items: Sequence[WireItem], home: Home) -> str:
    """The plan of the items, all of them simple."""
    place = [home.latitude_deg, home.longitude_deg, home.altitude_m]
    entries = [
        {
            "type": "SimpleItem",
            "autoContinue": bool(item.autocontinue),
            "command": item.command,
            "doJumpId": number,
            "frame": item.frame,
            "params": [_told(value, number) for value in params_of(item)],
        }
        for number, item in enumerate(items, start=1)
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
        "geoFence": {"version": 2, "circles": [], "polygons": []},
        "rallyPoints": {"version": 2, "points": []},
    }
    return json.dumps(record, indent=4, allow_nan=False) + "\n"


def _told(value: float, number: int) -> float | None:
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


def _complex(entry: dict[str, Any], where: str, lost: list[str]) -> Iterator[FileItem]:
    kind = str(entry.get("complexItemType", "?"))
    transect = entry.get(_TRANSECT)
    if not isinstance(transect, dict) or not isinstance(transect.get("Items"), list):
        lost.append(f"{where}: {kind} holds no items; make it of waypoints in the ground station")
        return
    for number, inner in enumerate(transect["Items"]):
        place = f"{where}.{_TRANSECT}.Items[{number}]"
        if not isinstance(inner, dict):
            raise FormatError(f"{place}: must be an object")
        yield _simple(inner, place)


def _outside(record: dict[str, Any]) -> list[str]:
    """Fence and rally points, which the vehicle does not keep."""
    lost = []
    fence, rally = record.get("geoFence"), record.get("rallyPoints")
    if isinstance(fence, dict):
        for kind in ("polygons", "circles"):
            count = len(fence.get(kind) or ())
            if count:
                lost.append(f"geoFence.{kind}: {count}; the vehicle keeps no fence")
        if fence.get("breachReturn"):
            lost.append("geoFence.breachReturn: the vehicle keeps no fence")
    if isinstance(rally, dict) and rally.get("points"):
        lost.append(f"rallyPoints.points: {len(rally['points'])}; the vehicle keeps no rally points")
    return lost


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
    return float(value)
