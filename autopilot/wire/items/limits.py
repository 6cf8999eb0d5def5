"""Limits of what is flown; those of the mission file where it has them."""

MOST_TERMS = 32
MOST_FACTORS = 3
SHORTEST_EDGE_S = 0.1
SHORTEST_PERIOD_S = 0.1
SHORTEST_RUN_S = 1e-3
LONGEST_S = 86400.0
LARGEST_PHASE_RAD = 100.0
FARTHEST_M = 100_000.0  # from home, as far as the earth may be taken as flat
LOWEST_M = 0.01  # height of the load above the ground
SLOWEST_M_S, FASTEST_M_S = 0.01, 100.0
MOST_JUMPS = 1000  # repetitions of one jump
MOST_FLOWN = 4000  # items, those that jumps repeat counted again
MOST_TURNS, MOST_RADIUS_M = 1000.0, 1000.0
TURN_ACCEL_M_S2 = 1.0  # centripetal
LONGEST_CABLE_M, FASTEST_REEL_M_S = 100.0, 1.0
LEAST_REELED_M = 0.3  # height at which a winch leaves the load
HOME_ROW_M = 1.0  # distance from home within which item 0 is home
