"""MAVLink carries what a mission file accepts: every number at each of its limits, and just inside them."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, nextafter
from typing import Any

import pytest

from autopilot.trajectory.timeline import expected_duration_s
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import decode_items, encode_mission
from gcs.errors import InputError
from gcs.mission_items import items_of
from missions.fileformat import MissionFileError, mission_of
from missions.limits import MAX_FACTORS, MAX_TERMS
from missions.schema import ITEMS, SineSpec, Spec, TermSpec

HOME = Home(47.397742, 8.545594, 488.0)
FACTOR = {"period_s": 3.0, "phase_deg": 0.0, "start_s": 0.0}
TERM = {"axis": "z", "amplitude_m": 0.1, "start_s": 0.0, "rise_s": 2.0, "hold_s": 1.0, "fall_s": 2.0}
EXAMPLES: dict[str, dict[str, Any]] = {
    "takeoff": {"altitude_m": 2.0},
    "waypoint": {"east_m": 1.0, "north_m": 1.0, "altitude_m": 2.0, "hold_s": 0.0},
    "speed": {"speed_m_s": 1.0},
    "delay": {"duration_s": 1.0},
    "signals": {"duration_s": 9.0, "terms": [TERM]},
    "attitude": {"controlled": "load", "tilt_north_deg": 1.0, "tilt_east_deg": 1.0, "duration_s": 1.0},
    "winch": {"length_m": 0.1, "speed_m_s": 0.2},
}


def bound(spec: type[Spec], key: str, low: bool) -> float:
    """A limit of the key, or the nearest number to it that is allowed."""
    names = ("ge", "gt") if low else ("le", "lt")
    field = spec.model_fields[key]
    rules = list(field.metadata)
    if not rules:  # the rules of an optional number are inside its annotation
        rules = [rule for one in field.annotation.__args__ for rule in getattr(one, "__metadata__", ())]
        rules = [inner for rule in rules for inner in getattr(rule, "metadata", [rule])]
    inclusive, exclusive = (
        next((getattr(rule, name) for rule in rules if getattr(rule, name, None) is not None), None)
        for name in names
    )
    if inclusive is not None:
        return float(inclusive)
    assert exclusive is not None, f"{spec.__name__}.{key} has no limit {'below' if low else 'above'}"
    return nextafter(exclusive, inf if low else -inf)


def numbers() -> Iterator[tuple[str, type[Spec], str]]:
    """(kind of item, table, key) of every number in a mission file."""
    for kind, item in ITEMS.items():
        tables = (item, TermSpec, SineSpec) if kind == "signals" else (item,)
        for spec in tables:
            for key in spec.model_fields:
                is_sent = key != "tolerance_m"  # of reading a file
                if is_sent and key.rsplit("_", 1)[-1] in ("m", "s", "deg"):
                    yield kind, spec, key


def with_value(kind: str, spec: type[Spec], key: str, value: float) -> list[dict[str, Any]]:
    """A mission whose one item of this kind has the value."""
    item = dict(EXAMPLES.get(kind, {}))
    if spec is TermSpec:
        item["terms"] = [TERM | {key: value}]
    elif spec is SineSpec:
        item["terms"] = [TERM | {"factors": [FACTOR | {key: value}]}]
    else:
        item[key] = value
    up, down = {"type": "takeoff", "altitude_m": 200.0}, {"type": "land"}
    return [{"type": kind, **item}, down] if kind == "takeoff" else [up, {"type": kind, **item}, down]


@pytest.mark.parametrize("low", [True, False], ids=["low", "high"])
@pytest.mark.parametrize(
    ("kind", "spec", "key"), list(numbers()), ids=[f"{kind}.{s.__name__}.{key}" for kind, s, key in numbers()]
)
def test_what_the_file_accepts_the_wire_carries(kind: str, spec: type[Spec], key: str, low: bool) -> None:
    limit = bound(spec, key, low)
    for value in (limit, nextafter(limit, inf if low else -inf)):
        mission = mission_of({"title": "T", "items": with_value(kind, spec, key, value)}, "m", "m.toml")
        steps = decode_items(encode_mission(mission, HOME), HOME)
        assert [type(step) for step in steps] == [type(step) for step in mission.steps]
        assert 0.0 < expected_duration_s(mission) < inf
    beyond = nextafter(limit, -inf if low else inf)
    with pytest.raises(MissionFileError, match=f"{key} = .*must be"):
        mission_of({"title": "T", "items": with_value(kind, spec, key, beyond)}, "m", "m.toml")


@pytest.mark.parametrize(
    ("items", "said"),
    [
        (
            [{"type": "winch", "length_m": 1.9}],
            r"m: items\[1\] \(winch\): it would leave the load at 0\.10 m",
        ),
        (
            [
                {
                    "type": "signals",
                    "duration_s": 9.0,
                    "terms": [TERM | {"factors": [FACTOR] * MAX_FACTORS}] * MAX_TERMS,
                }
            ]
            * 32,
            r"m: items\[16\] \(signals\): the mission becomes 4130 items; a vehicle keeps 2000 at most",
        ),
    ],
)
def test_what_only_the_vehicle_refuses_is_an_error_of_the_file(
    items: list[dict[str, Any]], said: str
) -> None:
    whole = [{"type": "takeoff", "altitude_m": 2.0}, *items, {"type": "land"}]
    with pytest.raises(InputError, match=said):
        items_of(mission_of({"title": "T", "items": whole}, "m", "m.toml"), HOME)
