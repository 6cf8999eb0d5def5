"""A mission item as it is transferred, the step it describes, and the error for an item that is refused."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.wire.command_names import numbered_name
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import HeadingCommand, Step

END = 2**31  # instead of a step: none follows
FRAME_MISSION = mavlink.MAV_FRAME_MISSION
FRAME_RELATIVE = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
ABSOLUTE_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
GLOBAL_FRAMES = (*ABSOLUTE_FRAMES, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, FRAME_RELATIVE)
PLACE_FRAMES = (*GLOBAL_FRAMES, mavlink.MAV_FRAME_LOCAL_NED)


class WireItem(NamedTuple):
    """The fields of MISSION_ITEM_INT that belong to the item and not to its transfer."""

    frame: int
    command: int
    current: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float


class LocatedStep(NamedTuple):
    """A step and the items it was made of: `first` ... `last`, both included."""

    first: int
    last: int
    step: Step
    # the heading commands given one after the other as the step begins, each with its item
    aims: tuple[tuple[int, HeadingCommand], ...] = ()
    # index of the step that follows instead of the next one, to which a jump without end leads, or END; the
    # next one begins wherever the loop is left
    then: int | None = None


class Visit(NamedTuple):
    """A time at which the mission comes to an item."""

    item: int
    step: int  # the step that is flown then: of the item, of where it jumps to, or of one behind it
    lap: int  # the same number for all visits between which no jump is taken or counted


class MissionItemError(ValueError):
    """An item that is refused; `result` is the MAV_MISSION_RESULT to answer with, `noun` names the item."""

    def __init__(self, seq: int, text: str, result: int, noun: str = "mission item") -> None:
        super().__init__(f"{noun} {seq}: {text}")
        self.seq = seq
        self.text = text
        self.result = result


def wrong_frame(seq: int, item: WireItem, allowed: tuple[int, ...]) -> MissionItemError:
    """The error for an item whose frame is not allowed."""
    frames = " or ".join(map(str, sorted(allowed)))
    text = f"frame {item.frame}; must be {frames} for {numbered_name(item.command)}"
    return MissionItemError(seq, text, mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
