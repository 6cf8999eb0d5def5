"""A mission as the items that are uploaded. What the vehicle would refuse is an error of the mission file."""

from __future__ import annotations

import re

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import MissionItemError, WireItem, encode_mission, step_of
from gcs.errors import InputError
from missions.model import KINDS, Mission

# not "item 2 of 3", which clearly counts the items of the upload
_ITEM = re.compile(r"\bitem (\d+)\b(?! of \d)", re.IGNORECASE)


def items_of(mission: Mission, home: Home) -> tuple[WireItem, ...]:
    """The items of a mission; InputError names an item of the file that the vehicle would refuse."""
    try:
        return encode_mission(mission, home)
    except MissionItemError as error:
        at = step_of(error.seq, mission.steps)
        kind = KINDS[type(mission.steps[at])]
        raise InputError(f"{mission.name}: items[{at}] ({kind}): {error.text}") from None


def of_mission(said: str, mission: Mission) -> str:
    """A text of the vehicle, which counts uploaded items. Where the mission file counts differently, because
    signals are uploaded as several items, the number in the file is added."""

    def named(found: re.Match[str]) -> str:
        at = step_of(int(found[1]), mission.steps)
        return found[0] if at == int(found[1]) else f"{found[0]} (items[{at}] of the mission)"

    return _ITEM.sub(named, said)
