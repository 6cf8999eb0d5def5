"""Minimum-snap flight of the load through waypoints: from rest, past each in turn without a stop, to rest.

A path at a given speed follows the straight lines between the waypoints, at a steady speed on each
(`autopilot.trajectory.steady_lines`), unless one smoothest path (`autopilot.trajectory.minimum_snap`) as a
whole is much quicker, as it is between short lines. The times at its waypoints are those of a ride along the
lines that is slow in turns (`ride_through`). A time-optimal path is the quicker of such a ride and of the
path whose times have the least integral (`optimal_time_shares`). The total follows from the form requested:

* at a given speed: as short as the peak speed and peak acceleration allow,
* time-optimal: as short as the bounds on rotors, cable and tilt allow.

In either form the bounds hold along the whole path, drag of the vehicle included.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from math import acos, dist, inf, sqrt, tan
from operator import itemgetter

import numpy as np
import scipy
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3
from autopilot.trajectory.convex import excess
from autopilot.trajectory.minimum_snap import REST, JoinedPath, MinimumSnap, NoPathError, Section, on_clock
from autopilot.trajectory.peaks import Body
from autopilot.trajectory.rotor_demand import Bounds, demand
from autopilot.trajectory.splines import Array, PieceTable, evaluate_path
from autopilot.trajectory.steady_lines import SteadyLines
from autopilot.trajectory.timeline import min_move_duration
from autopilot.trajectory.transfer import PEAK_SPEED, pace, transfer_duration

Indices = NDArray[np.int64]

MIN_WAYPOINT_DISTANCE_M = 0.05  # waypoints closer to each other than this are flown from rest to rest
MAX_POINTS = 40  # of one path
_TIME_SHARE_ITERATIONS = 6
# most segments for which the integral is minimised over the times
_MAX_OPTIMISED_SEGMENTS = 8
_SCALING_ROUNDS = 8
_LENGTHENING = 1.15
_CLOSE = 1e-3  # of a factor of the time
# what flying beside the lines must gain: how many times as long the path along the lines takes
_DETOUR_GAIN = 1.1
_RIDE_ACCEL_SHARE = 2.0 / 3.0  # of the peak acceleration, for speeding up; the rest is left for turns
_RIDE_TURN_SHARE = sqrt(1.0 - _RIDE_ACCEL_SHARE**2)
# of the speed that is reached over half of the shorter line beside it: a ride never turns more slowly
_MIN_TURN_SPEED_SHARE = 0.3
# The path of least snap swings far out on a line that takes many times as long as the turn or the line at its
# end. Such a line is divided: its parts grow by a factor from the turn on.
_DIVIDED_FROM, _DIVISION_GROWTH = 3.0, 1.2
# A turn takes one of these multiples of speed divided by peak acceleration, whichever path is quicker.
_TURN_TIMES = (2.0, 8.0)
_STRETCHING_ROUNDS = 5
_STRETCHING, _MIN_STRETCH, _MAX_STRETCH = 0.7, 0.6, 1.6  # exponent, and limits of its base


@dataclass(frozen=True, slots=True)
class PathSegment:
    """A stretch of a path through waypoints, from `begin_s` to `end_s` on its clock; m, ENU from home."""

    table: PieceTable
    begin_s: float
    end_s: float
    start: Vec3  # where the whole path begins


@kernel
def _fill(table: PieceTable, times: Array, out: Array) -> None:
    for i in range(times.shape[0]):
        jet = evaluate_path(table, times[i])
        for order in range(7):
            for axis in range(3):
                out[order, i, axis] = jet[order][axis]


def sample_path(table: PieceTable, times: Array) -> Array:
    """(7, n, 3) jets along the path."""
    out = np.empty((7, times.size, 3))
    _fill(table, times, out)
    return out


def approximate_time_shares(points: Array) -> Array:
    """Share of the total time for each segment, about as transfers at speed 1 and acceleration 1 would take
    them without the stops in between."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    times = np.sqrt(lengths) if len(lengths) == 1 else lengths.copy()
    if len(lengths) > 1:
        mean = float(lengths.mean())
        times[0] += 0.7 * mean
        times[-1] += 0.7 * mean
    return np.asarray(times / times.sum())


def optimal_time_shares(points: Array, total_s: float) -> Array:
    """The share of `total_s` seconds for each segment that minimises the integral."""
    begin = np.log(approximate_time_shares(points))
    if len(begin) == 1:
        return np.exp(begin)

    def shares(x: Array) -> Array:
        scaled = np.exp(x - x.max())
        return np.asarray(scaled / scaled.sum())

    def cost(x: Array) -> float:
        times = on_clock(_times_after(shares(x)) * total_s)
        return float(np.log(MinimumSnap(Section(points, times, REST)).cost))

    bounds = [(value - 0.7, value + 0.7) for value in begin]
    result = scipy.optimize.minimize(
        cost,
        begin,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": _TIME_SHARE_ITERATIONS, "eps": 1e-3},
    )
    return shares(result.x)


def ride(length: float, speed: float, accel: float) -> tuple[float, float, float]:
    """A ride over `length` m: its greatest speed (m/s), in how many seconds it is reached, and the time (s)
    of the ride."""
    ramp_accel = _RIDE_ACCEL_SHARE * accel
    cruise = min(speed, sqrt(length * ramp_accel / PEAK_SPEED))
    ramp_s = PEAK_SPEED * cruise / ramp_accel
    return cruise, ramp_s, ramp_s + length / cruise


@dataclass(frozen=True, slots=True)
class TimedPoints:
    """Points that a path is to pass and the times at them: waypoints, and places between waypoints."""

    points: Array  # (n, 3), m
    times: Array  # (n,), s
    waypoints: Indices  # which of the points are waypoints

    def stretched(self, factors: Array) -> TimedPoints:
        """The same with each of the n - 1 segments so many times as long."""
        return replace(self, times=_times_after(factors * np.diff(self.times)))


def ride_through(points: Array, speed: float, accel: float, turn_time: float) -> TimedPoints:
    """A ride along the straight lines between the points, from rest to rest, at up to `speed` (m/s) and
    `accel` (m/s^2): slow in sharp turns, quick elsewhere, however close the points are.

    A turn of theta between lines of l m and more is as round as a circle of radius l / (2 tan(theta / 2)).
    `turn_time`, in speeds divided by `accel`, is how long a turn takes: long lines are divided accordingly.
    """
    lines = np.diff(points, axis=0)
    lengths = np.linalg.norm(lines, axis=1)
    directions = lines / lengths[:, None]
    mean_accel = _RIDE_ACCEL_SHARE * accel / PEAK_SPEED  # of the s of `autopilot.trajectory.transfer`
    speeds = np.full(len(points), speed)
    speeds[0] = speeds[-1] = 0.0
    for i in range(1, len(lines)):
        shorter = float(min(lengths[i - 1], lengths[i]))
        half_turn = 0.5 * acos(float(np.clip(directions[i - 1] @ directions[i], -1.0, 1.0)))
        radius = 0.5 * shorter / max(tan(half_turn), 1e-9)
        slowest = _MIN_TURN_SPEED_SHARE * sqrt(mean_accel * shorter)
        speeds[i] = min(speed, max(slowest, sqrt(_RIDE_TURN_SHARE * accel * radius)))
    for i, length in enumerate(lengths):
        speeds[i + 1] = min(speeds[i + 1], sqrt(speeds[i] ** 2 + 2.0 * mean_accel * length))
    for i, length in reversed(list(enumerate(lengths))):
        speeds[i] = min(speeds[i], sqrt(speeds[i + 1] ** 2 + 2.0 * mean_accel * length))
    begin, end = speeds[:-1], speeds[1:]
    peaks = np.minimum(speed, np.sqrt(0.5 * (begin**2 + end**2) + mean_accel * lengths))
    rising, falling = (peaks - begin) / mean_accel, (peaks - end) / mean_accel
    steady = (lengths - 0.5 * (begin + peaks) * rising - 0.5 * (peaks + end) * falling) / peaks
    durations = rising + np.maximum(steady, 0.0) + falling

    def share_after(i: int, time: float) -> float:
        """The share of line i after `time` s on it."""
        left = durations[i] - time
        if time < rising[i]:
            way = begin[i] * time + 0.5 * mean_accel * time * time
        elif left < falling[i]:
            way = lengths[i] - end[i] * left - 0.5 * mean_accel * left * left
        else:
            way = 0.5 * (begin[i] + peaks[i]) * rising[i] + peaks[i] * (time - rising[i])
        return float(way / lengths[i])

    ends_s = [inf, *(turn_time / accel * speeds[1:-1]), inf]  # at rest nothing is to be divided
    beside_s = [inf, *durations, inf]
    places, times, waypoints = [points[0]], [0.0], [0]
    for i, duration in enumerate(durations):
        after_begin, before_end = min(beside_s[i], ends_s[i]), min(beside_s[i + 2], ends_s[i + 1])
        start_s = float(durations[:i].sum())
        for time in _divisions(float(duration), after_begin, before_end):
            places.append(points[i] + share_after(i, time) * lines[i])
            times.append(start_s + time)
        waypoints.append(len(places))
        places.append(points[i + 1])
        times.append(start_s + float(duration))
    return TimedPoints(np.array(places), np.array(times), np.array(waypoints))


def _divisions(duration: float, after_begin: float, before_end: float) -> list[float]:
    """Where a line of `duration` s is divided that is much longer than what comes before and after it (s)."""
    if duration < _DIVIDED_FROM * min(after_begin, before_end):
        return []
    from_begin, from_end = [0.0], [duration]
    first, last = _DIVISION_GROWTH * after_begin, _DIVISION_GROWTH * before_end
    while from_end[-1] - from_begin[-1] > 2.0 * min(first, last):
        if first <= last:
            from_begin.append(from_begin[-1] + first)
            first *= _DIVISION_GROWTH
        else:
            from_end.append(from_end[-1] - last)
            last *= _DIVISION_GROWTH
    return from_begin[1:] + from_end[:0:-1]


def limits_used(jets: Array, speed: float, accel: float) -> Array:
    """(n,) how many times as long a path of these jets (7, n, 3) should take at each sample to keep to
    `speed` (m/s) and `accel` (m/s^2)."""
    too_fast = np.linalg.norm(jets[1], axis=1) / speed
    too_hard = np.sqrt(np.linalg.norm(jets[2], axis=1) / accel)
    return np.asarray(np.maximum(too_fast, too_hard))


def quick_times(ride: TimedPoints, speed: float, accel: float) -> tuple[TimedPoints, float]:
    """The points of a ride with times between them at which the smoothest path is quick, and its duration
    (s): where the path is too fast or turns too hard it gets more time, elsewhere less."""
    best, best_s = ride, inf
    for _ in range(_STRETCHING_ROUNDS):
        fine, jets = MinimumSnap(Section(ride.points, ride.times, REST)).jets()
        use = limits_used(jets, speed, accel)
        duration_s = float(ride.times[-1] * use.max())
        if not duration_s < best_s:
            break
        best, best_s = ride, duration_s
        segments = np.clip(np.searchsorted(ride.times, fine, side="right") - 1, 0, len(ride.times) - 2)
        most = np.zeros(len(ride.times) - 1)
        np.maximum.at(most, segments, use)
        ride = ride.stretched(np.clip(most, _MIN_STRETCH, _MAX_STRETCH) ** _STRETCHING)
    return best, best_s


def quickest_ride(points: Array, speed: float, accel: float) -> tuple[TimedPoints, float]:
    """The quickest of the rides through the points, and its duration (s); NoPathError if there is none."""
    found = []
    for turn_time in _TURN_TIMES:
        with suppress(NoPathError):
            found.append(quick_times(ride_through(points, speed, accel, turn_time), speed, accel))
    quickest, duration_s = min(found, key=itemgetter(1), default=(None, inf))
    if quickest is None or duration_s == inf:
        raise NoPathError("the distances between the points are too unequal")
    return quickest, duration_s


def _times_after(durations: Array) -> Array:
    """(n + 1,) times at the ends of n durations that follow each other from 0 on."""
    return np.concatenate([[0.0], np.cumsum(durations)])


@dataclass(frozen=True, slots=True)
class _Planned:
    """Sections of a path, which times of the path of these sections, or a slower one, are those at its
    waypoints, and the least duration (s) of the path."""

    sections: Sequence[Section]
    passes: Callable[[JoinedPath], Array]
    least_s: float = 0.0


def plan_waypoint_path(
    points: Sequence[Vec3],
    speed: float,
    accel: float,
    body: Body,
    bounds: Bounds,
    time_optimal: bool,
) -> tuple[JoinedPath, Array]:
    """The path through the points and the times at them.

    `speed` (m/s) and `accel` (m/s^2) are peaks; if `time_optimal`, only the bounds apply. NoPathError if
    there is no path that is quicker than flying from point to point with a stop at each.
    """
    places = np.array(points)
    least_s = min_move_duration(body.cable_length, body.gravity)
    distances = [dist(a, b) for a, b in pairwise(points)]
    stops_s = sum(pace(distance, speed, accel, least_s).duration_s for distance in distances)
    found: list[tuple[JoinedPath, Array]] = []
    is_straight = False

    def consider(planned: _Planned) -> None:
        path = _scaled_path(planned, speed, accel, body, bounds, time_optimal)
        times = planned.passes(path)
        if times[-1] <= stops_s:
            found.append((path, times))

    if time_optimal:
        if len(distances) <= _MAX_OPTIMISED_SEGMENTS:
            total_s = transfer_duration(float(sum(distances)), speed, accel)
            with suppress(NoPathError):
                times = _times_after(optimal_time_shares(places, total_s)) * total_s
                consider(_one_section(TimedPoints(places, times, np.arange(len(places)))))
    else:
        with suppress(NoPathError):
            lines = _steady_lines(places, speed, accel, least_s, body, bounds)
            consider(_Planned(lines.sections, lines.passes, float(lines.sections[-1].times[-1])))
            if found and lines.is_steady:
                return found[0]
            is_straight = lines.is_straight
    if not is_straight:  # else waypoints on a line could make the flight along it quicker
        with suppress(NoPathError):
            consider(_one_section(quickest_ride(places, speed, accel)[0]))
    if not found:
        raise NoPathError("flights with a stop at each point are quicker")
    first, last = found[0], found[-1]
    gain = 1.0 if time_optimal else _DETOUR_GAIN
    return first if first[1][-1] <= gain * last[1][-1] else last


def _one_section(ride: TimedPoints) -> _Planned:
    section = Section(ride.points, ride.times, REST)
    return _Planned([section], lambda path: path.splines[0].section.times[ride.waypoints])


def _steady_lines(
    places: Array, speed: float, accel: float, least_s: float, body: Body, bounds: Bounds
) -> SteadyLines:
    """Lines whose ramps and turns are as gentle as the bounds demand."""
    gentle = accel
    lines = SteadyLines(places, speed, gentle, least_s)
    for _ in range(_SCALING_ROUNDS):
        moving = [section for section in lines.sections if not section.is_steady]
        factor = _slowing(JoinedPath(moving), speed, accel, body, bounds, time_optimal=False)
        if factor <= 1.0 + _CLOSE:
            break
        gentle /= min(factor, _LENGTHENING) ** 2
        lines = SteadyLines(places, speed, gentle, least_s)
    return lines


def _slowing(
    path: JoinedPath, speed: float, accel: float, body: Body, bounds: Bounds, time_optimal: bool
) -> float:
    """How many times as long a path should take (up to 1: no longer)."""
    factor = 0.0
    for fine, jets in path.jets():
        if not time_optimal:
            factor = max(factor, float(limits_used(jets, speed, accel).max()))
        over = float(excess(demand(jets, body), fine, bounds).max())
        if over > 0.0:
            factor = max(factor, 1.0 + over)
    return factor


def _scaled_path(
    planned: _Planned,
    speed: float,
    accel: float,
    body: Body,
    bounds: Bounds,
    time_optimal: bool,
) -> JoinedPath:
    """The path of the sections, all as many times as long as the limits demand."""
    sections = planned.sections
    total_s = begin_s = float(sections[-1].times[-1])

    def evaluate(seconds: float) -> tuple[JoinedPath, float]:
        """The path in `seconds` in total, and how many times as long it should take."""
        path = JoinedPath([section.slowed(seconds / begin_s) for section in sections])
        return path, _slowing(path, speed, accel, body, bounds, time_optimal)

    path, factor = evaluate(total_s)
    if not time_optimal:
        # peaks scale with time almost exactly: two rounds are accurate to one part in a thousand
        for _ in range(2):
            total_s = max(total_s * min(factor, 2.0), planned.least_s)
            path, factor = evaluate(total_s)
    for _ in range(4 * _SCALING_ROUNDS):
        if factor <= 1.0 + _CLOSE:
            break
        total_s *= _LENGTHENING if factor > 1.05 else 1.01
        path, factor = evaluate(total_s)
    if time_optimal:
        low, high = 0.0, total_s
        best = path
        for _ in range(_SCALING_ROUNDS):
            middle = 0.5 * (low + high) if low > 0.0 else 0.7 * high
            path, factor = evaluate(middle)
            if factor <= 1.0 + _CLOSE:
                best, high = path, middle
            else:
                low = middle
        path = best
    return path
