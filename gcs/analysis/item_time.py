"""For how long the present mission item has been flown, or the present phase has lasted.

LOAD_SETPOINT states the time in the present leg: a waypoint with a hold has two, and an item that is resumed
after a pause has another. The times here continue over the legs of an item, and after a pause where it was
interrupted.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from gcs.analysis.axes import Floats
from gcs.analysis.samples import CARRIED, MISSION, UNKNOWN
from gcs.analysis.tracks import Ints, ItemTrack, SetpointTrack

_NEW_LEG_S = 1e-3  # by which the beginnings of two legs differ at least; `elapsed_s` is rounded to less
_REACHED_S = 0.5  # between the end of an item and the capture of the message that states it


def item_began_s(setpoint: SetpointTrack, reached: ItemTrack) -> Floats:
    """(n,) for each setpoint, the time at which its item would have begun if it had not been interrupted, or
    at which its phase began; NaN where the vehicle does not state it."""
    leg_began_s = setpoint.time_s - setpoint.elapsed_s
    in_mission = setpoint.phase == MISSION
    item = np.where(in_mission, setpoint.item, UNKNOWN)
    began_s = leg_began_s.copy()
    flown_item, flown_s = UNKNOWN, 0.0  # the item that was interrupted, and for how long it was flown
    for first, end in pairwise([*_run_starts(setpoint.phase, item, leg_began_s, reached), len(item)]):
        run_began_s = float(leg_began_s[first])
        if in_mission[first]:
            is_resumed = first > 0 and not in_mission[first - 1] and item[first] == flown_item
            run_began_s -= flown_s if is_resumed else 0.0
            flown_item = int(item[first])
            flown_s = float(leg_began_s[end]) - run_began_s if end < len(item) else 0.0
        elif setpoint.phase[first] not in CARRIED:
            flown_item = UNKNOWN
        began_s[first:end] = run_began_s
    return began_s


def _run_starts(phase: Ints, item: Ints, leg_began_s: Floats, reached: ItemTrack) -> list[int]:
    """Indices of the setpoints with which an item or a phase begins; also an item that a jump repeats."""
    if not len(item):
        return []
    changes = (np.diff(phase) != 0) | (np.diff(item) != 0)
    starts = {0, *(np.flatnonzero(changes) + 1).tolist()}
    legs = np.flatnonzero(changes | (np.diff(leg_began_s) > _NEW_LEG_S)) + 1
    for time_s, reached_item in zip(reached.time_s.tolist(), reached.item.tolist(), strict=True):
        if len(legs):
            nearest = int(legs[np.argmin(np.abs(leg_began_s[legs] - time_s))])
            is_of_item = item[nearest] == item[nearest - 1] == reached_item
            if is_of_item and abs(leg_began_s[nearest] - time_s) < _REACHED_S:
                starts.add(nearest)
    return sorted(starts)
