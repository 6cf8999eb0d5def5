"""Limits of the values in a mission, each in one place.

The mission file (`missions.schema`) and the items on the wire (`autopilot.wire.items.limits`) use them.

Where the two differ, the file is narrower: the vehicle accepts every value that a file may have.
"""

# least values, the same in a file and on the wire
LOWEST_M = 0.01  # height of the load above home
SLOWEST_M_S = 0.01  # transfers
SHORTEST_RUN_S = 1e-3  # signals and delays; times travel in milliseconds
# The vehicle evaluates its path every few milliseconds: a faster wave or a steeper edge is a typing mistake.
SHORTEST_EDGE_S = 0.1
SHORTEST_PERIOD_S = 0.1
SHORTEST_POINT_S = 0.1  # from one point of a trajectory to the next
MIN_REELED_HEIGHT_M = 0.3  # height of the load after a winch item

# greatest values, the same in a file and on the wire
FASTEST_REEL_M_S = 1.0
LONGEST_CABLE_M = 100.0
MAX_TERMS = 32  # of signals
MAX_FACTORS = 3  # of a term
MAX_POINTS = 1000  # of a trajectory
FARTHEST_POINT_M = 1000.0  # of a trajectory, from its first point

# of a file only: a value beyond them is probably a typing mistake
LONGEST_S = 3600.0
LONGEST_PERIOD_S = 2000.0
FARTHEST_M = 10_000.0
FASTEST_M_S = 20.0
SLOWEST_REEL_M_S = 0.01
FINEST_TOLERANCE_M, COARSEST_TOLERANCE_M = 1e-4, 1.0  # within which a trajectory passes rows
LARGEST_PHASE_DEG = 360.0
LARGEST_TILT_DEG = 89.0
MAX_ITEMS = 1000
LONGEST_TITLE = 120  # characters
