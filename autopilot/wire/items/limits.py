"""Limits of mission items. Those that files share are in `missions.limits`; a file allows no wider ones."""

from missions.limits import (
    FASTEST_REEL_M_S,
    LONGEST_CABLE_M,
    LOWEST_M,
    MAX_FACTORS,
    MAX_POINTS,
    MAX_TERMS,
    MIN_REELED_HEIGHT_M,
    SHORTEST_EDGE_S,
    SHORTEST_PERIOD_S,
    SHORTEST_POINT_S,
    SHORTEST_RUN_S,
    SLOWEST_M_S,
)

__all__ = [
    "FARTHEST_M",
    "FASTEST_M_S",
    "FASTEST_REEL_M_S",
    "HOME_ITEM_RADIUS_M",
    "LARGEST_PHASE_RAD",
    "LARGEST_TAG",
    "LONGEST_CABLE_M",
    "LONGEST_S",
    "LOWEST_M",
    "MAX_FACTORS",
    "MAX_FLOWN_ITEMS",
    "MAX_ITEMS",
    "MAX_JUMPS",
    "MAX_POINTS",
    "MAX_RADIUS_M",
    "MAX_TERMS",
    "MAX_TURNS",
    "MIN_REELED_HEIGHT_M",
    "SHORTEST_EDGE_S",
    "SHORTEST_PERIOD_S",
    "SHORTEST_POINT_S",
    "SHORTEST_RUN_S",
    "SLOWEST_M_S",
    "TURN_ACCEL_M_S2",
]

LONGEST_S = 86400.0
LARGEST_PHASE_RAD = 100.0
LARGEST_TAG = 65535.0  # of a jump
MAX_ITEMS = 2000  # of a stored mission
FARTHEST_M = 100_000.0  # from home, as far as the earth may be assumed flat
FASTEST_M_S = 100.0
MAX_JUMPS = 1000  # repetitions of one jump
MAX_FLOWN_ITEMS = 4000  # items, each repetition by a jump counted
MAX_TURNS, MAX_RADIUS_M = 1000.0, 1000.0
TURN_ACCEL_M_S2 = 1.0  # centripetal
HOME_ITEM_RADIUS_M = 1.0  # distance from home within which item 0 is home
