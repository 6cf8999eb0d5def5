"""Preparation of a mission for its vehicle before the flight: paths are shaped, impossible ones are handled.

Signals become `Shaped` paths; waypoints without a hold are flown through, along one `Passage`. A path that is
impossible nevertheless, or possible only too far from the requested path, is flown as requested, slowed down
or refused, depending on the user's setting.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import cos, dist
from typing import NamedTuple

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.trajectory.peaks import Body, Peaks, survey_transfer
from autopilot.trajectory.rotor_demand import Bounds
from autopilot.trajectory.route import PlanError, Planner, Route, passages
from autopilot.trajectory.route import slower as slower_path
from autopilot.trajectory.route import trouble_of as route_trouble
from autopilot.trajectory.shaping import Shaped, shape, unshaped
from autopilot.trajectory.timeline import MissionState, TimelineEntry, timeline
from autopilot.trajectory.waypoint_path import MOST_POINTS, NEAREST_M, Passage, passage
from missions.model import ReturnHome, Signals, Sine, Step, Term, Waypoint

AS_ASKED, SLOW_DOWN, REFUSE = 0, 1, 2
SLOWEST = 4.0  # times as long as requested
_SLOWER = (1.1, 1.25, 1.5, 1.8, 2.2, 2.8, 3.4, SLOWEST)
_HALVINGS = 3
_LONGER, _LONGER_TRIES = 1.05, 60  # for lengthening a transfer


class Limits(NamedTuple):
    """The vehicle, what is allowed along a path, and what to do with a path that is impossible within it."""

    body: Body
    bounds: Bounds
    shaped: bool  # False: signals are flown exactly as requested, even beyond the bounds
    distance_m: float  # greatest distance of a shaped path from the requested one
    when_infeasible: int  # AS_ASKED, SLOW_DOWN or REFUSE
    speed_m_s: float  # peaks along paths through waypoints, until the mission sets its own speed
    accel_m_s2: float
    time_optimal: bool  # paths through waypoints are as quick as the bounds allow, without the peaks


@dataclass(frozen=True, slots=True)
class Prepared:
    """`made` has a path for each step that needs one; `notes` say what was changed, `refusal` why it is
    refused."""

    made: tuple[Shaped | Passage | None, ...] = ()
    notes: tuple[str, ...] = ()
    refusal: str = ""
    pending: bool = False  # the paths are not ready yet
    least_s: tuple[float, ...] = ()  # for each step: least duration of its transfer, 0 if no bound applies


UNPREPARED = Prepared()
PENDING = Prepared(pending=True)


def prepare(
    steps: Sequence[Step],
    sequence: Sequence[int],
    limits: Limits,
    home: Vec3 = ZERO,
    planner: Planner | None = None,
) -> Prepared:
    """Prepare the steps; `sequence` has the mission item of each, by which the notes name it, and `home` is
    where a return leads. `planner` is a custom planner of paths through waypoints: it returns a path along
    the route, or raises PlanError."""
    made: list[Shaped | Passage | None] = []
    notes: list[str] = []
    refusal = ""
    start = MissionState(cable_m=limits.body.cable_length, speed_m_s=limits.speed_m_s)
    entries = tuple(timeline(steps, start, home, limits.accel_m_s2))
    if planner is None:
        chains = _passages(entries, limits)
    else:
        chains, own_notes, refusal = _planned(entries, sequence, limits, planner)
        notes += own_notes
    for index, (step, item) in enumerate(zip(steps, sequence, strict=True)):
        if not isinstance(step, Signals):
            made.append(chains.get(index))
            continue
        if not limits.shaped:
            made.append(unshaped(step))
            continue
        found = shaped_path(step, limits)
        if found.slowed_for:
            notes.append(f"Item {item} flown {found.path.slowed:.2f} times as long: {found.slowed_for}")
        if found.trouble:
            if limits.when_infeasible != AS_ASKED:
                refusal = refusal or f"item {item}: {found.trouble}"
            notes.append(f"Item {item}: {found.trouble}")
        made.append(unshaped(step) if found.trouble else found.path)
    least = tuple(_transfer_times(entries, limits)) if limits.shaped else ()
    return Prepared(tuple(made), tuple(notes), refusal, least_s=least)


def _transfer_times(entries: Sequence[TimelineEntry], limits: Limits) -> Iterator[float]:
    """For each step the least time (s) of its transfer within the bounds; 0 if they need no longer one."""
    for entry in entries:
        duration = entry.transfer_s
        if not isinstance(entry.step, Waypoint | ReturnHome) or duration == 0.0:
            yield 0.0
            continue
        for _ in range(_LONGER_TRIES):
            if _transfer_fits(survey_transfer(entry.begin, entry.end, duration, limits.body), limits.bounds):
                break
            duration *= _LONGER
        yield 0.0 if duration == entry.transfer_s else duration


def _transfer_fits(along: Peaks, bounds: Bounds) -> bool:
    return (
        along.rotor_high.value <= bounds.rotor_high
        and along.rotor_low.value >= bounds.rotor_low
        and along.tension_low.value >= bounds.tension_low
        and cos(along.tilt.value) >= bounds.cos_tilt
    )


def _passages(entries: Sequence[TimelineEntry], limits: Limits) -> dict[int, Passage]:
    """For each step that is a waypoint of a passage, by its index, its stretch of the passage. Passages that
    would touch the ground are left out."""
    found: dict[int, Passage] = {}
    for first, points, speed in _chains(entries, limits.speed_m_s):
        if len(points) == 2:  # a transfer
            continue
        path, times = passage(
            points, speed, limits.accel_m_s2, limits.body, limits.bounds, limits.time_optimal
        )
        table = path.table()
        if float(path.jets()[1][0, :, 2].min()) + points[0][2] > 0.0:
            for i in range(len(points) - 1):
                found[first + i] = Passage(table, float(times[i]), float(times[i + 1]), points[0])
    return found


def _planned(
    entries: Sequence[TimelineEntry], sequence: Sequence[int], limits: Limits, planner: Planner
) -> tuple[dict[int, Passage], list[str], str]:
    """The same by a custom planner, with notes, and the reason if its path is refused."""
    found: dict[int, Passage] = {}
    notes: list[str] = []
    for first, points, speed in _chains(entries, limits.speed_m_s):
        route = Route(
            tuple(points), speed, limits.accel_m_s2, limits.time_optimal, limits.body, limits.bounds
        )
        item = sequence[first]
        try:
            path = planner(route)
        except PlanError as error:
            return {}, [*notes, f"Item {item}: {error}"], f"item {item}: {error}"
        trouble = route_trouble(path, route)
        if trouble and limits.when_infeasible == SLOW_DOWN:
            slowed = [(factor, slower_path(path, factor)) for factor in _SLOWER]
            fitting = [(factor, one) for factor, one in slowed if not route_trouble(one, route)]
            if fitting:
                factor, path = fitting[0]
                notes.append(f"Item {item} flown {factor:.2f} times as long: {trouble}")
                trouble = ""
        if trouble:
            notes.append(f"Item {item}: {trouble}")
            if limits.when_infeasible != AS_ASKED:
                return {}, notes, f"item {item}: {trouble}"
        found |= {first + i: one for i, one in enumerate(passages(path, route))}
    return found, notes, ""


def _chains(entries: Sequence[TimelineEntry], speed: float) -> Iterator[tuple[int, list[Vec3], float]]:
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
        speed = entry.before.speed_m_s
        if points and (dist(points[-1], there) < NEAREST_M or len(points) > MOST_POINTS):
            yield first, points, speed
            points = []
        if not points and dist(here, there) >= NEAREST_M:
            points, first = [here], index
        if points:
            points.append(there)
        if points and entry.step.hold_s > 0.0:
            yield first, points, speed
            points = []
    if points:
        yield first, points, speed


def trouble_of(found: Shaped, limits: Limits) -> str:
    """Why the shaped path is not acceptable; empty if it is."""
    if found.reason:
        return found.reason
    if found.distance_m > limits.distance_m:
        return (
            f"the nearest path that can be flown is {found.distance_m:.3f} m off; "
            f"allowed are {limits.distance_m:.3f} m"
        )
    return ""


class ShapedPath(NamedTuple):
    """The path flown for signals; why not at the requested speed (`slowed_for`) or not at all (`trouble`)."""

    path: Shaped
    trouble: str = ""
    slowed_for: str = ""


@lru_cache(maxsize=16)
def shaped_path(step: Signals, limits: Limits) -> ShapedPath:
    """Signals shaped to the vehicle, slowed down if that is allowed and necessary.

    Cached: hard signals take seconds, and a mission is checked in the same process before it is flown.
    """
    found = shape(step, limits.body, limits.bounds)
    trouble = trouble_of(found, limits)
    if trouble and limits.when_infeasible == SLOW_DOWN:
        slowed = slow_down(step, limits)
        if slowed is not None:
            return ShapedPath(slowed, slowed_for=trouble)
    return ShapedPath(found, trouble)


def slow_down(step: Signals, limits: Limits) -> Shaped | None:
    """The signals slowed down no more than necessary, to a few percent; None if that does not help either."""

    def tried(factor: float) -> Shaped | None:
        found = shape(slower(step, factor), limits.body, limits.bounds)
        return None if trouble_of(found, limits) else replace(found, slowed=factor)

    # shaping takes longest for an impossible path, so the search tries few of them
    low, best = 1.0, None
    factors = list(_SLOWER)
    while factors:
        half = (len(factors) - 1) // 2
        found = tried(factors[half])
        if found is None:
            low, factors = factors[half], factors[half + 1 :]
        else:
            best, factors = found, factors[:half]
    if best is None:
        return None
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + best.slowed)
        found = tried(middle)
        if found is None:
            low = middle
        else:
            best = found
    return best


def slower(step: Signals, factor: float) -> Signals:
    """The same path at 1 / factor of the speed."""

    def sine(s: Sine) -> Sine:
        return Sine(factor * s.period_s, s.phase_rad, factor * s.start_s)

    def term(t: Term) -> Term:
        return Term(
            t.axis,
            t.amplitude_m,
            factor * t.start_s,
            factor * t.rise_s,
            None if t.hold_s is None else factor * t.hold_s,
            factor * t.fall_s,
            tuple(sine(s) for s in t.factors),
            None if t.rise_90_by_s is None else factor * t.rise_90_by_s,
        )

    return Signals(factor * step.duration_s, tuple(term(t) for t in step.terms))
