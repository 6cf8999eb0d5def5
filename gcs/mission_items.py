"""A mission as the items that are uploaded. What the vehicle would refuse is an error of the mission file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from math import hypot

from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import (
    LocatedStep,
    MissionItemError,
    WireItem,
    encode_mission,
    endless_loops,
    located_steps,
    step_index,
)
from gcs.errors import InputError
from gcs.foreign_mission import ForeignMission
from missions.model import KINDS, Land, Mission, ReturnHome

# not "item 2 of 3", which clearly counts the items of the upload, nor an item of the fence
_ITEM = re.compile(r"(?<!\bfence )\bitem (\d+)\b(?! of \d)", re.IGNORECASE)
_SAME_HOME_M = 1.0
_STEP = re.compile(r"\bitem(?: |s\[)(\d+)\b")


def flown_steps(steps: Sequence[LocatedStep]) -> tuple[LocatedStep, ...]:
    """The steps up to the first landing, with which a mission ends."""
    landing = next((i for i, one in enumerate(steps) if isinstance(one.step, Land)), len(steps))
    return tuple(steps[: landing + 1])


def loop_ends(steps: Sequence[LocatedStep]) -> tuple[int, ...]:
    """The last step of each loop without end."""
    return tuple(endless_loops(steps))


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
    found = tuple(one.step for one in steps)
    return replace(mission, steps=found, loop_ends=loop_ends(steps), home=home)


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


def areas_of(mission: Mission) -> dict[int, tuple[WireItem, ...]]:
    """Fence and rally points that come with a mission, by their MAV_MISSION_TYPE."""
    if not isinstance(mission, ForeignMission):
        return {}
    lists = {mavlink.MAV_MISSION_TYPE_FENCE: mission.fence, mavlink.MAV_MISSION_TYPE_RALLY: mission.rally}
    return {kind: items for kind, items in lists.items() if items is not None}


def ends_on_ground(mission: ForeignMission) -> bool:
    """Whether the last step is a landing, or a return, which then lands."""
    match mission.steps[-1:]:
        case (Land(),):
            return True
        case (ReturnHome(),):
            return len(mission.steps) - 1 not in mission.loop_ends
    return False


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
        where = mission.locations[step] if mission.locations else mission.name
        raise InputError(f"{where}: items[{step}] ({kind}): {error.text}") from None


def step_in_file(step: int, mission: Mission) -> int:
    """The number of a step in the file of its mission. A file without steps to fly has none, and what is
    wrong with the vehicle itself is told of step 0."""
    numbers = mission.numbers.steps if isinstance(mission, ForeignMission) else ()
    return numbers[step] if numbers else step


def problem_in_file(step: int, text: str, mission: Mission) -> str:
    """A text about a step, with file and line of the step or the numbers of a file of another ground
    station. What is wrong with the vehicle itself names no item."""
    where = f"{mission.locations[step]}: " if mission.locations and text.startswith("items[") else ""
    return where + in_file_terms(text, mission)


def in_file_terms(text: str, mission: Mission) -> str:
    """A text that counts the steps of a mission, with the numbers of its file."""
    return _renumbered(text, _STEP, mission.numbers.steps) if isinstance(mission, ForeignMission) else text


def in_mission_terms(text: str, mission: Mission) -> str:
    """A text of the vehicle, which counts uploaded items. Where the mission file counts differently, because
    signals are uploaded as several items, the number in the file is added. A file of another ground station
    has its own numbers."""
    if isinstance(mission, ForeignMission):
        return _renumbered(text, _ITEM, mission.numbers.items)

    def with_file_number(match: re.Match[str]) -> str:
        step = step_index(int(match[1]), mission.steps)
        return match[0] if step == int(match[1]) else f"{match[0]} (items[{step}] of the mission)"

    return _ITEM.sub(with_file_number, text)
