"""The winch from tick to tick while it reels, laid out in advance with the setpoints of a stretch.

The cable is then known for every tick until the next decision, so that machine code can fly these ticks. What
each tick receives is what `autopilot.core.flight_core.with_cable_now` gives tick by tick, to the bit.
"""

from __future__ import annotations

import numpy as np

from autopilot.control.records import Cable
from autopilot.core.tick import CoreRows, Winch, row_at
from autopilot.estimation.records import Array
from autopilot.geometry.kernel import kernel
from autopilot.geometry.packed import pack, unpack, with_field
from autopilot.guidance.jet_table import Floats, jets
from autopilot.guidance.legs import Reel
from autopilot.supervisor.quiescence import Stretch
from autopilot.supervisor.state import CableState

# columns, of each tick: the cable's length (m), rate (m/s), acceleration (m/s^2) and growth since the last
# tick (m), its length (m) from load to vehicle when it is taut, the rate (m/s) to reach by the next tick
LENGTH, RATE, ACCEL, GROWTH, TAUT_LENGTH, COMMANDED_RATE = range(6)
_COLUMNS = 6
NOT_REELING: Array = np.zeros((0, _COLUMNS))


def reeling_table(leg: Reel, times_s: Floats, cable: CableState, period_s: float) -> Array:
    """(ticks, 6) the winch at each of these times (s into the leg), which are `period_s` apart.

    The first of them is the tick at which the supervisor decided: `cable` is the cable at this tick.
    """
    z = 2
    motion = jets(leg, times_s)
    table = np.zeros((len(times_s), _COLUMNS))
    table[:, LENGTH] = leg.top_m - motion[:, z]
    table[:, RATE], table[:, ACCEL] = -motion[:, 3 + z], -motion[:, 6 + z]
    before = table[:-1, LENGTH].copy()
    if cable.length_m is not None:
        before[:1] = cable.length_m
    table[1:, GROWTH] = table[1:, LENGTH] - before
    if cable.length_m is None:  # the winch has not worked yet: the leg begins with the length of the cable
        table[1:2, GROWTH] = 0.0
    table[0, TAUT_LENGTH] = cable.taut_length_m
    table[1:, TAUT_LENGTH] = table[1:, GROWTH]
    table[:, TAUT_LENGTH] = np.cumsum(table[:, TAUT_LENGTH])
    table[:, COMMANDED_RATE] = -jets(leg, times_s + period_s)[:, 3 + z]
    return table


@kernel
def move_winch(rows: CoreRows, table: Array, now_us: int) -> None:
    """Set the cable, and the length at which it is taut, to those of this tick in the table of the stretch;
    without a row of this tick, nothing changes."""
    stretch = unpack(Stretch, rows.stretch, 0)
    at = row_at(stretch, now_us)
    if not 1 <= at < table.shape[0]:
        return
    cable = Cable(table[at, LENGTH], table[at, RATE], table[at, ACCEL])
    released = unpack(Winch, rows.winch, 0).released
    pack(Winch(cable, table[at, GROWTH], released), rows.winch, 0)
    pack(with_field(stretch, "taut_length", table[at, TAUT_LENGTH]), rows.stretch, 0)


@kernel
def commanded_rate_at(rows: CoreRows, table: Array, now_us: int) -> float:
    """Rate (m/s) that the winch is to reach by the end of the period that begins now, by this table."""
    at = row_at(unpack(Stretch, rows.stretch, 0), now_us)
    return table[at, COMMANDED_RATE] if 0 <= at < table.shape[0] else 0.0
