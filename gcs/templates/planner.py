"""A custom path planner; docs/planners.md describes everything that it can do.

Fly it: gcs fly square --planner my_name.py:MyName

World axes: x east, y north, z up, in metres from home. When a mission is uploaded, the autopilot calls the
planner for each path of the load through waypoints, from rest to rest.
"""

from itertools import pairwise

import numpy as np

from plumbline.planners import Parameter, samples, slower, use


class MyName:
    """Straight lines from waypoint to waypoint with a stop at each, slow enough for the vehicle."""

    # the name in the report; if omitted, the name of the class
    name = "my_name"

    # These become parameters of the autopilot: gcs fly ... --set MINE_SLOW=2.
    # Parameter(default, minimum, maximum, unit, description)
    parameters = {"MINE_SLOW": Parameter(1.0, 1.0, 5.0, "", "How many times as long the paths take")}

    def __init__(self, parameters):
        """`parameters` contains all parameters of the autopilot, by name."""
        self.longer = parameters["MINE_SLOW"]

    def plan(self, route):
        """Return the path from the first point of the route to the last, through each point in between."""
        points = np.array(route.points)
        times, positions, passes = [0.0], [points[0]], [0.0]
        for start, end in pairwise(points):
            duration = 2.0 * np.linalg.norm(end - start) / route.speed_m_s + 0.5
            # `share` of the line that is covered: from 0 to 1, derivatives up to the fourth 0 at both ends
            s = np.linspace(0.0, 1.0, 41)[1:]
            share = s**5 * (126.0 - 420.0 * s + 540.0 * s**2 - 315.0 * s**3 + 70.0 * s**4)
            positions += [start + one * (end - start) for one in share]
            times += [passes[-1] + one * duration for one in s]
            passes.append(passes[-1] + duration)
        path = samples(times, positions, passes)

        # `use` estimates by which factor the path must be slowed down to keep the limits of speed,
        # acceleration, rotors and cable; at 1 or less the path keeps them. Far above 1 the estimate is far
        # too great, so each step slows down by at most 1.5.
        for _ in range(20):
            longer = use(path, route)
            if longer <= 1.0:
                break
            path = slower(path, min(1.01 * longer, 1.5))
        return slower(path, self.longer)
