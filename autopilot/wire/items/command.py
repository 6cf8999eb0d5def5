"""A row of the table of mission commands, and an item that is read by such a row."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.trajectory.timeline import MissionState
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.fields import NOT_GIVEN, Field
from autopilot.wire.items.limits import HOME_ITEM_RADIUS_M
from autopilot.wire.items.records import (
    ABSOLUTE_FRAMES,
    FRAME_MISSION,
    GLOBAL_FRAMES,
    PLACE_FRAMES,
    MissionItemError,
    WireItem,
    wrong_frame,
)
from missions.model import HeadingCommand, Step

_NO_PLACE = ((0, 0), (NOT_GIVEN, NOT_GIVEN))  # x and y of an item that names no place


def is_home(item: WireItem, origin: Home, home: Vec3) -> bool:
    """Whether a waypoint as item 0 is home, which is at `home` (m, ENU from the origin) on the ground. Above
    home its height is 0: a greater one is that of a waypoint over home."""
    if item.frame not in GLOBAL_FRAMES:
        return False
    east, north, _ = enu_from_geodetic(item.x, item.y, 0, origin)
    if item.frame in ABSOLUTE_FRAMES:
        on_ground = abs(item.z - origin.altitude_m) < HOME_ITEM_RADIUS_M
    else:
        on_ground = item.z == 0.0
    return on_ground and math.hypot(east - home[0], north - home[1]) < HOME_ITEM_RADIUS_M


class Handling(Enum):
    """What becomes of an item."""

    FLOWN = "flown"
    KEPT = "kept"  # stored and returned on download, but not flown
    REFUSED = "refused"


@dataclass(frozen=True)
class Command:
    """A command: what becomes of it, its parameters, and what is flown."""

    number: int
    text: str  # what is flown, or why not
    fields: tuple[Field, ...] = ()
    record_type: type[Any] | None = None  # the record that its fields make: a step, or part of one
    is_default: bool = False  # the record is written as this command
    constants: Mapping[str, float] = field(default_factory=dict)  # written beside the fields
    read_steps: Callable[[ItemContext], Iterable[Step]] | None = None  # None: one record of all fields
    # for a command that turns the vehicle
    heading_command: Callable[[ItemContext], HeadingCommand] | None = None
    mission_frame: bool = False  # its frame must be MAV_FRAME_MISSION
    needs_load: bool = False  # refused after a release
    handling: Handling = Handling.FLOWN


@dataclass(frozen=True)
class ItemContext:
    """An item, the row of its command, and the state after the items before it."""

    seq: int
    item: WireItem
    home: Home
    state: MissionState
    command: Command

    def __getitem__(self, attribute: str) -> Any:
        """The value that its parameters give for an attribute, checked against the limits."""
        one = next(one for one in self.command.fields if attribute in one.attributes)
        return one.read(self.seq, self.item, self.home)[one.attributes.index(attribute)]

    def record(self) -> Any:
        """The record that the command makes from all its fields."""
        assert self.command.record_type is not None, self.command.number
        values: dict[str, Any] = {}
        for one in self.command.fields:
            values |= zip(one.attributes, one.read(self.seq, self.item, self.home), strict=True)
        return self.command.record_type(**values)

    def expect_frame(self) -> None:
        """MissionItemError if the command requires MAV_FRAME_MISSION and the item has another frame."""
        if self.command.mission_frame and self.item.frame != FRAME_MISSION:
            raise wrong_frame(self.seq, self.item, (FRAME_MISSION,))

    def expect_load(self) -> None:
        """MissionItemError if the load is released: signals, attitude runs and the winch move a load."""
        if self.state.released:
            raise self.refusal("needs the load, which an item before it has released")

    def has_position(self) -> bool:
        """Whether the item names a place."""
        return self.item.frame in PLACE_FRAMES and (self.item.x, self.item.y) not in _NO_PLACE

    def is_home_item(self) -> bool:
        """Whether the item is home as item 0, as MAVProxy and Mission Planner write it, current or not."""
        return self.seq == 0 and is_home(self.item, self.home, ZERO)

    def refusal(self, text: str, result: int = mavlink.MAV_MISSION_INVALID) -> MissionItemError:
        """The error that refuses this item."""
        return MissionItemError(self.seq, text, result)
