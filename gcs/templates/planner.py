"""A path planner of your own; docs/planners.md tells all that it may do.

Fly it: gcs fly square --planner my_name.py:MyName

World: x east, y north, z up from home, in metres. A planner is asked for the load's path through waypoints,
from rest to rest, before the flight.
"""

from itertools import pairwise

import numpy as np

from plumbline.planners import Parameter, samples, slower, use


class MyName:
    """Straight lines from waypoint to waypoint, at rest in each: sampled, and slow enough for the vehicle."""

    # shown in the report; without it the name of the class
    name = "my_name"

    # become parameters of the autopilot: gcs fly ... --set MINE_SLOW=2. Default, least, greatest, unit, text.
    parameters = {"MINE_SLOW": Parameter(1.0, 1.0, 5.0, "", "How many times as long the paths take")}

    def __init__(self, parameters):
        """`parameters` has all of the autopilot's, by name."""
        self.longer = parameters["MINE_SLOW"]

    def plan(self, route):
        """The path from the first point of the route to the last, past each in between."""
        points = np.array(route.points)
        times, positions, passes = [0.0], [points[0]], [0.0]
        for start, end in pairwise(points):
            duration = 2.0 * np.linalg.norm(end - start) / route.speed_m_s + 0.5
            # from 0 to 1 with all derivatives up to the fourth 0 at both ends
            s = np.linspace(0.0, 1.0, 41)[1:]
            share = s**5 * (126.0 - 420.0 * s + 540.0 * s**2 - 315.0 * s**3 + 70.0 * s**4)
            positions += [start + one * (end - start) for one in share]
            times += [passes[-1] + one * duration for one in s]
            passes.append(passes[-1] + duration)
        path = samples(times, positions, passes)

        # `use` tells how many times as long it should take, to keep speed, acceleration, rotors and cable
        # within what is allowed
        for _ in range(20):
            longer = use(path, route)
            if longer <= 1.0:
                break
            path = slower(path, min(1.01 * longer, 1.5))
        return slower(path, self.longer)
