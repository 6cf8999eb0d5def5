"""Preparation of a mission for its vehicle before the flight: paths are shaped, impossible ones are handled.

Signals become `ShapedSignals`; waypoints without a hold are flown through, along one path, each on a segment
of it (`PathSegment`). A path that is impossible nevertheless, or possible only too far from the requested
path, is flown as requested, slowed down or refused, depending on the user's setting.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from math import cos, dist
from typing import NamedTuple

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.trajectory.load_path import slower_step
from autopilot.trajectory.minimum_snap import NoPathError
from autopilot.trajectory.peaks import Body, Peaks, survey_transfer
from autopilot.trajectory.rotor_demand import Bounds, gentler_bounds
from autopilot.trajectory.route import PlanError, Planner, Route, bound_violation, path_segments
from autopilot.trajectory.route import slower as slowed_path
from autopilot.trajectory.shaping import ShapedSignals, shape, unshaped_signals
from autopilot.trajectory.splines import PieceTable
from autopilot.trajectory.timeline import MissionState, TimelineEntry, timeline
from autopilot.trajectory.waypoint_path import (
    MAX_POINTS,
    MIN_WAYPOINT_DISTANCE_M,
    PathSegment,
    plan_waypoint_path,
    ride,
)
from missions.model import LoadPath, ReturnHome, Step, Waypoint

AS_REQUESTED, SLOW_DOWN, REFUSE = 0, 1, 2
MAX_SLOWDOWN = 4.0  # times as long as requested
_SLOWDOWN_FACTORS = (1.1, 1.25, 1.5, 1.8, 2.2, 2.8, 3.4, MAX_SLOWDOWN)
_HALVINGS = 3
SLOW_SHARE = 0.55  # of the time of a path: one on which a ride would take less is reported as slow
_GENTLER_DISTANCE = 1.25  # times as far from the requested path, at most, for a path with a greater reserve
_LENGTHENING, _LENGTHENING_TRIES = 1.05, 60  # for lengthening a transfer


class PathLimits(NamedTuple):
    """The vehicle, what is allowed along a path, and what to do with a path that is impossible within it."""

    body: Body
    bounds: Bounds
    shape_paths: bool  # False: signals are flown exactly as requested, even beyond the bounds
    distance_m: float  # greatest distance of a shaped path from the requested one
    when_infeasible: int  # AS_REQUESTED, SLOW_DOWN or REFUSE
    speed_m_s: float  # peaks along paths through waypoints, until the mission sets its own speed
    accel_m_s2: float
    time_optimal: bool  # paths through waypoints are as quick as the bounds allow, without the peaks


class MissionBegin(NamedTuple):
    """Where a mission begins: at which step, and in which state; state None: at home, on the ground."""

    step: int = 0
    state: MissionState | None = None


AT_HOME = MissionBegin()


class SlowPath(NamedTuple):
    """A path through waypoints, of steps `first` to `last`, that takes much longer than a ride along the
    straight lines between them at the speed asked for."""

    first: int
    last: int
    duration_s: float
    ride_s: float
    asked_m_s: float


@dataclass(frozen=True, slots=True)
class PreparedPaths:
    """`paths` has a path for each step that needs one; `notes` say what was changed, `refusal` why it is
    refused."""

    paths: tuple[ShapedSignals | PathSegment | None, ...] = ()
    notes: tuple[str, ...] = ()
    refusal: str = ""
    pending: bool = False  # the paths are not ready yet
    # for each step: least duration of its transfer, 0 if no bound applies
    min_durations_s: tuple[float, ...] = ()
    slow_paths: tuple[SlowPath, ...] = ()
    # where each path through waypoints starts, by the index of its first step
    path_starts: Mapping[int, Vec3] = field(default_factory=dict)


UNPREPARED = PreparedPaths()
PENDING = PreparedPaths(pending=True)


def prepare(
    steps: Sequence[Step],
    sequence: Sequence[int],
    limits: PathLimits,
    home: Vec3 = ZERO,
    planner: Planner | None = None,
    begin: MissionBegin = AT_HOME,
    loop_ends: Collection[int] = (),
) -> PreparedPaths:
    """Prepare the steps; `sequence` has the mission item of each, by which the notes name it, and `home` is
    where a return leads. `planner` is a custom planner of paths through waypoints: it returns a path along
    the route, or raises PlanError. The steps before that of `begin` are prepared as from home. No path leads
    from one of the `loop_ends` to the step behind it."""
    paths: list[ShapedSignals | PathSegment | None] = []
    notes: list[str] = []
    refusal = ""
    entries = _entries(steps, limits, home, begin, loop_ends)
    slow_paths: list[SlowPath] = []
    if planner is None:
        segments, slow_paths = _waypoint_segments(entries, limits)
        notes += [_slowness_note(path, sequence) for path in slow_paths]
    else:
        segments, planner_notes, refusal = _custom_segments(entries, sequence, limits, planner)
        notes += planner_notes
    for index, (step, item) in enumerate(zip(steps, sequence, strict=True)):
        if not isinstance(step, LoadPath):
            paths.append(segments.get(index))
            continue
        if not limits.shape_paths:
            paths.append(unshaped_signals(step))
            continue
        result = shaped_path(step, limits)
        if result.slowdown_reason:
            notes.append(
                f"Item {item} flown {result.path.duration_factor:.2f} times as long: {result.slowdown_reason}"
            )
        if result.problem:
            if limits.when_infeasible != AS_REQUESTED:
                refusal = refusal or f"item {item}: {result.problem}"
            notes.append(f"Item {item}: {result.problem}")
        paths.append(unshaped_signals(step) if result.problem else result.path)
    min_durations_s = tuple(min_transfer_s(entry, limits) for entry in entries) if limits.shape_paths else ()
    return PreparedPaths(
        tuple(paths),
        tuple(notes),
        refusal,
        min_durations_s=min_durations_s,
        slow_paths=tuple(slow_paths),
        path_starts=_path_starts(entries, limits),
    )


def _entries(
    steps: Sequence[Step], limits: PathLimits, home: Vec3, begin: MissionBegin, loop_ends: Collection[int]
) -> tuple[TimelineEntry, ...]:
    """The timeline of the steps, which at the step of `begin` continues from its state."""

    def walk(first: int, last: int | None, state: MissionState) -> tuple[TimelineEntry, ...]:
        ends = [step - first for step in loop_ends]
        gravity = limits.body.gravity
        part = steps[first:last]
        return tuple(timeline(part, state, home, limits.accel_m_s2, gravity_m_s2=gravity, loop_ends=ends))

    usual_m_s = limits.speed_m_s
    at_home = MissionState(cable_m=limits.body.cable_length, speed_m_s=usual_m_s, usual_speed_m_s=usual_m_s)
    return walk(0, begin.step, at_home) + walk(begin.step, None, begin.state or at_home)


def waypoint_path_starts(
    steps: Sequence[Step],
    limits: PathLimits,
    home: Vec3,
    begin: MissionBegin,
    loop_ends: Collection[int] = (),
) -> dict[int, Vec3]:
    """Where each path through waypoints starts, by the index of its first step."""
    return _path_starts(_entries(steps, limits, home, begin, loop_ends), limits)


def _path_starts(entries: Iterable[TimelineEntry], limits: PathLimits) -> dict[int, Vec3]:
    chains = _waypoint_chains(entries, limits.speed_m_s)
    return {first: points[0] for first, points, _ in chains if len(points) > 2}


def min_transfer_s(entry: TimelineEntry, limits: PathLimits) -> float:
    """Least time (s) of the transfer of a step within the bounds; 0 if they need no longer one."""
    duration = entry.transfer_s
    if not isinstance(entry.step, Waypoint | ReturnHome) or duration == 0.0:
        return 0.0
    for _ in range(_LENGTHENING_TRIES):
        peaks = survey_transfer(entry.begin, entry.end, entry.transfer.stretched(duration), limits.body)
        if _transfer_fits(peaks, limits.bounds):
            break
        duration *= _LENGTHENING
    return 0.0 if duration == entry.transfer_s else duration


def _transfer_fits(peaks: Peaks, bounds: Bounds) -> bool:
    return (
        peaks.rotor_high.value <= bounds.rotor_high
        and peaks.rotor_low.value >= bounds.rotor_low
        and peaks.tension_low.value >= bounds.tension_low
        and cos(peaks.tilt.value) >= bounds.cos_tilt
    )


def _waypoint_segments(
    entries: Sequence[TimelineEntry], limits: PathLimits
) -> tuple[dict[int, PathSegment], list[SlowPath]]:
    """For each step that is flown through, by its index, its segment of a path through waypoints, and the
    slow ones of these paths. Paths that would touch the ground or be slower than stops are left out."""
    segments: dict[int, PathSegment] = {}
    slow_paths: list[SlowPath] = []
    for first, points, speed in _waypoint_chains(entries, limits.speed_m_s):
        if len(points) == 2:  # a transfer
            continue
        planned = _planned_path(tuple(points), speed, limits)
        if planned is None:
            continue
        table, times, lowest_m = planned
        if lowest_m > 0.0:
            for i in range(len(points) - 1):
                segments[first + i] = PathSegment(table, times[i], times[i + 1], points[0])
            length = sum(dist(a, b) for a, b in pairwise(points))
            ride_s = ride(length, speed, limits.accel_m_s2)[2]
            if not limits.time_optimal and ride_s < SLOW_SHARE * times[-1]:
                slow_paths.append(SlowPath(first, first + len(points) - 2, times[-1], ride_s, speed))
    return segments, slow_paths


@lru_cache(maxsize=16)
def _planned_path(
    points: tuple[Vec3, ...], speed: float, limits: PathLimits
) -> tuple[PieceTable, tuple[float, ...], float] | None:
    """The path through the points as a table, the times at them, and its lowest place (m);
    None if stops are quicker.

    Cached, as `shaped_path`: planning takes up to a second, and one process flies the same path often,
    in a sweep or after a restart.
    """
    try:
        path, times = plan_waypoint_path(
            points, speed, limits.accel_m_s2, limits.body, limits.bounds, limits.time_optimal
        )
    except NoPathError:
        return None
    return path.table(), tuple(times.tolist()), path.lowest_m()


def _slowness_note(path: SlowPath, sequence: Sequence[int]) -> str:
    return (
        f"Items {sequence[path.first]} to {sequence[path.last]} take {path.duration_s:.1f} s, not "
        f"{path.ride_s:.1f}: too close together, or turns too sharp, for {path.asked_m_s:g} m/s"
    )


def _custom_segments(
    entries: Sequence[TimelineEntry], sequence: Sequence[int], limits: PathLimits, planner: Planner
) -> tuple[dict[int, PathSegment], list[str], str]:
    """The same by a custom planner, with notes, and the reason if its path is refused."""
    segments: dict[int, PathSegment] = {}
    notes: list[str] = []
    for first, points, speed in _waypoint_chains(entries, limits.speed_m_s):
        route = Route(
            tuple(points), speed, limits.accel_m_s2, limits.time_optimal, limits.body, limits.bounds
        )
        item = sequence[first]
        try:
            path = planner(route)
        except PlanError as error:
            return {}, [*notes, f"Item {item}: {error}"], f"item {item}: {error}"
        problem = bound_violation(path, route)
        if problem and limits.when_infeasible == SLOW_DOWN:
            candidates = [(factor, slowed_path(path, factor)) for factor in _SLOWDOWN_FACTORS]
            fitting = [
                (factor, segment) for factor, segment in candidates if not bound_violation(segment, route)
            ]
            if fitting:
                factor, path = fitting[0]
                notes.append(f"Item {item} flown {factor:.2f} times as long: {problem}")
                problem = ""
        if problem:
            notes.append(f"Item {item}: {problem}")
            if limits.when_infeasible != AS_REQUESTED:
                return {}, notes, f"item {item}: {problem}"
        segments |= {first + i: segment for i, segment in enumerate(path_segments(path, route))}
    return segments, notes, ""


def _waypoint_chains(
    entries: Iterable[TimelineEntry], speed: float
) -> Iterator[tuple[int, list[Vec3], float]]:
    """Stretches of consecutive waypoints, all but the last without a hold: the index of the first, the points
    (the first is where the setpoint rests, which must be known), and the speed."""
    points: list[Vec3] = []
    first = 0
    for index, entry in enumerate(entries):
        here, there = entry.before.position, entry.end
        if not isinstance(entry.step, Waypoint) or here is None:
            if points:
                yield first, points, speed
            points = []
            continue
        if points and points[-1] != here:  # the mission begins here
            yield first, points, speed
            points = []
        speed = entry.before.speed_m_s
        if points and (dist(points[-1], there) < MIN_WAYPOINT_DISTANCE_M or len(points) > MAX_POINTS):
            yield first, points, speed
            points = []
        if not points and dist(here, there) >= MIN_WAYPOINT_DISTANCE_M:
            points, first = [here], index
        if points:
            points.append(there)
        if points and entry.step.hold_s > 0.0:
            yield first, points, speed
            points = []
    if points:
        yield first, points, speed


def shaping_problem(shaped: ShapedSignals, limits: PathLimits) -> str:
    """Why the shaped path is not acceptable; empty if it is."""
    if shaped.reason:
        return shaped.reason
    if shaped.distance_m > limits.distance_m:
        return (
            f"the nearest path that can be flown is {shaped.distance_m:.3f} m off; "
            f"allowed are {limits.distance_m:.3f} m"
        )
    return ""


class ShapingResult(NamedTuple):
    """The path flown for signals; why not at the requested speed (`slowdown_reason`), or not at all
    (`problem`)."""

    path: ShapedSignals
    problem: str = ""
    slowdown_reason: str = ""


@lru_cache(maxsize=16)
def shaped_path(step: LoadPath, limits: PathLimits) -> ShapingResult:
    """Signals shaped to the vehicle, slowed down if that is allowed and necessary.

    Cached: hard signals take seconds, and a mission is checked in the same process before it is flown.
    """
    shaped = shape(step, limits.body, limits.bounds)
    problem = shaping_problem(shaped, limits)
    if not problem and len(shaped.pieces):
        return ShapingResult(_gentler(step, shaped, limits) or shaped)
    if problem and limits.when_infeasible == SLOW_DOWN:
        slowed = slow_down(step, limits)
        if slowed is not None:
            return ShapingResult(slowed, slowdown_reason=problem)
    return ShapingResult(shaped, problem)


def _gentler(step: LoadPath, shaped: ShapedSignals, limits: PathLimits) -> ShapedSignals | None:
    """The signals shaped within narrower bounds, if they stay nearly as close to the requested path as
    `shaped`: what a path takes of the rotors without need is lacking against noise and wind."""
    bounds = gentler_bounds(limits.body, limits.bounds)
    if bounds is None:
        return None
    gentler = shape(step, limits.body, bounds)
    if shaping_problem(gentler, limits) or gentler.distance_m > _GENTLER_DISTANCE * shaped.distance_m:
        return None
    return gentler


def slow_down(step: LoadPath, limits: PathLimits) -> ShapedSignals | None:
    """The signals slowed down no more than necessary, to a few percent; None if that does not help either."""

    def shape_slowed(factor: float) -> ShapedSignals | None:
        shaped = shape(slower_step(step, factor), limits.body, limits.bounds)
        return None if shaping_problem(shaped, limits) else replace(shaped, duration_factor=factor)

    # shaping takes longest for an impossible path, so the search tries few of them
    low, best = 1.0, None
    factors = list(_SLOWDOWN_FACTORS)
    while factors:
        half = (len(factors) - 1) // 2
        shaped = shape_slowed(factors[half])
        if shaped is None:
            low, factors = factors[half], factors[half + 1 :]
        else:
            best, factors = shaped, factors[:half]
    if best is None:
        return None
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + best.duration_factor)
        shaped = shape_slowed(middle)
        if shaped is None:
            low = middle
        else:
            best = shaped
    return best
