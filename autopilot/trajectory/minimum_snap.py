"""The smoothest path past points at given times: sections of least snap that join without a jump.

A section is a spline (`autopilot.trajectory.splines`) that passes each of its points exactly and minimises

    integral of |x''''|^2 + tau^4 (|x^(6)|^2 + sigma^2 |x^(7)|^2)

x'''' is the snap of the load; x^(6) determines how the vehicle turns, and tau is the time over which that
matters: with the snap alone the path would leave rest with a jump of the moment. x^(7) determines how fast
the forces of the rotors change, and sigma is about their lag: without it the moment would rise within one
interval of the spline, however short. At its two ends the load moves steadily or rests: it has a velocity,
and derivatives 2 to 6 are zero. A section of two points is a straight one: steady motion, or a ramp.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from autopilot.trajectory.ramp import PARTS, WAYS, ramp
from autopilot.trajectory.spline_band import BAND, DEGREE, sums_of
from autopilot.trajectory.splines import ORDERS, Array, Basis, PieceTable, power_table

Indices = NDArray[np.int64]

ROTATION_TIME_S = 0.25  # tau
ROTOR_TIME_S = 0.02  # sigma
_PER_SEGMENT = 8  # intervals to the shortest segment, up to _MAX_INTERVALS
_MAX_INTERVALS = 400
# the least of them, up to _MOST_INTERVALS: with fewer some points would have no interval of their own
_MIN_PER_SEGMENT = 2
_MOST_INTERVALS = 2000
_SAMPLES = 4  # to an interval, of the integral
_FINE_S = 0.01
# The slope of a rotor's force is a one-sided difference at the ends: next to each is one more sample, at this
# share of the distance between samples.
_END_SHARE = 0.1
# 50 to an interval: a flight of hours needs no more memory than one of minutes
_MAX_FINE_SAMPLES = 20_000
REST = np.zeros((2, 3))


class NoPathError(ValueError):
    """There is no useful path through the points without a stop; the text says why."""


@dataclass(frozen=True, slots=True)
class Section:
    """Points that a path is to pass and the times at them, and the velocities of the load at the first and at
    the last of them."""

    points: Array  # (n, 3), m
    times: Array  # (n,), s, on the clock of the whole path
    velocities: Array  # (2, 3), m/s

    @property
    def is_steady(self) -> bool:
        """Whether it is flown at constant velocity."""
        return len(self.points) == 2 and np.array_equal(*self.velocities)

    def slowed(self, factor: float) -> Section:
        """The same in so many times the time."""
        return Section(self.points, self.times * factor, self.velocities / factor)


class _Grid:
    """The spline of a path of `total_s` seconds in `intervals` parts, and the integral as a quadratic form of
    its coefficients, whatever points the path passes."""

    def __init__(self, total_s: float, intervals: int) -> None:
        self.basis = basis = Basis(0.0, total_s, intervals)
        samples = _SAMPLES * intervals
        spacing = total_s / samples
        values, first = basis.band(spacing * np.arange(0.5, samples), 8)
        weights = {4: 1.0, 6: ROTATION_TIME_S**4, 7: ROTATION_TIME_S**4 * ROTOR_TIME_S**2}
        # rows whose squares sum to the integral
        self.root = sparse.vstack(
            [sqrt(spacing * weight) * self.matrix(values[n], first) for n, weight in weights.items()]
        )
        self.hessian = self.root.T @ self.root
        free = slice(basis.free.start, basis.free.stop)
        hessian = self.hessian[free, free]
        # the scale keeps the two kinds of rows comparable in size for pivoting
        self.scale = float(np.median(hessian.diagonal()))
        self.scaled_hessian = hessian / self.scale

    def matrix(self, values: Array, first: Indices) -> sparse.csr_matrix:
        """(n, count) matrix of one derivative at n times by the coefficients of one axis."""
        n = len(values)
        columns = first[:, None] + np.arange(BAND)
        rows = np.repeat(np.arange(n), BAND).reshape(n, BAND)
        return sparse.csr_matrix(
            (values.ravel(), (rows.ravel(), columns.ravel())), shape=(n, self.basis.count)
        )


# the times at the points are searched with the same total: nearly all paths that are compared have one grid
_grid = lru_cache(maxsize=4)(_Grid)


class MinimumSnap:
    """The smoothest path of one section."""

    def __init__(self, section: Section) -> None:
        """NoPathError if the shortest segment is too short beside the total time."""
        points, times = section.points, section.times - section.times[0]
        shortest_share = float(np.diff(times).min() / times[-1])
        count = int(np.clip(ceil(_PER_SEGMENT / shortest_share), 2 * ORDERS, _MAX_INTERVALS))
        count = max(count, ceil(_MIN_PER_SEGMENT / shortest_share))
        if count > _MOST_INTERVALS:
            raise NoPathError(f"a segment takes {shortest_share:.2g} of the whole time")
        grid = _grid(float(times[-1]), count)
        self.section = section
        self.basis = basis = grid.basis
        self.origin: Array = points[0]
        ends = np.zeros((2, ORDERS, 3))
        ends[1, 0] = points[-1] - self.origin
        ends[:, 1] = section.velocities
        fixed = basis.end_coefficients(ends[0], ends[1])
        values, first = basis.band(times[1:-1], 1)
        passing = grid.matrix(values[0], first)
        free = slice(basis.free.start, basis.free.stop)
        A = passing[:, free]
        n = A.shape[1]
        system = sparse.bmat([[grid.scaled_hessian, A.T], [A, None]], format="csc")
        right_side = np.vstack(
            [
                -(grid.hessian @ fixed)[free] / grid.scale,
                (points[1:-1] - self.origin) - passing @ fixed,
            ]
        )
        self.coefficients: Array = fixed.copy()
        factor = splu(system)
        solved = factor.solve(right_side)
        # one step of refinement with the residual: the least integral is small compared with its terms
        solved += factor.solve(right_side - system @ solved)
        self.coefficients[free] = solved[:n]
        self.cost = float(np.sum((grid.root @ self.coefficients) ** 2))

    def jets(self) -> tuple[Array, Array]:
        """Times (n,) from its beginning and jets (7, n, 3) along the path, relative to its first point."""
        times = _sample_times(float(self.basis.breaks[-1]))
        values, first = self.basis.band(times, 7)
        return times, sums_of(values, first, self.coefficients)

    def table(self) -> PieceTable:
        """The path as a table, as it is flown."""
        table = self.basis.pieces(self.coefficients, self.origin)
        begin, end = self.section.times[0], self.section.times[-1]
        table[:, :2] += begin
        table[-1, 1] = end  # sections leave no gap
        return table


def _sample_times(total_s: float) -> Array:
    """Times (s) at which a section of `total_s` seconds is judged."""
    times = np.linspace(0.0, total_s, int(np.clip(total_s / _FINE_S, 50, _MAX_FINE_SAMPLES)) + 1)
    near_s = _END_SHARE * float(times[1])
    return np.insert(times, (1, -1), (near_s, total_s - near_s))


def on_clock(times: Array) -> Array:
    """Times (s) in whole microseconds: the stretches of a path join exactly on the vehicle's clock."""
    return np.asarray(np.round(times * 1e6) * 1e-6)


class StraightMotion:
    """The path of a section along a line, at constant velocity or along a ramp."""

    def __init__(self, section: Section) -> None:
        self.section = section
        self.origin: Array = section.points[0]
        self._duration_s = float(section.times[1] - section.times[0])
        self._begin, end = section.velocities
        self._gain = end - self._begin

    def jets(self) -> tuple[Array, Array]:
        """As those of `MinimumSnap`."""
        if self.section.is_steady:
            times = np.array([0.0, self._duration_s])
            jets = np.zeros((ORDERS, len(times), 3))
        else:
            times = _sample_times(self._duration_s)
            growth = np.array([ramp(self._duration_s, time) for time in times.tolist()])
            jets = growth.T[:, :, None] * self._gain
        jets[0] += times[:, None] * self._begin
        jets[1] += self._begin
        return times, jets

    def table(self) -> PieceTable:
        """The path as a table, as it is flown."""
        if self.section.is_steady:
            powers, breaks = np.zeros((1, 2, 3)), self.section.times
        else:
            part_s = self._duration_s / PARTS
            scales = part_s ** (1.0 - np.arange(DEGREE + 1))
            powers = (WAYS * scales)[:, :, None] * self._gain
            breaks = np.linspace(self.section.times[0], self.section.times[-1], PARTS + 1)
        powers[:, 0] += self.origin + (breaks[:-1, None] - breaks[0]) * self._begin
        powers[:, 1] += self._begin
        return power_table(breaks, powers)


class JoinedPath:
    """Sections that follow each other: each begins where, when and as the one before it ends.

    The load passes the points within the sections, and the last one, at times in whole microseconds.
    """

    def __init__(self, sections: Sequence[Section]) -> None:
        """NoPathError if a section is not possible."""
        splines: list[MinimumSnap | StraightMotion] = []
        for section in sections:
            times = section.times.copy()
            end = None if section is sections[-1] else -1
            times[1:end] = on_clock(times[1:end])
            motion = StraightMotion if len(section.points) == 2 else MinimumSnap
            splines.append(motion(replace(section, times=times)))
        self.splines = tuple(splines)

    def jets(self) -> Iterator[tuple[Array, Array]]:
        """Times (n,) from its beginning and jets (7, n, 3) of each section, relative to its first point."""
        return (spline.jets() for spline in self.splines)

    def lowest_m(self) -> float:
        """The lowest place of the load (m), up from home."""
        return min(float(spline.jets()[1][0, :, 2].min() + spline.origin[2]) for spline in self.splines)

    def table(self) -> PieceTable:
        """The path as a table, as it is flown."""
        return np.vstack([spline.table() for spline in self.splines])
