"""A path of the load through waypoints made by a custom planner: what the planner is given, what it returns,
and the requirements for its path.

World ENU, m, from home; the load rests at the first point before the path, and at the last one afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import acos, degrees, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from autopilot.geometry.linear import Vec3
from autopilot.geometry.magnitude import BOUNDED_TEXT, is_bounded
from autopilot.trajectory.convex import excess
from autopilot.trajectory.peaks import Body
from autopilot.trajectory.rotor_demand import COS_TILT, TENSION, TURN, Bounds, demand, rotor_commands
from autopilot.trajectory.spline_band import DEGREE
from autopilot.trajectory.splines import PieceTable, interpolating_spline, power_table
from autopilot.trajectory.waypoint_path import PathSegment, limits_used, sample_path

Array = NDArray[np.float64]

SAMPLE_SPACING_S = 0.01  # between the samples at which a path is checked
POINT_TOLERANCE_M = 0.05  # greatest distance at which the path may pass a waypoint
MAX_PIECES, MAX_DURATION_S = 5000, 3600.0
# how much position and derivatives may jump where two pieces meet, and at the ends, where the load rests: a
# smaller jump is less than the errors of any flight
_JUMPS = (("position", 1e-3, "m"), ("velocity", 1e-2, "m/s"), ("acceleration", 5e-2, "m/s^2"))
_JUMP_JERK = ("jerk", 0.5, "m/s^3")


class Route(NamedTuple):
    """What a planner is given: a stretch from rest to rest."""

    points: tuple[Vec3, ...]  # m: where the load rests, the waypoints to pass, and where it must come to rest
    speed_m_s: float  # not to be exceeded: the mission's, or MIS_SPEED
    accel_m_s2: float  # MIS_ACCEL
    time_optimal: bool  # MIS_TIME_OPT: as quick as the bounds allow, without limits on speed and acceleration
    body: Body  # the vehicle: masses, cable, drag, rotors
    bounds: Bounds  # limits of the demand on rotors, cable and tilt


class Path(NamedTuple):
    """What a planner returns: polynomial pieces, and the times at which it passes the points."""

    table: PieceTable  # rows as in `autopilot.trajectory.splines`
    passes_s: tuple[float, ...]  # for each point of the route, beginning with the first


Planner = Callable[[Route], Path]  # returns a path that `check_path` accepts; may raise PlanError


class PlanError(ValueError):
    """There is no path, or it cannot be flown; the text says why."""


def polynomials(breaks_s: ArrayLike, coefficients: ArrayLike, passes_s: ArrayLike) -> Path:
    """A path of n polynomials: `coefficients[k][i]`, of shape (n, m, 3) with m up to 10, belongs to
    (t - breaks_s[k])^i between breaks_s[k] and breaks_s[k + 1], of n + 1 breaks; `passes_s` are the times at
    which the points of the route are passed. ValueError if the shapes do not fit."""
    breaks, powers = np.asarray(breaks_s, np.float64), np.asarray(coefficients, np.float64)
    if powers.ndim != 3 or powers.shape[2] != 3 or not 1 <= powers.shape[1] <= DEGREE + 1:
        raise ValueError(
            f"coefficients are of shape {powers.shape}; must be (pieces, up to {DEGREE + 1} of them, 3)"
        )
    if breaks.shape != (len(powers) + 1,):
        raise ValueError(f"breaks_s are of shape {breaks.shape}; must be ({len(powers) + 1},)")
    return Path(power_table(breaks, powers), _times(passes_s))


def samples(times_s: ArrayLike, positions: ArrayLike, passes_s: ArrayLike) -> Path:
    """A path through sampled positions (n, 3) at increasing times (n,), n >= 2, from rest to rest: the spline
    of degree 9 through them, which rings unless the curve's derivatives up to the fourth are 0 at both ends.
    ValueError if shapes do not fit, or times do not increase."""
    times, places = np.asarray(times_s, np.float64), np.asarray(positions, np.float64)
    if times.ndim != 1 or len(times) < 2 or places.shape != (len(times), 3):
        raise ValueError(f"positions are of shape {places.shape}; must be ({times.size}, 3)")
    if not np.isfinite(times).all() or not (np.diff(times) > 0.0).all():
        raise ValueError("times_s must increase")
    return Path(interpolating_spline(times, places, (1, 2, 3, 4)), _times(passes_s))


def _times(passes_s: ArrayLike) -> tuple[float, ...]:
    return tuple(np.asarray(passes_s, np.float64).ravel().tolist())


def slower(path: Path, factor: float) -> Path:
    """The same path at 1 / factor of the speed."""
    table = path.table.copy()
    table[:, :2] *= factor
    by_power = table[:, 2:].reshape(len(table), 3, DEGREE + 1)
    by_power /= factor ** np.arange(DEGREE + 1)
    return Path(table, tuple(factor * t for t in path.passes_s))


def use(path: Path, route: Route) -> float:
    """How many times as long, roughly, the path should take to stay within what the route allows; 1 or less
    if it already does. Far above 1 it may be far too great: forces are not proportional to the pace."""
    times, jets = _sample_finely(path)
    min_factor = 0.0
    if not route.time_optimal:
        min_factor = float(limits_used(jets, route.speed_m_s, route.accel_m_s2).max())
    over = float(excess(demand(jets, route.body), float(times[1] - times[0]), route.bounds).max())
    return max(min_factor, 1.0 + over if over > 0.0 else 0.0)


def check_path(path: Path, route: Route) -> None:
    """Raise PlanError if the path is not valid for the route: values that are no numbers, wrong times, places
    too far away, jumps, a missed waypoint, or a place below the ground."""
    table, passes = path.table, path.passes_s
    if len(passes) != len(route.points):
        raise PlanError(f"passes_s are {len(passes)} times; must be {len(route.points)}, one for each point")
    if not 1 <= len(table) <= MAX_PIECES:
        raise PlanError(f"the path has {len(table)} pieces; must be 1 ... {MAX_PIECES}")
    if not (np.isfinite(table).all() and np.isfinite(passes).all()):
        raise PlanError("the path contains a value that is not a number")
    for name, times in (("breaks_s", [*table[:, 0], table[-1, 1]]), ("passes_s", passes)):
        for before, after in pairwise(times):
            if after <= before:
                detail = f"{after:g} s comes after {before:g} s"
                raise PlanError(f"the times {name} of the path must increase; {detail}")
        if times[0] != 0.0:
            raise PlanError(f"the times {name} of the path begin at {times[0]:g} s; must begin at 0")
    if (table[1:, 0] != table[:-1, 1]).any():
        raise PlanError("the pieces of the path do not follow one another: each must begin where one ends")
    last_s = float(table[-1, 1])
    if abs(passes[-1] - last_s) > 1e-9 or last_s > MAX_DURATION_S:
        raise PlanError(
            f"the path ends at {last_s:g} s and passes its last point at {passes[-1]:g} s; must be the same, "
            f"and at most {MAX_DURATION_S:g} s"
        )
    places = _sample_finely(path)[1][0]
    farthest_m = float(np.abs(places).max())
    if not is_bounded(farthest_m):
        raise PlanError(f"the path leads to {farthest_m:.3g} m; {BOUNDED_TEXT}")
    _check_joints(table)
    passed = sample_path(table, np.array(passes))[0]
    for i, (passed_point, point) in enumerate(zip(passed, route.points, strict=True)):
        off_m = float(np.linalg.norm(passed_point - point))
        if not off_m <= POINT_TOLERANCE_M:
            raise PlanError(
                f"the path passes point {i} {off_m:.2f} m beside it; must be {POINT_TOLERANCE_M:g} m at most"
            )
    lowest = float(places[:, 2].min())
    if lowest <= 0.0:
        raise PlanError(f"the path leads to {lowest:.2f} m above home; must be above the ground")


def _check_joints(table: PieceTable) -> None:
    """Raise PlanError if the path jumps, or does not begin and end at rest."""
    # on the left and on the right of each break; beyond the ends the load rests
    starts = _derivatives(table, np.zeros(len(table)))
    ends = _derivatives(table, table[:, 1] - table[:, 0])
    for order, (quantity, limit, unit) in enumerate((*_JUMPS, _JUMP_JERK)):
        if order and (moving := max(np.abs(starts[order, 0]).max(), np.abs(ends[order, -1]).max())) > limit:
            raise PlanError(
                f"the path begins or ends with a {quantity} of {moving:.3g} {unit}; must be at rest"
            )
        jumps = np.abs(starts[order, 1:] - ends[order, :-1]).max(axis=1, initial=0.0)
        if len(jumps) and jumps.max() > limit:
            at = float(table[1 + int(jumps.argmax()), 0])
            raise PlanError(f"the {quantity} of the path jumps by {jumps.max():.3g} {unit} at {at:.2f} s")


def _derivatives(table: PieceTable, since: Array) -> Array:
    """(4, n, 3) position to jerk of each piece, `since` s after its beginning."""
    c = table[:, 2:].reshape(len(table), 3, DEGREE + 1)
    powers = np.arange(DEGREE + 1, dtype=np.float64)
    derivatives = np.empty((4, len(table), 3))
    for order in range(4):
        derivatives[order] = np.einsum("kan,kn->ka", c, since[:, None] ** powers)
        c = np.concatenate([c[:, :, 1:] * powers[1:], np.zeros((len(table), 3, 1))], axis=2)
    return derivatives


def bound_violation(path: Path, route: Route) -> str:
    """A bound that the path breaks, in words; empty if it keeps them all."""
    times, jets = _sample_finely(path)
    spacing, bounds = float(times[1] - times[0]), route.bounds
    path_demand = demand(jets, route.body)
    if not excess(path_demand, spacing, bounds).max() > 0.0:
        return ""
    commands = rotor_commands(path_demand, spacing, bounds.rotor_tau)
    high, low = float(commands.max()), float(commands.min())
    tension, tilt = (
        float(path_demand[:, TENSION].min()),
        degrees(acos(max(-1.0, path_demand[:, COS_TILT].min()))),
    )
    if high > bounds.rotor_high:
        return f"a rotor would have to give {high:.2f} N; allowed are {bounds.rotor_high:.2f} N"
    if low < bounds.rotor_low:
        return f"a rotor would have to give {low:.2f} N; it must give {bounds.rotor_low:.2f} N at least"
    if tension < bounds.tension_low:
        return f"the cable would pull with {tension:.2f} N; it must be {bounds.tension_low:.2f} N at least"
    if degrees(acos(bounds.cos_tilt)) < tilt:
        return f"the vehicle would lean {tilt:.0f} deg; allowed are {degrees(acos(bounds.cos_tilt)):.0f} deg"
    turn_rate, allowed = sqrt(path_demand[:, TURN].max()), bounds.turn_rate
    lifting = "times weight over thrust where it lifts less than the weight"
    return f"the vehicle would turn at {turn_rate:.1f} rad/s, {lifting}; allowed are {allowed:.1f} rad/s"


def path_segments(path: Path, route: Route) -> list[PathSegment]:
    """The stretches of the path, from each point to the next."""
    return [PathSegment(path.table, begin, end, route.points[0]) for begin, end in pairwise(path.passes_s)]


def _sample_finely(path: Path) -> tuple[Array, Array]:
    """Times (n,) and jets (7, n, 3) along the path."""
    last_s = float(path.table[-1, 1])
    times = np.linspace(0.0, last_s, max(int(last_s / SAMPLE_SPACING_S), 50) + 1)
    return times, sample_path(path.table, times)
