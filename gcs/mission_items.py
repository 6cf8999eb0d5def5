"""A mission as the items that are uploaded. What the vehicle would refuse is an error of the mission file."""

from __future__ import annotations

import re

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import MissionItemError, WireItem, encode_mission, step_index
from gcs.errors import InputError
from missions.model import KINDS, Mission

# not "item 2 of 3", which clearly counts the items of the upload
_ITEM = re.compile(r"\bitem (\d+)\b(?! of \d)", re.IGNORECASE)


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
