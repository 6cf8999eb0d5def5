"""Steps to mission items, by the table of commands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Any

from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.command import Command
from autopilot.wire.items.decode import located_steps
from autopilot.wire.items.fields import WIRE_FIELD, Height, Place
from autopilot.wire.items.limits import MAX_ITEMS
from autopilot.wire.items.records import FRAME_MISSION, FRAME_RELATIVE, MissionItemError, WireItem
from autopilot.wire.items.table import COMMANDS
from autopilot.wire.parameter_table import float32
from missions.model import Mission, Signals, Step, Trajectory

_DEFAULT_COMMAND: dict[type[Any], Command] = {
    row.record_type: row for row in COMMANDS if row.record_type and row.is_default
}


def home_item(home: Home) -> WireItem:
    """The home as item 0, as ArduPilot and files of other ground stations have it."""
    x, y, _ = geodetic_from_enu((0.0, 0.0, 0.0), home)
    frame, command = mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_NAV_WAYPOINT
    return WireItem(frame, command, 1, 1, 0.0, 0.0, 0.0, 0.0, x, y, home.altitude_m)


def encode_mission(mission: Mission, home: Home) -> tuple[WireItem, ...]:
    """The items of a mission; MissionItemError if a number does not fit its field or cannot be flown."""
    return encode_steps(mission.steps, home)


def encode_steps(steps: Sequence[Step], home: Home) -> tuple[WireItem, ...]:
    """The items of the steps."""
    items: list[WireItem] = []
    for step in steps:
        items.extend([_item(record, home, len(items)) for record in _records(step)])
    if len(items) > MAX_ITEMS:
        text = f"the mission becomes {len(items)} items; a vehicle keeps {MAX_ITEMS} at most"
        raise MissionItemError(MAX_ITEMS, text, mavlink.MAV_MISSION_NO_SPACE)
    located_steps(items, home)  # raises if the vehicle would refuse the items
    return tuple(items)


def step_index(seq: int, steps: Sequence[Step]) -> int:
    """Index of the step to which item `seq` belongs, of the items that `encode_steps` makes of the steps."""
    ends = accumulate(len(tuple(_records(step))) for step in steps)
    return next((index for index, end in enumerate(ends) if seq < end), max(len(steps) - 1, 0))


def _records(step: Step) -> Iterator[Any]:
    """The records that have separate items: the step, for signals after their terms and factors; of a
    trajectory its points."""
    if isinstance(step, Signals):
        for term in step.terms:
            yield term
            yield from term.factors
    if isinstance(step, Trajectory):
        yield from step.points
    else:
        yield step


def _item(record: Any, home: Home, seq: int) -> WireItem:
    """The item of a step, term or factor."""
    row = _DEFAULT_COMMAND[type(record)]
    wire = {**dict.fromkeys(WIRE_FIELD, 0.0), **row.constants}
    frame = FRAME_MISSION
    for field in row.fields:
        if all(hasattr(record, attribute) for attribute in field.attributes):
            wire |= field.write(seq, home, *(getattr(record, attribute) for attribute in field.attributes))
            frame = FRAME_RELATIVE if isinstance(field, Place | Height) else frame
    p1, p2, p3, p4, z = (float32(wire[name]) for name in (*WIRE_FIELD[:4], "z"))
    return WireItem(frame, row.number, 0, 1, p1, p2, p3, p4, int(wire["x"]), int(wire["y"]), z)
