"""A mission as the items that are uploaded. What the vehicle would refuse of it is an error of its file."""

from __future__ import annotations

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import MissionItemError, WireItem, encode_mission, step_of
from gcs.errors import InputError
from missions.model import KINDS, Mission


def items_of(mission: Mission, home: Home) -> tuple[WireItem, ...]:
    """The items; InputError names the item of the file that the vehicle would refuse."""
    try:
        return encode_mission(mission, home)
    except MissionItemError as error:
        at = step_of(error.seq, mission.steps)
        kind = KINDS[type(mission.steps[at])]
        raise InputError(f"{mission.name}: items[{at}] ({kind}): {error.text}") from None
