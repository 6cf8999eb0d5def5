"""Where each step leaves the load, as far as the steps say it; trajectories that begin elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import dist

from missions.model import (
    AttitudeRun,
    Land,
    Release,
    ReturnHome,
    Signals,
    Step,
    Takeoff,
    Trajectory,
    Waypoint,
    Winch,
)

Vec3 = tuple[float, float, float]

_HOME = (0.0, 0.0, 0.0)
_NEAR_M = 0.05  # a trajectory may begin this far from where the load hangs


def misplaced_trajectories(steps: Sequence[Step]) -> Iterator[tuple[int, str]]:
    """Index of each trajectory that begins where the load does not hang then, and what is wrong. With a first
    row of zeros it may begin anywhere."""
    here: Vec3 | None = None
    for index, step in enumerate(steps):
        if isinstance(step, Trajectory) and here is not None:
            first = step.first_m or step.points[0][1:]
            if any(first) and dist(first, here) > _NEAR_M:
                places = f"begins at {_shown(first)}, and the load hangs at {_shown(here)} then"
                advice = "put a waypoint at its first row before it, or count its places from there"
                yield index, f"{places}; {advice} (first row 0, 0, 0)"
        here = place_after(step, here)


def place_after(step: Step, here: Vec3 | None, home: Vec3 = _HOME) -> Vec3 | None:
    """Where the load is after a step that begins at `here`, ENU, m, as far as the step itself says it; None:
    not known. A take-off from an unknown place is assumed to be from the origin; a return leads to `home`."""
    match step:
        case Takeoff(altitude_m=altitude):
            return (0.0, 0.0, altitude) if here is None else (here[0], here[1], altitude)
        case Waypoint(east_m=east, north_m=north, altitude_m=altitude):
            return (east, north, altitude)
        case Signals() | AttitudeRun() | Release():
            return None
    if here is None:
        return None
    match step:
        case Trajectory():
            begin, end = step.points[0], step.points[-1]
            return (
                here[0] + end[1] - begin[1],
                here[1] + end[2] - begin[2],
                here[2] + end[3] - begin[3],
            )
        case ReturnHome():
            return (home[0], home[1], here[2])
        case Land():
            return (here[0], here[1], 0.0)
        case Winch(length_m=length_change):
            return (here[0], here[1], here[2] - length_change)
    return here


def _shown(place: Sequence[float]) -> str:
    return ", ".join(f"{value + 0.0:.4g}" for value in place) + " m"
