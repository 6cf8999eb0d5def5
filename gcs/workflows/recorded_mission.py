"""The mission of a recorded flight, from the items in its log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import MissionItemError, WireItem, located_steps
from gcs.analysis.record import FlightMeta
from gcs.analysis.tracks import Telemetry
from gcs.errors import GcsError
from gcs.mission_files import load
from gcs.mission_items import flown_steps, items_of, loop_ends
from missions.model import Mission

_UNNAMED = "recorded"
_EQUAL_FRAMES = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
}


def recorded_mission(telemetry: Telemetry, meta: FlightMeta) -> Mission | None:
    """The mission that was flown; None if its items are not in the log, or are not all items that can be
    flown.

    A shipped mission, and that of a file that still has these items, is as it is there. Another one is made
    of the items, which state places to 1e-7 degrees, a centimetre, and single precision.
    """
    if not telemetry.mission:
        return None
    if meta.mission:
        try:
            known = load(meta.mission, with_loops=True)
            if same_items(items_of(known, telemetry.home), telemetry.mission):
                return known
        except GcsError:
            pass
    try:
        steps = flown_steps(located_steps(telemetry.mission, telemetry.home))
    except MissionItemError:
        return None
    name = Path(meta.mission or _UNNAMED).stem
    found = tuple(one.step for one in steps)
    return Mission(name, meta.title or name, "", (), found, loop_ends=loop_ends(steps))


def same_items(items: Sequence[WireItem], recorded: Sequence[WireItem]) -> bool:
    """Whether items are those of a log, in which fractions have single precision. A global frame and its
    integer form are the same: places of items are integers in both."""
    if len(items) != len(recorded):
        return False
    items, recorded = (
        [item._replace(frame=_EQUAL_FRAMES.get(item.frame, item.frame)) for item in each]
        for each in (items, recorded)
    )
    for field in WireItem._fields:
        kind = np.int64 if field in ("x", "y") else np.float32
        own, logged = (np.array([getattr(item, field) for item in each], kind) for each in (items, recorded))
        if not np.array_equal(own, logged, equal_nan=True):
            return False
    return True
