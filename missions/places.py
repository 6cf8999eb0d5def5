"""Where the load hangs before each step, as far as the steps say it; trajectories that begin elsewhere."""

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
        here = _place_after(step, here)


def _place_after(step: Step, here: Vec3 | None) -> Vec3 | None:
    """Where the load hangs after a step that begins at `here`; None: not known."""
    match step:
        case Takeoff():
            return (0.0, 0.0, step.altitude_m)
        case Waypoint():
            return (step.east_m, step.north_m, step.altitude_m)
        case Signals() | AttitudeRun() | Release() | Land():
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
            return (0.0, 0.0, here[2])
        case Winch():
            return (here[0], here[1], here[2] - step.length_m)
    return here


def _shown(place: Sequence[float]) -> str:
    return ", ".join(f"{value + 0.0:.4g}" for value in place) + " m"
