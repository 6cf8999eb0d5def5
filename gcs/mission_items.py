"""A mission as the items that are uploaded. What the vehicle would refuse is an error of the mission file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import MissionItemError, WireItem, encode_mission, step_index
from gcs.errors import InputError
from missions.model import KINDS, Mission

# not "item 2 of 3", which clearly counts the items of the upload, nor an item of the fence
_ITEM = re.compile(r"(?<!\bfence )\bitem (\d+)\b(?! of \d)", re.IGNORECASE)
_STEP = re.compile(r"\bitem(?: |s\[)(\d+)\b")


class FileNumbers(NamedTuple):
    """The numbers of the items in a file of another ground station, which also has items that are not sent,
    and items that are no steps to fly."""

    items: tuple[int, ...]  # of each item that is sent
    steps: tuple[int, ...]  # of each step: of its last item

    def of_step(self, step: int) -> int:
        """The number of a step; a file without steps to fly has none, and what is wrong with the vehicle
        itself is told of step 0."""
        return self.steps[step] if self.steps else step

    def in_vehicle_text(self, text: str) -> str:
        """A text of the vehicle, which counts the items that are sent, with the numbers of the file."""
        return _renumbered(text, _ITEM, self.items)

    def in_step_text(self, text: str) -> str:
        """A text that counts steps, with the numbers of the file."""
        return _renumbered(text, _STEP, self.steps)


def _renumbered(text: str, pattern: re.Pattern[str], numbers: Sequence[int]) -> str:
    def in_file(match: re.Match[str]) -> str:
        number = int(match[1])
        return match[0].replace(match[1], str(numbers[number])) if number < len(numbers) else match[0]

    return pattern.sub(in_file, text)


def items_of(mission: Mission, home: Home) -> tuple[WireItem, ...]:
    """The items of a mission; InputError names an item of the file that the vehicle would refuse."""
    try:
        return encode_mission(mission, home)
    except MissionItemError as error:
        step = step_index(error.seq, mission.steps)
        kind = KINDS[type(mission.steps[step])]
        raise InputError(f"{mission.name}: items[{step}] ({kind}): {error.text}") from None


def in_mission_terms(text: str, mission: Mission) -> str:
    """A text of the vehicle, which counts uploaded items. Where the mission file counts differently, because
    signals are uploaded as several items, the number in the file is added."""

    def with_file_number(match: re.Match[str]) -> str:
        step = step_index(int(match[1]), mission.steps)
        return match[0] if step == int(match[1]) else f"{match[0]} (items[{step}] of the mission)"

    return _ITEM.sub(with_file_number, text)
