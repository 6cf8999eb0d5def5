"""A path through waypoints along the straight lines between them, at a steady speed on each.

Each part of the path leads from one state of steady motion to another, so that the parts join without a jump
of any rotor force:

* a ramp on a line, from one speed to another (`autopilot.trajectory.ramp`): with u, v the speeds, it covers
  (u + v) / 2 times its duration, and its peak acceleration is PEAK_RAMP_ACCEL |v - u| / duration;
* a turn past a waypoint, the smoothest path (`autopilot.trajectory.minimum_snap`) from a place before it to
  another at the same distance behind it, at the same speed v at both. The two distances together are v times
  the duration times a share: the less it is, the slower is the load at the waypoint, and the shorter its way.
  It is the one with which the lines on both sides are flown in the least time, of those with which the load
  is nowhere faster than v: nearly 1 for a slight turn, 0.8 for one of 90 degrees, less where there is little
  room. The peak acceleration is a ratio that depends on angle and share alone times v / duration.

Along lines that are long beside speed^2 / acceleration this is the quickest path but for a few per cent, and
it does not leave the lines but in turns. Between short lines another is quicker
(`autopilot.trajectory.waypoint_path`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from itertools import pairwise
from math import ceil, cos, radians, sin
from typing import NamedTuple

import numpy as np

from autopilot.trajectory.minimum_snap import REST, JoinedPath, MinimumSnap, Section, on_clock
from autopilot.trajectory.ramp import PEAK_RAMP_ACCEL
from autopilot.trajectory.splines import Array, PieceTable, evaluate_path

_BISECTIONS = 40
_SHARES = tuple(1.0 - 0.025 * i for i in range(15))
_FASTER = 1.0005  # how many times as fast the load may be in a turn as at its ends
# of a shape, so long that the time over which the turning of the vehicle matters does not
_LONG_S = 30.0
_LEAST_LINE_M = 1e-3
_STRAIGHT_DEG = 1e-5


def _shape(points: Array, velocities: Array) -> tuple[float, float]:
    """The peak speed (m/s) and the peak acceleration (m/s^2) of the smoothest path in `_LONG_S` seconds."""
    times = np.linspace(0.0, _LONG_S, len(points))
    _, jets = MinimumSnap(Section(points, times, velocities)).jets()
    return float(np.linalg.norm(jets[1], axis=1).max()), float(np.linalg.norm(jets[2], axis=1).max())


class _Turn(NamedTuple):
    """The shape of a turn: its share, and its peak acceleration times its duration over its speed."""

    share: float
    ratio: float


@lru_cache(maxsize=256)
def turn_shapes(angle_deg: int) -> tuple[_Turn, ...]:
    """The shapes of turns by an angle: the greater the share, the faster is the load at the corner."""
    angle = radians(angle_deg)
    before, after = np.array([1.0, 0.0, 0.0]), np.array([cos(angle), sin(angle), 0.0])
    velocities = np.vstack([before, after])
    found = []
    for share in _SHARES:
        half_m = 0.5 * share * _LONG_S
        peak_m_s, peak_m_s2 = _shape(np.vstack([-half_m * before, REST[0], half_m * after]), velocities)
        if peak_m_s <= _FASTER:
            found.append(_Turn(share, peak_m_s2 * _LONG_S))
    return tuple(found)


def _greatest(holds: Callable[[float], bool], low: float, high: float) -> float:
    """The greatest value up to `high` for which a condition holds that holds up to some value; `low` if for
    none."""
    if holds(high):
        return high
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


class SteadyLines:
    """The sections of a path from rest to rest through points (n, 3) at up to `speed` (m/s) and `accel`
    (m/s^2); no ramp and no turn takes less than `least_s` seconds."""

    def __init__(self, points: Array, speed: float, accel: float, least_s: float) -> None:
        self._all_points, self._accel, self._least_s = points, accel, least_s
        lines = np.diff(points, axis=0)
        lengths = np.linalg.norm(lines, axis=1)
        directions = lines / lengths[:, None]
        cosines = np.clip(np.sum(directions[:-1] * directions[1:], axis=1), -1.0, 1.0)
        angles = np.degrees(np.arccos(cosines))
        turning = np.concatenate([[True], angles > _STRAIGHT_DEG, [True]])
        self.corners = np.flatnonzero(turning)  # which of the points are no points on a straight line
        self._points = points[self.corners]
        # a turn leaves the points beside it on the line, and a half of the line to the turn there
        share = np.where(turning[:-1] & turning[1:], 0.5, 1.0)
        rooms = share * lengths
        self._rooms = [0.0, *(float(min(rooms[i - 1], rooms[i])) for i in self.corners[1:-1]), 0.0]
        self._turns = [_Turn(1.0, 0.0)] * len(self.corners)
        for corner, i in enumerate(self.corners[1:-1], 1):
            # upwards: a turn is no sharper than the one whose shape it takes
            shapes = turn_shapes(ceil(angles[i - 1]))
            self._turns[corner] = min(shapes, key=partial(self._passing_s, rooms[i - 1 : i + 1], speed))
        lines = np.diff(self._points, axis=0)
        self._lengths = np.linalg.norm(lines, axis=1)
        self._directions = lines / self._lengths[:, None]
        self._speeds = self._speeds_at_corners(speed)
        self.is_steady = bool((self._speeds[1:-1] == speed).all())
        self.is_straight = len(self.corners) == 2
        self.sections: list[Section] = []
        self._turn_sections: list[int] = []
        for i in range(len(lines)):
            self._add_line(i, speed)
            if i + 1 < len(lines):
                self._add_turn(i + 1)

    def _passing_s(self, rooms: Array, speed: float, turn: _Turn) -> float:
        """The time (s) that the rooms (m) before and behind a corner take with a turn there, and with a ramp
        to it and from it."""
        in_turn = _greatest(lambda v: self._way(turn, v) <= rooms.min(), 0.0, speed)
        passing_s = self._turn_s(turn, in_turn)
        for room in (rooms - self._way(turn, in_turn)).tolist():
            steady = _greatest(partial(self._ramp_fits, room, in_turn), in_turn, speed)
            ramp_way = self._ramp_way(in_turn, steady)
            passing_s += (room - ramp_way) / steady
            if ramp_way:
                passing_s += self._ramp_s(in_turn, steady)
        return passing_s

    def _add_line(self, i: int, speed: float) -> None:
        start, direction, length = self._points[i], self._directions[i], float(self._lengths[i])
        begin, end = float(self._speeds[i]), float(self._speeds[i + 1])
        steady = _greatest(lambda v: self._needs(i, begin, v, end) <= length, max(begin, end), speed)
        after_rise = self._turn_way(i, begin) + self._ramp_way(begin, steady)
        before_turn = length - self._turn_way(i + 1, end)
        before_fall = before_turn - self._ramp_way(steady, end)
        if begin != steady:
            ends = start + self._turn_way(i, begin) * direction, start + after_rise * direction
            self._add(ends, self._ramp_s(begin, steady), (begin * direction, steady * direction))
        if before_fall - after_rise > _LEAST_LINE_M:
            ends = start + after_rise * direction, start + before_fall * direction
            self._add(ends, (before_fall - after_rise) / steady, (steady * direction, steady * direction))
        if steady != end:
            ends = start + before_fall * direction, start + before_turn * direction
            self._add(ends, self._ramp_s(steady, end), (steady * direction, end * direction))

    def _add_turn(self, i: int) -> None:
        speed, corner = float(self._speeds[i]), self._points[i]
        before, after = self._directions[i - 1], self._directions[i]
        way = self._turn_way(i, speed)
        self._turn_sections.append(len(self.sections))
        places = corner - way * before, corner, corner + way * after
        self._add(places, self._turn_s(self._turns[i], speed), (speed * before, speed * after))

    def _add(self, places: Sequence[Array], duration_s: float, velocities: Sequence[Array]) -> None:
        points, now = np.array(places), 0.0
        if self.sections:
            # what rounding leaves between two sections is part of the later one
            points[0] = self.sections[-1].points[-1]
            now = float(self.sections[-1].times[-1])
        times = now + np.linspace(0.0, duration_s, len(points))
        self.sections.append(Section(points, times, np.array(velocities)))

    def passes(self, path: JoinedPath) -> Array:
        """(n,) times at which the path of these sections, or a slower one, passes the points."""
        table = path.table()
        at_corners = [
            0.0,
            *(float(path.splines[k].section.times[1]) for k in self._turn_sections),
            table[-1, 1],
        ]
        times = np.empty(len(self._all_points))
        times[self.corners] = at_corners
        for line, (first, last) in enumerate(pairwise(self.corners)):
            for i in range(first + 1, last):
                ahead = partial(self._is_ahead, table, line, self._all_points[i])
                times[i] = _greatest(ahead, at_corners[line], at_corners[line + 1])
        return on_clock(times)

    def _is_ahead(self, table: PieceTable, line: int, point: Array, time: float) -> bool:
        """Whether a point on a line is still ahead at a time (s)."""
        return float(self._directions[line] @ (point - np.array(evaluate_path(table, time)[0]))) >= 0.0

    def _speeds_at_corners(self, speed: float) -> Array:
        """(n,) m/s: turns fit into their rooms, and the ramps between two turns between these."""
        lengths = self._lengths
        speeds = np.full(len(lengths) + 1, speed)
        speeds[0] = speeds[-1] = 0.0
        for i in range(1, len(lengths)):
            speeds[i] = _greatest(partial(self._turn_fits, i), 0.0, speed)
        for i in range(len(lengths)):
            low, high = float(speeds[i]), float(speeds[i + 1])
            if high > low:
                speeds[i + 1] = _greatest(partial(self._rises, i, low), low, high)
        for i in reversed(range(len(lengths))):
            high, low = float(speeds[i]), float(speeds[i + 1])
            if high > low:
                speeds[i] = _greatest(partial(self._falls, i, low), low, high)
        return speeds

    def _ramp_fits(self, room: float, begin: float, end: float) -> bool:
        return bool(self._ramp_way(begin, end) <= room)

    def _turn_fits(self, corner: int, speed: float) -> bool:
        return bool(self._turn_way(corner, speed) <= self._rooms[corner])

    def _rises(self, line: int, begin: float, end: float) -> bool:
        return bool(self._needs(line, begin, end, end) <= self._lengths[line])

    def _falls(self, line: int, end: float, begin: float) -> bool:
        return bool(self._needs(line, begin, begin, end) <= self._lengths[line])

    def _needs(self, line: int, begin: float, steady: float, end: float) -> float:
        """How long (m) a line must be to be flown at a steady speed between two others at its ends (m/s)."""
        turns = self._turn_way(line, begin) + self._turn_way(line + 1, end)
        return turns + self._ramp_way(begin, steady) + self._ramp_way(steady, end)

    def _turn_s(self, turn: _Turn, speed: float) -> float:
        return max(turn.ratio * speed / self._accel, self._least_s)

    def _way(self, turn: _Turn, speed: float) -> float:
        """From the beginning of a turn to its corner (m)."""
        return 0.5 * turn.share * speed * self._turn_s(turn, speed) if speed > 0.0 else 0.0

    def _turn_way(self, corner: int, speed: float) -> float:
        return self._way(self._turns[corner], speed)

    def _ramp_s(self, begin: float, end: float) -> float:
        return max(PEAK_RAMP_ACCEL * abs(end - begin) / self._accel, self._least_s)

    def _ramp_way(self, begin: float, end: float) -> float:
        return 0.5 * (begin + end) * self._ramp_s(begin, end) if begin != end else 0.0
