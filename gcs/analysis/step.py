"""Step response of the load along the line of a step-like path: rise, overshoot, settling."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gcs.analysis.axes import Floats

REACHED = 0.9  # of the height: the rise ends
SETTLED = 0.05  # of the height: how far from the end the load may be
MIN_HEIGHT_M = 0.01  # below a centimetre the noise of a tracker is a tenth of the step
OFF_LINE = 1e-3  # of the height: a path that deviates more from its line is no step
_BACKWARD = 1e-4  # of the height: single-precision wire values of a monotone path go back by less
_STARTED = 1e-4  # of the height: the desired path has left its start
_ARRIVED = 1.0 - 1e-4  # of the height
_PAUSE = 0.01  # of the peak speed: a path that becomes slower than this in between is two moves
_MIDDLE_RANGE = (0.02, 0.98)  # of the height: the part that is searched for pauses
_REST = 0.01  # of the peak speed: at rest
_MIN_HOLD_S = 0.5  # a shorter hold says nothing about settling


class Step(NamedTuple):
    """A step-like desired path: its start time, height, origin and direction."""

    start_s: float
    height_m: float
    origin_m: Floats  # (3,)
    direction: Floats  # (3,) unit vector


class StepResponse(NamedTuple):
    """Times count from the start of the step; None if the load never got there."""

    height_m: float
    rise_90_s: float | None  # first time at 90 % of the height
    overshoot_pct: float  # greatest excess over the height, % of it
    settling_5_s: float | None  # last time more than 5 % of the height away from the end


class Motion(NamedTuple):
    """A motion of the desired path along a straight line, and when it arrives there."""

    step: Step
    arrived_s: float


def find_step(time_s: Floats, desired_m: Floats, desired_m_s: Floats) -> Step | None:
    """The step of a desired path (n,), (n, 3), (n, 3), or None.

    A step begins at rest, moves once along one straight line, never back, and holds at least half a second
    at its end.
    """
    motion = find_motion(time_s, desired_m, desired_m_s)
    return motion.step if motion is not None and is_held(motion, float(time_s[-1])) else None


def is_held(motion: Motion, until_s: float) -> bool:
    """Whether a path that stays at the end of the motion until then stays long enough for a step."""
    return until_s - motion.arrived_s >= _MIN_HOLD_S


def find_motion(time_s: Floats, desired_m: Floats, desired_m_s: Floats) -> Motion | None:
    """The motion of a desired path (n,), (n, 3), (n, 3) that could be a step, or None: from rest to rest,
    once along one straight line, and never back.

    It starts when it leaves rest, however slowly: a path through waypoints has a hundredth of its peak speed
    only after a tenth of its duration. Between samples, this time is computed from position and speed as for
    a path that leaves rest with constant acceleration (as a half-sine step does).
    """
    if len(time_s) < 3 or not (np.isfinite(desired_m).all() and np.isfinite(desired_m_s).all()):
        return None
    line = desired_m[-1] - desired_m[0]
    height = float(np.linalg.norm(line))
    if height < MIN_HEIGHT_M:
        return None
    direction = line / height
    offset = desired_m - desired_m[0]
    along = offset @ direction
    speed = desired_m_s @ direction
    peak = float(speed.max())
    middle = (along > _MIDDLE_RANGE[0] * height) & (along < _MIDDLE_RANGE[1] * height)
    moved = (along > _STARTED * height) | (speed > _REST * peak)
    started = int(np.argmax(moved))
    if (
        np.linalg.norm(offset - along[:, None] * direction, axis=1).max() > OFF_LINE * height
        or np.diff(along).min() < -_BACKWARD * height
        or along.max() > (1.0 + _BACKWARD) * height
        or abs(speed[0]) > _REST * peak
        or abs(speed[-1]) > _REST * peak
        or bool((speed[middle] < _PAUSE * peak).any())
        or started == 0
    ):
        return None
    gains = (speed[:started] > 0.0) & (speed[:started] < speed[1 : started + 1])
    first = started - int(np.argmin(np.append(gains[::-1], False)))  # of the samples in motion
    start = time_s[first]
    if first > 0 and speed[first] > 0.0:
        start = max(time_s[first - 1], start - 2.0 * max(along[first], 0.0) / speed[first])
    arrived = int(np.argmax(along >= _ARRIVED * height))
    return Motion(Step(float(start), height, desired_m[0], direction), float(time_s[arrived]))


def step_response(step: Step, time_s: Floats, actual_m: Floats) -> StepResponse:
    """Response of the load (n,), (n, 3) to the step; crossings are interpolated between the samples."""
    known = (time_s >= step.start_s) & np.isfinite(actual_m).all(axis=1)
    t = time_s[known] - step.start_s
    along = (actual_m[known] - step.origin_m) @ step.direction / step.height_m
    if len(t) == 0:
        return StepResponse(step.height_m, None, 0.0, None)
    away = np.abs(along - 1.0)
    outside = np.flatnonzero(away > SETTLED)
    settling: float | None = None
    if len(outside) == 0:
        settling = 0.0
    elif outside[-1] + 1 < len(t):
        settling = _crossing(t, away, int(outside[-1]), SETTLED)
    reached = np.flatnonzero(along >= REACHED)
    rise: float | None = None
    if len(reached):
        rise = _crossing(t, along, int(reached[0]) - 1, REACHED) if reached[0] else 0.0
    return StepResponse(step.height_m, rise, max(0.0, float(along.max()) - 1.0) * 100.0, settling)


def _crossing(t: Floats, values: Floats, before: int, level: float) -> float:
    """The time between `before` and the next sample at which the straight line between them is at `level`."""
    fraction = (level - values[before]) / (values[before + 1] - values[before])
    return float(t[before] + fraction * (t[before + 1] - t[before]))
