"""What the vehicle does when its measured battery is low, by COM_LOW_BAT_ACT, as in PX4."""

from __future__ import annotations

from typing import NamedTuple

LAND, RETURN = "land", "return"


class Reaction(NamedTuple):
    """What follows when the battery is nearly empty (BAT_CRIT_THR), and empty (BAT_EMERGEN_THR)."""

    critical: str
    emergency: str


REACTIONS = {2: Reaction(LAND, LAND), 3: Reaction(RETURN, LAND)}  # nothing follows from other values
