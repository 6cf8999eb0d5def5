"""Step response of a flight of a sweep: the figures of `gcs.analysis.step`, taken tick by tick.

Which motion is the step is known when its leg begins, so the load's way along it need not be stored.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from typing import NamedTuple

import numpy as np

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import ZERO, Vec3, dot
from autopilot.guidance.jet_table import jets
from autopilot.guidance.legs import Hold, Leg, PathStretch
from gcs.analysis.axes import Floats
from gcs.analysis.step import OFF_LINE, REACHED, SETTLED, Motion, Step, find_motion, is_held

_COARSE = 64  # parts of a leg that are examined first: most paths are no steps


class Response(NamedTuple):
    """The way of the load along a step until now, in shares of the step's height; times from its start, s."""

    direction: Vec3  # along the step, 1/m, so that a share is direction . x - origin; zero: there is no step
    origin: float
    start_s: float  # on the clock of the vehicle
    greatest: float
    reached_s: float  # first tick at 90 %; infinite: not yet
    reached: float  # share there
    before_s: float  # the tick before
    before: float
    outside_s: float  # last tick that is more than 5 % away from the end; -infinite: none
    outside: float  # distance from the end there
    inside_s: float  # the tick after it; infinite: none
    inside: float


NO_RESPONSE = Response(ZERO, 0.0, 0.0, 0.0, inf, 0.0, 0.0, 0.0, -inf, 0.0, inf, 0.0)


@kernel
def followed(r: Response, x_load: Vec3, now_us: int) -> Response:
    """The response after a tick at which the load is at `x_load`."""
    t = now_us * 1e-6 - r.start_s
    share = dot(r.direction, x_load) - r.origin
    away = max(share - 1.0, 1.0 - share)
    reached_s = if_above(REACHED, share, r.reached_s, min(r.reached_s, t))
    inside_s = if_above(away, SETTLED, inf, min(r.inside_s, t))
    return Response(
        r.direction,
        r.origin,
        r.start_s,
        max(r.greatest, share),
        reached_s,
        if_above(t, reached_s, r.reached, share),
        if_above(reached_s, t, t, r.before_s),
        if_above(reached_s, t, share, r.before),
        if_above(away, SETTLED, t, r.outside_s),
        if_above(away, SETTLED, away, r.outside),
        inside_s,
        if_above(t, inside_s, r.inside, away),
    )


def response_to(step: Step) -> Response:
    """The response to a step before it begins."""
    x, y, z = (step.direction / step.height_m).tolist()
    origin = float(step.origin_m @ step.direction) / step.height_m
    return NO_RESPONSE._replace(direction=(x, y, z), origin=origin, start_s=step.start_s)


class StepFigures(NamedTuple):
    """As of `gcs.analysis.step.StepResponse`; NaN if the load never got there."""

    rise_90_s: float
    overshoot_pct: float
    settling_5_s: float


def figures_of(r: Response) -> StepFigures:
    """The figures of a step that was flown."""
    rise = settling = nan
    if r.reached_s < inf:
        rise = max(0.0, _crossing(r.before_s, r.before, r.reached_s, r.reached, REACHED))
    if r.outside_s == -inf:
        settling = 0.0
    elif r.inside_s < inf:
        settling = max(0.0, _crossing(r.outside_s, r.outside, r.inside_s, r.inside, SETTLED))
    return StepFigures(rise, max(0.0, r.greatest - 1.0) * 100.0, settling)


def _crossing(before_s: float, before: float, after_s: float, after: float, level: float) -> float:
    """The time at which the straight line between two ticks is at `level`."""
    return before_s + (level - before) / (after - before) * (after_s - before_s)


class RequestedMotions:
    """The motions of the requested path in the mission until now."""

    def __init__(self) -> None:
        self._leg: Leg | None = None
        self._step: Motion | None = None  # the greatest that could be a step
        self._other_m = 0.0  # the greatest distance of any other

    def add(self, leg: Leg, start_us: int, period_us: int) -> Step | None:
        """Take note of the leg that begins at `start_us` and is flown in ticks of `period_us`; the step that
        it may be. Legs are known by their identity."""
        if leg is self._leg:
            return None
        self._leg = leg
        if isinstance(leg, Hold):
            return None
        if isinstance(leg, PathStretch):
            if leg.path.begin_s > 0.0:
                return None  # part of the motion that began with the path
            leg = replace(leg, path=replace(leg.path, end_s=float(leg.path.table[-1, 1])))
        motion, distance_m = _motion_of(leg, start_us, period_us)
        if motion is None or self._step is not None:
            self._other_m = max(self._other_m, distance_m)
            return None
        self._step = motion
        return motion.step

    def are_one_step(self, until_s: float) -> bool:
        """Whether they are one step, of a path that was followed until then."""
        if self._step is None or self._other_m > OFF_LINE * self._step.step.height_m:
            return False
        return is_held(self._step, until_s)


def _motion_of(leg: Leg, start_us: int, period_us: int) -> tuple[Motion | None, float]:
    """The motion of a leg if it could be a step, and how far (m) the leg leads from its beginning."""
    ticks = max(1, -(-round(1e6 * leg.duration_s) // period_us))
    motion, distance_m = None, 0.0
    for intervals in (_COARSE, ticks):
        times_s: Floats = np.arange(intervals + 1) * np.float64(ticks * period_us * 1e-6 / intervals)
        rows = jets(leg, times_s, requested=True)
        distance_m = float(np.linalg.norm(rows[:, :3] - rows[0, :3], axis=1).max())
        motion = find_motion(start_us * 1e-6 + times_s, rows[:, :3], rows[:, 3:6])
        if motion is None:
            break
    return motion, distance_m
