"""Why a mission is refused before it is flown: the fence, a height, a released load, the winch.

Each check walks the timeline of the steps (`autopilot.trajectory.timeline`) from the present state.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from autopilot.geometry.linear import Vec3, add, axpy, norm, sub
from autopilot.supervisor.motion import cable_length_at, stopping_legs
from autopilot.supervisor.requests.limits import MIN_ALTITUDE_M
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    ON_GROUND,
    Flight,
    MissionPlan,
    Phase,
    View,
    fence_problem,
    first_fence_violation,
    has_fence,
    load_position_below,
    measured_fence_violation,
)
from autopilot.supervisor.step_legs import NEAR_START
from autopilot.supervisor.watches.fence import NO_ACTION
from autopilot.trajectory.load_path import path_tables
from autopilot.trajectory.prepare import MissionBegin, waypoint_path_starts
from autopilot.trajectory.shaping import requested_jets
from autopilot.trajectory.timeline import (
    ANYWHERE,
    MIN_REEL_M,
    MissionState,
    TimelineEntry,
    cable_length_problem,
    timeline,
)
from autopilot.trajectory.waypoint_path import PathSegment, sample_path
from autopilot.wire.statustext import listed
from missions.model import AttitudeRun, LoadPath, ReturnHome, Takeoff, Waypoint, Winch

# spacing of the places at which a line is checked, and their greatest number
CHECK_SPACING_M, MAX_CHECK_POINTS = 0.25, 4000
CHECK_SPACING_S = 0.1  # the same for a path in time
MIN_CURVE_POINTS = 16  # between two waypoints, however close
# where passes of a loop differ: how many steps are checked, and the distance that is no difference
MAX_REPEATED_STEPS, SAME_PLACE_M = 200, 1e-3
MAX_CHECKED_RALLY = 50  # rally points that are compared with the fence

RemainingSteps = list[tuple[int, TimelineEntry]]  # each with its mission item


def mission_problem(flight: Flight, ahead: RemainingSteps, settings: Settings) -> str:
    """Which remaining item must not be flown from here, and why; an empty string if there is none."""
    again = repeated_steps(flight.mission.plan, ahead, flight.area.home)
    return (
        fence_exit_problem(flight, ahead, settings)
        or curve_exit_problem(flight, ahead, settings)
        or height_problem(ahead)
        or missing_load_problem(ahead)
        or winch_problem(ahead, settings)
        or _when_repeated(
            fence_exit_problem(flight, again, settings)
            or missing_load_problem(again)
            or winch_problem(again, settings)
        )
    )


def upload_problem(flight: Flight, plan: MissionPlan, view: View, settings: Settings) -> str:
    """Which item of an uploaded mission leads beyond the fence or too low, and why; an empty string if none
    does.

    On the ground the mission begins where the load stands; in the air it may begin anywhere.
    """
    start = (
        _on_ground(flight, view, settings)
        if flight.phase in ON_GROUND
        else _with_present(ANYWHERE, flight, settings.cable_length_m)
    )
    home = flight.area.home
    ahead = list(zip(plan.sequence, timeline(plan.steps, start, home), strict=True))
    return (
        fence_exit_problem(flight, ahead, settings)
        or height_problem(ahead)
        or _when_repeated(fence_exit_problem(flight, repeated_steps(plan, ahead, home), settings))
    )


def _when_repeated(problem: str) -> str:
    return problem and f"{problem}, when a jump without end repeats it"


def remaining_timeline(flight: Flight, view: View, settings: Settings) -> RemainingSteps:
    """The remaining steps of the mission, flown from where the load is or comes to rest; on the ground and
    while it takes off, the load is lifted before them."""
    mission, cable = flight.mission, flight.cable
    steps, sequence = mission.plan.steps[mission.step :], mission.plan.sequence[mission.step :]
    if flight.phase in ON_GROUND or is_taking_off(flight):
        start = _on_ground(flight, view, settings)
        lift = Takeoff(lift_altitude_m(mission.plan, settings))
        if isinstance(steps[0], Takeoff):
            steps = (lift, *steps[1:])
        else:  # lifted although no step requests it
            steps, sequence = (lift, *steps), (sequence[0], *sequence)
    else:
        here = stopping_legs(flight, view, settings)[1]
        length = cable_length_at(flight, here, settings)
        if mission.step_anchor is not None and isinstance(steps[0], LoadPath | AttitudeRun):
            here = mission.step_anchor  # its path counts from where it began
        if cable.reel_target_m is not None and isinstance(steps[0], Winch):  # resumed
            steps = (replace(steps[0], length_m=cable.reel_target_m - length), *steps[1:])
        start = _with_present(MissionState(here), flight, length)
    return list(zip(sequence, timeline(steps, start, flight.area.home), strict=True))


def repeated_steps(plan: MissionPlan, ahead: RemainingSteps, home: Vec3) -> RemainingSteps:
    """What loops without end fly after these last steps of a plan, until a step begins in the state in which
    it began before, from which on all is the same again.

    Where each pass changes the state, as signals that lead away and a winch do, there are many passes.
    """
    count, again = len(plan.steps), RemainingSteps()
    began = {count - len(ahead) + i: entry.before for i, (_, entry) in enumerate(ahead)}  # by step
    for end in plan.loops:
        if count - end > len(ahead):
            continue  # a loop that was left
        state, step = ahead[end - count][1].after, plan.next_step(end)
        while step is not None and len(again) < count + MAX_REPEATED_STEPS:
            if step in began and _is_same_state(state, began[step]):
                break
            began[step] = state
            (entry,) = timeline((plan.steps[step],), state, home)
            again.append((plan.sequence[step], entry))
            state, step = entry.after, plan.next_step(step)
    return again


def _is_same_state(a: MissionState, b: MissionState) -> bool:
    """Whether a step leads the same way from either state."""
    if (a.released, a.unknown_after, a.fence_on) != (b.released, b.unknown_after, b.fence_on):
        return False
    if a.expected is None or b.expected is None or a.cable_m is None or b.cable_m is None:
        return (a.expected, a.cable_m) == (b.expected, b.cable_m)
    return norm(sub(a.expected, b.expected)) < SAME_PLACE_M and abs(a.cable_m - b.cable_m) < MIN_REEL_M


def is_taking_off(flight: Flight) -> bool:
    """Whether the load is tautened or lifted for the mission, which begins afterwards."""
    return flight.mission.active and flight.phase in (Phase.TAUTEN, Phase.LIFT)


def mission_begin(flight: Flight, ahead: RemainingSteps, settings: Settings) -> MissionBegin:
    """The present step of the mission, and the state in which it begins from here."""
    mission = flight.mission
    state = ahead[mission.step - len(mission.plan.steps)][1].before  # behind a lift that no step requests
    usual_m_s = settings.limits.speed_m_s  # to which a take-off returns
    speed_m_s = mission.speed_m_s if mission.step and flight.phase not in ON_GROUND else usual_m_s
    return MissionBegin(mission.step, replace(state, speed_m_s=speed_m_s, usual_speed_m_s=usual_m_s))


def is_prepared_from_here(flight: Flight, ahead: RemainingSteps, settings: Settings) -> bool:
    """Whether the next path through waypoints was prepared from where the load is or comes to rest.

    The paths behind it begin at waypoints, wherever the mission begins.
    """
    mission = flight.mission
    prepared = mission.plan.prepared
    begin = mission_begin(flight, ahead, settings)
    if not prepared.paths or begin.state is None or begin.state.expected is None:
        return True
    plan, home = mission.plan, flight.area.home
    starts = waypoint_path_starts(plan.steps, settings.limits, home, begin, plan.loops)
    step = min((step for step in starts if step >= mission.step), default=None)
    if step is None:
        return True
    prepared_start = prepared.path_starts.get(step)
    return prepared_start is not None and norm(sub(starts[step], prepared_start)) < NEAR_START


def lift_altitude_m(plan: MissionPlan, settings: Settings) -> float:
    """Height to which a mission that begins on the ground lifts the load, whatever its first step is."""
    first = next((step for step in plan.steps if isinstance(step, Takeoff)), None)
    return settings.motion.takeoff_altitude_m if first is None else first.altitude_m


def _on_ground(flight: Flight, view: View, settings: Settings) -> MissionState:
    """The state in which the load, or the vehicle without a load, stands on the ground.

    The position is unknown (`ANYWHERE`) while the estimate is not fit for flight.
    """
    here = view.x_quad if flight.cable.released else view.x_load
    start = ANYWHERE if view.estimate_problems else MissionState(here)
    return _with_present(start, flight, settings.cable_length_m)


def _with_present(state: MissionState, flight: Flight, cable_m: float) -> MissionState:
    """The state with load and fence as they are now."""
    released, fence_on = flight.cable.released, flight.area.fence_enabled
    return replace(state, cable_m=cable_m, released=released, fence_on=fence_on)


def fence_exit_problem(flight: Flight, ahead: RemainingSteps, settings: Settings) -> str:
    """Which item leads beyond the fence, and why; an empty string if none does.

    This checks the straight ways to take-off height, to waypoints and home, the paths of signals and
    trajectories, and the place at which the winch leaves the load; for curves there is `curve_exit_problem`.
    """
    if settings.fence.action == NO_ACTION or not has_fence(flight, settings):
        return ""
    for seq, entry in ahead:
        reason = _violation_of_step(flight, entry, settings) if entry.before.fence_on else ""
        if reason:
            return f"item {seq} {_leading(reason)}"
    return ""


def forbidden_rally_text(flight: Flight, settings: Settings) -> str:
    """A warning that names the rally points that the fence forbids; empty if there are none."""
    places = enumerate(flight.area.rally[:MAX_CHECKED_RALLY])
    outside = [number for number, place in places if fence_problem(flight, place, settings)]
    if not outside:
        return ""
    points = "point {} is" if len(outside) == 1 else "points {} are"
    return f"Rally {points.format(listed(outside))} outside the fence: no return leads there"


def _leading(reason: str) -> str:
    """What leads to a place where the load may not be, with the reason: into a zone, or beyond the fence."""
    return f"leads {'into' + reason.removeprefix('in') if reason.startswith('in ') else reason}"


def _violation_of_step(flight: Flight, entry: TimelineEntry, settings: Settings) -> str:
    begin, end = entry.before.expected, entry.after.expected
    if end is None or not isinstance(entry.step, Takeoff | Waypoint | ReturnHome | LoadPath | Winch):
        return ""
    # a way that begins beyond the fence leads back: only its end counts
    if begin is None or isinstance(entry.step, Winch) or _first_violation(flight, entry, (begin,), settings):
        return _first_violation(flight, entry, (end,), settings)
    if isinstance(entry.step, LoadPath):
        return _violation_of_path(flight, entry, entry.step, begin, settings)
    return _first_violation(flight, entry, _points_along(begin, end), settings)


def _violation_of_path(
    flight: Flight, entry: TimelineEntry, step: LoadPath, begin: Vec3, settings: Settings
) -> str:
    """Why load or vehicle may not be where signals or a trajectory lead, from when on, and when and where the
    limit is exceeded most; an empty string if they may."""
    fence, there = flight.area.fence, _settings_after(entry, settings)
    pieces = min(math.ceil(step.duration_s / CHECK_SPACING_S), MAX_CHECK_POINTS)
    times = np.linspace(0.0, step.duration_s, pieces + 1)[1:]
    displacements = requested_jets(path_tables(step), step.duration_s, times)[0].tolist()
    places = _load_places(entry, (add(begin, (x, y, z)) for x, y, z in displacements), there)
    found = [
        (violation, t, place)
        for t, place in zip(times.tolist(), places, strict=True)
        if (violation := measured_fence_violation(fence, place, there)) is not None
    ]
    if not found:
        return ""
    first, first_s, _ = found[0]
    same = (one for one in found if one[0].limit == first.limit)
    worst, worst_s, place = max(same, key=lambda one: one[0].beyond_m)
    east, north, up = (round(value, 1) + 0.0 for value in place)
    where = f"{worst.measured}, load at N {north} E {east}, {up} m up"
    return f"{first.limit} after {first_s:.1f} s; worst at {worst_s:.1f} s: {where}"


def _first_violation(flight: Flight, entry: TimelineEntry, places: Iterable[Vec3], settings: Settings) -> str:
    """Why load or vehicle may not be at one of the places to which a step leads; an empty string if they may
    be at all of them."""
    settings = _settings_after(entry, settings)
    return first_fence_violation(flight.area.fence, _load_places(entry, places, settings), settings)


def _load_places(entry: TimelineEntry, places: Iterable[Vec3], settings: Settings) -> Iterable[Vec3]:
    """Where the load hangs, or would hang if it were not released, at these places of a step."""
    return (load_position_below(place, settings) for place in places) if entry.after.released else places


def _settings_after(entry: TimelineEntry, settings: Settings) -> Settings:
    """The settings with the length that the cable has after a step."""
    cable_m = entry.after.cable_m
    return settings if cable_m is None else replace(settings, cable_length_m=cable_m)


def curve_exit_problem(flight: Flight, ahead: RemainingSteps, settings: Settings) -> str:
    """Which item is reached on a curve through waypoints that leads beyond the fence, and why; an empty
    string if none is, or if the curves are not prepared yet."""
    if settings.fence.action == NO_ACTION or not has_fence(flight, settings):
        return ""
    mission = flight.mission
    paths = mission.plan.prepared.paths[mission.step :]
    table = None  # of the path that is flown
    for path, (seq, entry) in zip(paths, ahead[len(ahead) - len(paths) :], strict=True):
        if not isinstance(path, PathSegment) or not entry.before.fence_on:
            continue
        if path.begin_s == 0.0 and norm(sub(entry.begin, path.start)) < NEAR_START:
            table = path.table
        if path.table is table:
            places = _points_on_curve(path, entry)
            reason = _first_violation(flight, entry, places, settings)
            if reason and not _first_violation(flight, entry, (entry.begin,), settings):
                return f"the curve to item {seq} {_leading(reason)}"
    return ""


def _points_on_curve(path: PathSegment, entry: TimelineEntry) -> Iterable[Vec3]:
    """Places on a segment of a path through waypoints, at most about CHECK_SPACING_M apart."""
    straight_m = norm(sub(entry.end, entry.begin))
    pieces = min(MIN_CURVE_POINTS + math.ceil(2.0 * straight_m / CHECK_SPACING_M), MAX_CHECK_POINTS)
    times = np.linspace(path.begin_s, path.end_s, pieces + 1)[1:]
    return ((x, y, z) for x, y, z in sample_path(path.table, times)[0].tolist())


def _points_along(begin: Vec3, end: Vec3) -> Iterable[Vec3]:
    """Places on a straight line, at most CHECK_SPACING_M apart, up to its end."""
    displacement = sub(end, begin)
    pieces = min(max(1, math.ceil(norm(displacement) / CHECK_SPACING_M)), MAX_CHECK_POINTS)
    return (axpy((k + 1) / pieces, displacement, begin) for k in range(pieces))


def height_problem(ahead: RemainingSteps) -> str:
    """Which item carries the load lower than any other request may; an empty string if none does."""
    for seq, entry in ahead:
        step = entry.step
        if entry.before.released or not isinstance(step, Takeoff | Waypoint):
            continue
        if step.altitude_m < MIN_ALTITUDE_M:
            return f"item {seq}: load height {step.altitude_m:.2f} m, min {MIN_ALTITUDE_M} m"
    return ""


def missing_load_problem(ahead: RemainingSteps) -> str:
    """Which item requires a load that is released by then, and why; an empty string if none does."""
    for seq, entry in ahead:
        if entry.before.released and isinstance(entry.step, LoadPath | AttitudeRun):
            return f"item {seq} needs the load, which is released"
    return ""


def winch_problem(ahead: RemainingSteps, settings: Settings) -> str:
    """Which item demands too much of the winch, and why; an empty string if none does."""
    for seq, entry in ahead:
        step, after = entry.step, entry.after
        if not isinstance(step, Winch):
            continue
        if settings.winch.problem:
            return f"item {seq}: {settings.winch.problem}"
        if after.released:
            return f"item {seq} needs the load, which is released"
        if step.speed_m_s is not None and step.speed_m_s > settings.winch.speed_m_s:
            return f"item {seq}: {step.speed_m_s:g} m/s exceeds WNC_SPEED {settings.winch.speed_m_s:g}"
        assert after.cable_m is not None, "a flight knows its cable"
        height = math.inf if after.position is None else after.position[2]
        problem = reel_problem(after.cable_m, height, settings)
        if problem:
            return f"item {seq}: {problem}"
    return ""


def reel_problem(target_m: float, height: float, settings: Settings) -> str:
    """Why the cable may not become `target_m` m long with the load at `height`; an empty string if it may."""
    problem = cable_length_problem(target_m, settings.winch.min_length_m, settings.winch.max_length_m)
    if problem:
        return problem
    if height < MIN_ALTITUDE_M - MIN_REEL_M:
        return f"load height {height:.2f} m, min {MIN_ALTITUDE_M} m"
    return ""
