"""Missions as mission items and back, by one table of commands (`table`).

`decode_items(encode_mission(mission, home), home)` equals `mission.steps` up to the resolution of the fields:
float32 (heights, holds, speeds, delays, amplitudes, rises, falls, phases, tilts), milliseconds (starts,
durations and holds of signals), microseconds (periods) and 1e-7 degrees (the place of a waypoint: 5.6 mm).
Items that were made here come back unchanged: `encode(decode(items)) == items`.

Positions are positions of the load. Items that turn the nose are not steps: the nose begins to turn with the
step after them. A jump is flown by flying its items again; one without end leads back to steps before it.
"""

from autopilot.wire.items.command import Command, Handling, is_home
from autopilot.wire.items.decode import (
    ENDLESS,
    JUMPS,
    decode_items,
    endless_loops,
    located_steps,
    read_items,
    unflown_items,
)
from autopilot.wire.items.encode import encode_mission, encode_steps, home_item, step_index
from autopilot.wire.items.heading import turn_heading
from autopilot.wire.items.records import LocatedStep, MissionItemError, Visit, WireItem
from autopilot.wire.items.table import AREA_COMMANDS, COMMAND, COMMANDS, handling_of

__all__ = [
    "AREA_COMMANDS",
    "COMMAND",
    "COMMANDS",
    "ENDLESS",
    "JUMPS",
    "Command",
    "Handling",
    "LocatedStep",
    "MissionItemError",
    "Visit",
    "WireItem",
    "decode_items",
    "encode_mission",
    "encode_steps",
    "endless_loops",
    "handling_of",
    "home_item",
    "is_home",
    "located_steps",
    "read_items",
    "step_index",
    "turn_heading",
    "unflown_items",
]
