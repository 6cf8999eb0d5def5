"""`gcs check`: a mission against the vehicle that is to fly it, without this vehicle."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import groupby
from math import dist, floor, inf

from autopilot.own.own_code import OwnCode
from autopilot.trajectory.feasibility import PathReport, VehicleLimits, Violation, paths
from autopilot.trajectory.route import PlanError, Planner
from autopilot.trajectory.signals import risen_share
from autopilot.trajectory.timeline import TimelineEntry
from autopilot.trajectory.transfer import reachable_speed, transfer_duration
from autopilot.vehicle.file import belief_of
from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.parameters import (
    DEFAULT_LAW,
    AutopilotParameters,
    autopilot_parameters,
    shapes_paths,
)
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import decode_items
from autopilot.wire.parameter_table import ParameterTable
from gcs.errors import GcsError, InputError
from gcs.expected_flight import expected_entries, expected_flight_s, limit_text, time_limit_s
from gcs.foreign_mission import ForeignMission, home_text
from gcs.mission_files import read
from gcs.mission_items import (
    ends_on_ground,
    in_file_terms,
    in_mission_terms,
    items_of,
    problem_in_file,
    step_in_file,
)
from gcs.workflows.before_flight import law_problem, unused_planner_text
from gcs.workflows.charge import charge_after, charge_warning
from gcs.workflows.flight_inputs import delivered_parameters, vehicle_warnings
from gcs.workflows.flight_options import FlightOptions, parse_setting
from gcs.workflows.flyable import violations, winch_items
from gcs.workflows.refusals import Answer, ask_supervisor
from gcs.workflows.vehicle_limits import load_limits, with_settings
from gcs.workflows.wind import craft_of, split_wind
from missions.model import (
    AttitudeRun,
    LoadPath,
    Mission,
    Release,
    ReturnHome,
    Signals,
    Speed,
    Takeoff,
    Waypoint,
)

# Share of the rotors' range that a path must leave for control if the true vehicle differs from the assumed
# one: slower rotors, a sagging battery and a cable off the centre take a part of it, wind another.
# `heavy-real` loses Case C with 15 % and completes it with 35 %; with 40 % also in wind of 5 m/s with gusts
# of 1 m/s (docs/realism.md).
MIN_CONTROL_SHARE = 0.25
MIN_REACHED_SHARE = 0.9  # of a speed that the mission sets: a way that stays below it is reported
MIN_MOVED_SHARE = 0.9  # of a rise or fall within its item: one that is cut off earlier is reported
MORE_MARGIN = "--set MIS_ROTOR_MARG=40 --set MIS_INFEASIBLE=1 of gcs fly"


def path_reports(
    mission: Mission,
    limits: VehicleLimits,
    planner: Planner | None = None,
    shaped: bool = True,
) -> list[PathReport]:
    """How a vehicle with these limits flies the mission, with paths `shaped` by the autopilot or as
    requested; a `planner` makes those through waypoints. GcsError says what is wrong with a planned path."""
    try:
        return paths(_as_sent(mission), limits, planner, shaped)
    except PlanError as error:
        raise GcsError(f"{mission.name}: {in_file_terms(str(error), mission)}") from None


def _as_sent(mission: Mission) -> Mission:
    """The mission with its waypoints on the grid on which mission items carry them: how fast waypoints that
    are close together can be flown depends on it."""
    if isinstance(mission, ForeignMission):  # its steps are made of items
        return mission
    sent = decode_items(items_of(mission, Home()), Home())
    steps = (
        there if isinstance(here, Waypoint) else here for here, there in zip(mission.steps, sent, strict=True)
    )
    described = mission.name, mission.title, mission.description, mission.assumptions
    return Mission(*described, tuple(steps), locations=mission.locations)


def slowness_notes(reports: Sequence[PathReport]) -> Iterator[str]:
    """A line about each path through waypoints that does not come near the speed asked for."""
    for asked_m_s, group in groupby(reports, lambda report: report.asked_m_s):
        items = [report.item for report in group]
        if asked_m_s:
            yield (
                f"note: items[{items[0]}] to items[{items[-1]}]: too close together, or turns too sharp, for "
                f"{asked_m_s:g} m/s; leave out waypoints, or fly a trajectory (docs/missions.md)"
            )


def unreached_speed_notes(
    mission: Mission, reports: Sequence[PathReport], table: AutopilotParameters
) -> Iterator[str]:
    """A line about each speed that the mission sets and that no way comes near until it sets the next."""
    peaks_m_s: dict[int, float] = {}
    slow = set()  # these have a note already
    for report in reports:
        peaks_m_s[report.item] = max(report.speed_m_s, peaks_m_s.get(report.item, 0.0))
        slow |= {report.item} if report.asked_m_s else set()
    for asked_m_s, ways in _ways_by_set_speed(expected_entries(mission, table)):
        reached_m_s = max(
            peaks_m_s.get(way.item, way.transfer.peak_speed(dist(way.begin, way.end))) for way in ways
        )
        is_told = any(way.item in slow for way in ways)
        if is_told or reached_m_s >= MIN_REACHED_SHARE * asked_m_s:
            continue
        length_m, accel_m_s2 = sum(dist(way.begin, way.end) for way in ways), table["MIS_ACCEL"]
        straight_m_s = reachable_speed(length_m, asked_m_s, accel_m_s2)
        limits = f"MIS_ACCEL {accel_m_s2:g} m/s^2"
        is_too_short = straight_m_s < MIN_REACHED_SHARE * asked_m_s
        why = f"too short at {limits}" if is_too_short else f"held back by turns, {limits}, rotors or tilt"
        items = dict.fromkeys(f"items[{way.item}]" for way in (ways[0], ways[-1]))
        reach = "reaches" if len(items) == 1 else "reach"
        yield f"note: {' to '.join(items)}: {reach} {reached_m_s:.1f} of the {asked_m_s:g} m/s asked: {why}"


def _ways_by_set_speed(entries: Iterable[TimelineEntry]) -> Iterator[tuple[float, list[TimelineEntry]]]:
    """Each speed that the mission sets, and the ways until it sets the next, if there are any."""
    asked_m_s: float | None = None
    ways: list[TimelineEntry] = []
    for entry in entries:
        if isinstance(entry.step, Speed):
            if asked_m_s and ways:
                yield asked_m_s, ways
            asked_m_s, ways = entry.step.speed_m_s, []
        elif isinstance(entry.step, Waypoint | ReturnHome) and entry.transfer_s > 0.0:
            ways.append(entry)
    if asked_m_s and ways:
        yield asked_m_s, ways


def cut_off_notes(mission: Mission) -> Iterator[str]:
    """A line about each term of signals whose rise or fall the end of its item cuts off, or that never
    begins."""
    for item, step in enumerate(mission.steps):
        if not isinstance(step, Signals):
            continue
        for number, term in enumerate(step.terms):
            label = f"note: items[{item}].terms[{number}]"
            end = f"duration_s {step.duration_s:g} of the item"
            top_s = term.start_s + term.rise_s
            edge_s = inf if term.hold_s is None else top_s + term.hold_s
            if term.start_s >= step.duration_s:
                yield f"{label}: has no effect: start_s = {term.start_s:g} is not before the {end}"
                continue
            for name, begin_s, length_s in (
                ("rise", term.start_s, term.rise_s),
                ("fall", edge_s, term.fall_s),
            ):
                if not begin_s < step.duration_s < begin_s + length_s:
                    continue
                share = risen_share(step.duration_s - begin_s, length_s)
                if share < MIN_MOVED_SHARE:
                    yield (
                        f"{label}: {name}_s = {length_s:g} is cut off by the {end}, after "
                        f"{100.0 * share:.2g} % of its {name}"
                    )


def margin_warnings(reports: Sequence[PathReport], vehicle: str, belief: Vehicle) -> Iterator[str]:
    """A line for each path that leaves little for control, if the true vehicle is not the assumed one,
    `belief`."""
    believed = belief_of(vehicle)
    if believed == vehicle:
        return
    rotor_range = belief.rotor_max_n - belief.rotor_min_n
    for report in reports:
        margin = min(report.rotor_low_n - belief.rotor_min_n, belief.rotor_max_n - report.rotor_high_n)
        if belief.limited and margin < MIN_CONTROL_SHARE * rotor_range:
            share, min_share = round(100.0 * margin / rotor_range), round(100.0 * MIN_CONTROL_SHARE)
            yield (
                f"warning: items[{report.item}] ({report.kind}): {share} % of the rotors' range is left for "
                f"control, and {vehicle} differs from what the autopilot assumes ({believed}): below "
                f"{min_share} % such a flight may be lost; {MORE_MARGIN} plans it slower"
            )


def flown_s(mission: Mission, reports: Sequence[PathReport], table: AutopilotParameters) -> float:
    """Expected seconds from arming to the end of the mission, along these paths."""
    entries = expected_entries(mission, table)
    # the lift keeps to a speed of its own, which path reports do not know
    moves_s = {entry.item: _move_s(entry) for entry in entries if not isinstance(entry.step, Takeoff)}
    longer_s = sum(report.duration_s - moves_s[report.item] for report in reports if report.item in moves_s)
    return sum(entry.duration_s for entry in entries) + longer_s


def timeout_warnings(
    mission: Mission, reports: Sequence[PathReport], table: AutopilotParameters
) -> Iterator[str]:
    """A line if the paths take so much longer than the mission asks for that `gcs fly` would give up."""
    expected_s, limit_s = flown_s(mission, reports, table), time_limit_s(expected_flight_s(mission, table))
    if expected_s > limit_s:
        yield (
            f"warning: along these paths the flight takes about {expected_s:.0f} s, and gcs fly gives up "
            f"after {limit_s:.0f} s: add --timeout {time_limit_s(expected_s):.0f}"
        )


def _move_s(entry: TimelineEntry) -> float:
    """The part of a step's duration (s) that a path report gives as it is flown."""
    return entry.duration_s if isinstance(entry.step, LoadPath | AttitudeRun) else entry.transfer_s


def winch_notes(mission: Mission, table: AutopilotParameters) -> Iterator[str]:
    """A line about each winch item while the load is carried, which path reports do not include."""
    for entry, step, length_m in winch_items(mission, table):
        if not entry.before.released:
            speed_m_s = step.speed_m_s or table["WNC_SPEED"]
            duration_s = transfer_duration(abs(step.length_m), speed_m_s, table["WNC_ACCEL"])
            yield (
                f"note: items[{entry.item}] (winch): {duration_s:.1f} s, to a cable of {length_m:.2f} m; "
                "the vehicle stays in place, no path to report"
            )


def _flown_alone(mission: Mission, table: AutopilotParameters) -> tuple[TimelineEntry, ...]:
    """The items after a release."""
    entries = expected_entries(mission, table)
    releases = [index for index, entry in enumerate(entries) if isinstance(entry.step, Release)]
    return entries[releases[0] + 1 :] if releases else ()


def notes_after_release(mission: Mission, table: AutopilotParameters) -> Iterator[str]:
    """A line about the items after a release, which path reports do not include."""
    if rest := _flown_alone(mission, table):
        items = " to ".join(dict.fromkeys(f"items[{entry.item}]" for entry in (rest[0], rest[-1])))
        yield (
            f"note: {items}: about {sum(entry.duration_s for entry in rest):.0f} s, flown without the load, "
            "slower where the rotors ask for it; estimated from distances and speeds, no path to report"
        )


def wind_problems(mission: Mission, options: FlightOptions) -> list[str]:
    """What the vehicle lacks in the wind of a flight; along its paths too, unless they are those of a custom
    planner, or are not checked."""
    wind_m_s, others = split_wind(map(parse_setting, options.settings))
    limits, reports = load_limits(options.vehicle, options.mission_settings), []
    if not (options.planner or options.force):
        table = with_settings(autopilot_parameters(limits.vehicle), options.mission_settings)
        reports = path_reports(mission, limits, shaped=shapes_paths(table, options.law == DEFAULT_LAW))
    lacks = craft_of(options.vehicle, limits, others).lacks(wind_m_s, reports)
    return [problem_in_file(one.violation.item, one.violation.text, mission) for one in lacks]


@dataclass(frozen=True)
class CheckResult:
    """What `gcs check` found: what the vehicle cannot fly, or what it would refuse, in its words, or else how
    it flies each path, with warnings."""

    mission: str
    vehicle: str
    violations: tuple[Violation, ...]
    paths: tuple[PathReport, ...]
    warnings: tuple[str, ...] = ()
    refusals: tuple[str, ...] = ()
    expected_s: float | None = None  # from arming to the end; None if it cannot be flown
    time_limit_s: float | None = None  # after which gcs fly gives up
    # the greatest steady wind in which it can be flown, and why not in more; None if there is no such limit
    wind_limit_m_s: float | None = None
    wind_reason: str = ""
    battery_left_pct: float | None = None  # at the end; None without a simulated battery

    @property
    def problems(self) -> tuple[str, ...]:
        """Why the mission cannot be flown; empty if it can."""
        return (*map(str, self.violations), *self.refusals)

    def lines(self) -> tuple[str, ...]:
        """The result as text."""
        if self.problems:
            return self.problems
        can_fly = f"{self.mission}: vehicle {self.vehicle} can fly it"
        paths = _path_lines(self.paths)
        about_all = (*self._duration_lines(), *self._wind_lines(), *self._battery_lines())
        return (can_fly, *paths, *about_all, *self.warnings)

    def _duration_lines(self) -> Iterator[str]:
        if self.expected_s is not None and self.time_limit_s is not None:
            yield (
                f"in all: about {limit_text(self.expected_s)} from arming to the end; gcs fly gives up after "
                f"{limit_text(self.time_limit_s)}"
            )

    def _wind_lines(self) -> Iterator[str]:
        if self.wind_limit_m_s is not None:
            limit_m_s = floor(10.0 * self.wind_limit_m_s) / 10.0
            yield f"withstands {limit_m_s:.1f} m/s of steady wind: in more, {self.wind_reason}"

    def _battery_lines(self) -> Iterator[str]:
        if self.battery_left_pct is not None:
            yield f"battery: about {self.battery_left_pct:.0f} % of its charge is left at the end"


def _path_lines(reports: Iterable[PathReport]) -> Iterator[str]:
    """A line for each item, however often a jump repeats it."""
    passes: dict[int, list[PathReport]] = {}
    for item, group in groupby(reports, key=lambda report: report.item):
        parts = list(group)  # the way to a circle, and the circle
        duration_s = sum(part.duration_s for part in parts)
        passes.setdefault(item, []).append(replace(reduce(PathReport.merged, parts), duration_s=duration_s))
    for times in passes.values():
        yield reduce(PathReport.merged, times).text(len(times))


def _in_file_terms(found: CheckResult, mission: Mission, notes: tuple[str, ...]) -> CheckResult:
    """The result, which counts steps and the items that are sent, with the numbers of the file and notes that
    have them already."""
    return replace(
        found,
        violations=tuple(
            replace(
                one, item=step_in_file(one.item, mission), text=problem_in_file(one.item, one.text, mission)
            )
            for one in found.violations
        ),
        paths=tuple(replace(one, item=step_in_file(one.item, mission)) for one in found.paths),
        wind_reason=in_file_terms(found.wind_reason, mission),
        warnings=(*notes, *(in_file_terms(text, mission) for text in found.warnings)),
        refusals=tuple(in_mission_terms(text, mission) for text in found.refusals),
    )


def _with_charge(found: CheckResult, mission: Mission, table: AutopilotParameters) -> CheckResult:
    """The result, and what the mission leaves of the battery."""
    expected_s = found.expected_s or 0.0
    alone_s = sum(entry.duration_s for entry in _flown_alone(mission, table))
    charge = charge_after(found.vehicle, expected_s - alone_s, alone_s)
    if charge is None:
        return found
    if charge.lasts_s is not None:
        lasts, takes = limit_text(charge.lasts_s), limit_text(expected_s)
        text = f"the battery is empty after about {lasts} in the air, and the flight takes about {takes}"
        empty = Violation(0, "charge", expected_s, charge.lasts_s, charge.lasts_s, text)
        return replace(found, violations=(empty,), expected_s=None, time_limit_s=None)
    warning = charge_warning(charge.left, table)
    warnings = found.warnings + ((warning,) if warning else ())
    return replace(found, battery_left_pct=100.0 * charge.left, warnings=warnings)


def check_parameters(vehicle: str, planner: str, ignored: Collection[str]) -> ParameterTable:
    """The parameters of the autopilot and of the `planner` with which the vehicle is delivered. GcsError if
    it is delivered with one that neither has and that is not `ignored`: flights without the custom code that
    has it are refused. So is one of the autopilot's own among those `ignored`, as paths are judged by it."""
    table = delivered_parameters(vehicle, OwnCode(planner=planner), ignored)
    for name in ignored:
        if name in table:
            text = f"the mission is checked with it; --set {name}=VALUE gives it another value"
            raise InputError(f"--ignore {name}: {text}")
    return table


def check_mission(
    name_or_path: str,
    vehicle: str,
    as_asked: bool,
    planner: Planner | None = None,
    settings: Sequence[tuple[str, float]] = (),
    law: str = "",
) -> CheckResult:
    """Check a mission by name or path, or the file of another ground station, against a vehicle with these
    parameters of its autopilot, in the wind that is among them; `as_asked`: without shaping. `law`: also
    whether it can be flown with this law, the name of a built-in one.

    GcsError if a custom `planner` fails to plan it.
    """
    wind_m_s, settings = split_wind(settings)
    limits, mission = load_limits(vehicle, settings), read(name_or_path)
    if problem := law_problem(mission, law):
        return CheckResult(mission.name, vehicle, (), (), (), (problem,))
    notes: tuple[str, ...] = ()
    if isinstance(mission, ForeignMission):
        empty = () if mission.items else ("nothing that can be flown",)
        notes = tuple(f"note: {line}" for line in (home_text(mission.home), *mission.notes))
        if left_out := (*mission.left_out, *empty):
            return CheckResult(mission.name, vehicle, (), (), notes, left_out)
        if not ends_on_ground(mission):
            notes += ("note: does not end on the ground: for gcs upload, not for gcs fly or gcs sweep",)
    table = with_settings(autopilot_parameters(limits.vehicle), settings)
    shaped = shapes_paths(table, not as_asked)
    found = violations(mission, vehicle, limits, not as_asked, settings)
    reports = [] if found else path_reports(mission, limits, planner, shaped)
    craft = craft_of(vehicle, limits)
    if wind_m_s and not found:
        found = [lack.violation for lack in craft.lacks(wind_m_s, reports)]
    answer = Answer() if found else ask_supervisor(mission, table, not as_asked, planner)
    warnings = (
        *(f"warning: {text}" for text in answer.warnings),
        *slowness_notes(reports),
        *unreached_speed_notes(mission, reports, table),
        *cut_off_notes(mission),
        *margin_warnings(reports, vehicle, limits.vehicle),
        *(f"warning: {text}" for text in vehicle_warnings(vehicle)),
        *timeout_warnings(mission, reports, table),
    )
    if not shaped and any(isinstance(step, LoadPath | AttitudeRun) for step in mission.steps):
        warnings += (
            "note: how near a law without preview keeps to this, and whether its own errors lose the "
            f"flight, only a flight tells: gcs fly {shlex.quote(name_or_path)} --law thesis",
        )
    warnings += (
        *winch_notes(mission, table),
        *notes_after_release(mission, table),
    )
    if planner is not None and (unused := unused_planner_text(mission)):
        warnings += (f"the planner {unused}",)
    result = CheckResult(mission.name, vehicle, tuple(found), tuple(reports), warnings, answer.refusals)
    if not result.problems:
        limit_s = time_limit_s(expected_flight_s(mission, table))
        result = replace(result, expected_s=flown_s(mission, reports, table), time_limit_s=limit_s)
        if wind := craft.limit(reports):
            result = replace(result, wind_limit_m_s=wind.speed_m_s, wind_reason=wind.reason)
        result = _with_charge(result, mission, table)
    return _in_file_terms(result, mission, notes)
