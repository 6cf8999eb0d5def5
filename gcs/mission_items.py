"""A mission as the items that are uploaded. What the vehicle would refuse is an error of the mission file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot
from typing import NamedTuple

from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import (
    LocatedStep,
    MissionItemError,
    WireItem,
    encode_mission,
    endless_jump_target,
    located_steps,
    step_index,
)
from gcs.errors import InputError
from missions.model import KINDS, Land, Mission, ReturnHome

# not "item 2 of 3", which clearly counts the items of the upload, nor an item of the fence
_ITEM = re.compile(r"(?<!\bfence )\bitem (\d+)\b(?! of \d)", re.IGNORECASE)
_SAME_HOME_M = 1.0
_STEP = re.compile(r"\bitem(?: |s\[)(\d+)\b")


class FileNumbers(NamedTuple):
    """The numbers of the items in a file of another ground station, which also has items that are not sent,
    and items that are no steps to fly."""

    items: tuple[int, ...]  # of each item that is sent
    steps: tuple[int, ...]  # of each step: of its last item

    def in_vehicle_text(self, text: str) -> str:
        """A text of the vehicle, which counts the items that are sent, with the numbers of the file."""
        return _renumbered(text, _ITEM, self.items)


@dataclass(frozen=True, slots=True)
class ForeignMission(Mission):
    """The mission in a file of another ground station: with its items as they are sent, which also say what
    steps do not (headings, commands that are kept but not done), and its fence and rally points, None if the
    file does not mention them. `home` is that for which it was planned.

    `left_out`: a line for each part of the file that the vehicle would refuse, and that is not among the
    items; `notes`: a line for each part that is not flown.
    """

    items: tuple[WireItem, ...]
    fence: tuple[WireItem, ...] | None
    rally: tuple[WireItem, ...] | None
    home: Home
    numbers: FileNumbers
    left_out: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def areas(self) -> dict[int, tuple[WireItem, ...]]:
        """Fence and rally points that the file mentions, by their MAV_MISSION_TYPE."""
        lists = {
            mavlink.MAV_MISSION_TYPE_FENCE: self.fence,
            mavlink.MAV_MISSION_TYPE_RALLY: self.rally,
        }
        return {kind: items for kind, items in lists.items() if items is not None}

    @property
    def ends_on_ground(self) -> bool:
        """Whether the mission ends with a landing, or with a return as its last step, which also lands."""
        if any(isinstance(step, Land) for step in self.steps):
            return True
        returns = any(isinstance(step, ReturnHome) for step in self.steps[-1:])
        return returns and endless_jump_target(self.items, located_steps(self.items, self.home)) is None


def flown_steps(steps: Sequence[LocatedStep]) -> tuple[LocatedStep, ...]:
    """The steps up to the first landing, with which a mission ends."""
    landing = next((i for i, one in enumerate(steps) if isinstance(one.step, Land)), len(steps))
    return tuple(steps[: landing + 1])


def at_home(mission: Mission, home: Home) -> Mission:
    """The mission as it is flown from another home: items of a file of another ground station stay where they
    are, and an absolute altitude becomes another height. InputError if one cannot be flown from there."""
    if not isinstance(mission, ForeignMission) or mission.home == home:
        return mission
    try:
        steps = flown_steps(located_steps(mission.items, home))
    except MissionItemError as error:
        number = mission.numbers.items[error.seq] if error.seq < len(mission.items) else error.seq
        raise InputError(f"{mission.name}: item {number}, from the vehicle's home: {error.text}") from None
    return replace(mission, steps=tuple(one.step for one in steps), home=home)


def home_difference(planned: Home, home: Home) -> str:
    """The text that a mission was planned for another home than the vehicle's; empty if it was not."""
    east, north, up = enu_from_geodetic(
        round(1e7 * planned.latitude_deg),
        round(1e7 * planned.longitude_deg),
        round(1e3 * planned.altitude_m),
        home,
    )
    if max(hypot(east, north), abs(up)) <= _SAME_HOME_M:
        return ""
    return (
        f"planned for a home {hypot(east, north):.0f} m from the vehicle's and {abs(up):.0f} m "
        f"{'higher' if up > 0.0 else 'lower'}: absolute altitudes and the way to the first item are others "
        "than planned"
    )


def home_text(home: Home) -> str:
    """The text that says from which home a mission is flown."""
    return f"flown with home at {home.latitude_deg:.7f}, {home.longitude_deg:.7f}, {home.altitude_m:g} m"


def home_of(mission: Mission) -> Home:
    """The home from which a mission is flown in simulation."""
    return mission.home if isinstance(mission, ForeignMission) else Home()


def areas_of(mission: Mission) -> dict[int, tuple[WireItem, ...]]:
    """Fence and rally points that come with a mission, by their MAV_MISSION_TYPE."""
    return mission.areas if isinstance(mission, ForeignMission) else {}


def _renumbered(text: str, pattern: re.Pattern[str], numbers: Sequence[int]) -> str:
    def in_file(match: re.Match[str]) -> str:
        number = int(match[1])
        return match[0].replace(match[1], str(numbers[number])) if number < len(numbers) else match[0]

    return pattern.sub(in_file, text)


def items_of(mission: Mission, home: Home) -> tuple[WireItem, ...]:
    """The items of a mission; InputError names an item of the file that the vehicle would refuse. Those of a
    file of another ground station stay where they are, whatever the home."""
    if isinstance(mission, ForeignMission):
        return mission.items
    try:
        return encode_mission(mission, home)
    except MissionItemError as error:
        step = step_index(error.seq, mission.steps)
        kind = KINDS[type(mission.steps[step])]
        raise InputError(f"{mission.name}: items[{step}] ({kind}): {error.text}") from None


def step_in_file(step: int, mission: Mission) -> int:
    """The number of a step in the file of its mission. A file without steps to fly has none, and what is
    wrong with the vehicle itself is told of step 0."""
    numbers = mission.numbers.steps if isinstance(mission, ForeignMission) else ()
    return numbers[step] if numbers else step


def in_file_terms(text: str, mission: Mission) -> str:
    """A text that counts the steps of a mission, with the numbers of its file."""
    return _renumbered(text, _STEP, mission.numbers.steps) if isinstance(mission, ForeignMission) else text


def in_mission_terms(text: str, mission: Mission) -> str:
    """A text of the vehicle, which counts uploaded items. Where the mission file counts differently, because
    signals are uploaded as several items, the number in the file is added. A file of another ground station
    has its own numbers."""
    if isinstance(mission, ForeignMission):
        return mission.numbers.in_vehicle_text(text)

    def with_file_number(match: re.Match[str]) -> str:
        step = step_index(int(match[1]), mission.steps)
        return match[0] if step == int(match[1]) else f"{match[0]} (items[{step}] of the mission)"

    return _ITEM.sub(with_file_number, text)
