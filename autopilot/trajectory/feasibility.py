"""Can the vehicle fly it? Answered before take-off, for every step of a mission.

What is checked: the cable stays taut; the total thrust (with a reserve), each single rotor and the tilt of
the vehicle stay within their limits; the load is carried high enough and stays above the ground; a path has
no jump in position or velocity. The drag of the vehicle is included. What is not checked: at the joints of
half-sine envelopes the acceleration jumps, and following a jump exactly would require an unbounded moment for
an instant; both sides of a joint are checked, the jump itself is not. An autopilot that shapes its paths
smooths the jump (`autopilot.trajectory.shaping`), others have an error there that does no harm. Wind
(`gcs.workflows.wind` judges it), delays and noise are not part of the check either: a mission that passes can
be flown in principle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import degrees, inf, nextafter, radians

import numpy as np
from numpy import linspace

from autopilot.geometry.linear import Vec3, norm, sub
from autopilot.trajectory.peaks import (
    Body,
    Extreme,
    Peaks,
    survey_attitude,
    survey_load_path,
    survey_path,
    survey_transfer,
)
from autopilot.trajectory.prepare import REFUSE, PathLimits, min_transfer_s, prepare, shaped_path
from autopilot.trajectory.rotor_demand import bounds_along_paths
from autopilot.trajectory.route import PlanError, Planner
from autopilot.trajectory.shaping import ShapedSignals, path_jets
from autopilot.trajectory.signals import evaluate, joints, signal_table
from autopilot.trajectory.splines import Array
from autopilot.trajectory.timeline import MissionState, TimelineEntry, timeline
from autopilot.trajectory.transfer import Pace
from autopilot.trajectory.waypoint_path import PathSegment, sample_path
from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.rotors import ROTOR_MARGIN, allocation_columns
from missions.model import (
    KINDS,
    AttitudeRun,
    Land,
    LoadPath,
    Mission,
    Signals,
    Step,
    Takeoff,
    Term,
    Trajectory,
    Waypoint,
    Winch,
)

__all__ = ["PathReport", "Peaks", "VehicleLimits", "Violation", "check", "paths", "peaks"]

MIN_TENSION_SHARE = 0.3  # this and the next: the defaults of MIS_TENSION and MIS_SHAPE_ERR
MAX_SHAPING_M = 0.05
MIN_HEIGHT_M = 0.3  # above home, at which a load must be carried
_REPORT_SAMPLES = 4001
_TOLD_BESIDE_M = 0.3  # beside the straight line between two waypoints: paths that go further say so
# Jumps of the path below these (m, m/s) are smaller than the error of any flight.
_JUMP_M = 1e-3
_JUMP_M_S = 1e-2
# A path is too fast for its cable if this share of the length needs less than this share of the force.
_SHORTER_CABLE, _SMALLER_FORCE = 0.25, 0.5
_GREAT_DRAG_SHARE = 0.5  # of the weight: greater drag of the vehicle is worth a check
# How far below the ground (m) a path may dip by rounding.
_GROUND_M = 1e-6
_MULTIPLE_FROM = 3.0  # from here on an excess is reported as a multiple
LOAD_PATH_KINDS = (KINDS[Signals], KINDS[Trajectory])
_NUMBERS = {4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight"}


@dataclass(frozen=True, slots=True)
class VehicleLimits:
    """The vehicle that is to fly, and the limits within which it flies.

    `thrust_reserve` is the share of the total thrust kept free for control. For shaped paths, `rotor_margin`
    is the share of each rotor's range kept free at either limit, `min_tension_share` the least cable tension
    as a share of the load's weight, `max_shaping_m` the greatest distance from the requested path.
    `speed_m_s` (until the mission sets its own) and `accel_m_s2` are the peaks of transfers;
    `when_infeasible` says what happens to a path that is impossible; `time_optimal`: paths through waypoints
    have no other limits than the vehicle.
    """

    vehicle: Vehicle
    thrust_reserve: float = 0.1
    tilt_max_rad: float = radians(45.0)
    speed_m_s: float = 1.5
    accel_m_s2: float = 1.5
    min_tension_share: float = MIN_TENSION_SHARE
    max_shaping_m: float = MAX_SHAPING_M
    rotor_margin: float = ROTOR_MARGIN
    when_infeasible: int = REFUSE
    time_optimal: bool = False

    @property
    def body(self) -> Body:
        """The properties of the vehicle that the survey needs."""
        vehicle = self.vehicle
        return Body(
            vehicle.quad_mass_kg,
            vehicle.load_mass_kg,
            vehicle.cable_length_m,
            vehicle.inertia_kg_m2,
            vehicle.gravity_m_s2,
            vehicle.arm_m,
            vehicle.torque_ratio_m,
            vehicle.quad_drag_n_s_m,
            vehicle.quad_drag_quadratic_n_s2_m2,
            allocation_columns(vehicle.layout),
        )

    @property
    def usable_thrust_n(self) -> float:
        """The total thrust (N) without the reserve."""
        return self.vehicle.greatest_thrust_n * (1.0 - self.thrust_reserve)

    @property
    def thrust_text(self) -> str:
        """The thrust that the rotors give, in words."""
        rotors, full, usable = len(self.vehicle.layout), self.vehicle.greatest_thrust_n, self.usable_thrust_n
        reserve = f", {usable:.2f} N with the reserve of {100.0 * self.thrust_reserve:.0f} %"
        return (
            f"{_NUMBERS.get(rotors, str(rotors))} rotors give {full:.2f} N{reserve if usable < full else ''}"
        )

    @property
    def shaping(self) -> PathLimits:
        """The limits to which the autopilot shapes paths: its MIS_ parameters, by default as delivered."""
        vehicle = self.vehicle
        bounds = bounds_along_paths(
            self.body,
            (vehicle.rotor_min_n, vehicle.rotor_max_n) if vehicle.limited else None,
            self.rotor_margin,
            self.min_tension_share,
            self.tilt_max_rad,
            # by way of the milliseconds of VEH_ROTOR_TAU: the same limits to the last bit give the same paths
            1e-3 * (1e3 * vehicle.rotor_tau_s),
        )
        return PathLimits(
            self.body,
            bounds,
            True,
            self.max_shaping_m,
            self.when_infeasible,
            self.speed_m_s,
            self.accel_m_s2,
            self.time_optimal,
        )


@dataclass(frozen=True, slots=True)
class PathReport:
    """How a step is flown: shaped signals, a path through waypoints, a transfer from rest to rest, an
    attitude run.

    `distance_m` is the greatest distance between the flown and the requested path; forces are in N;
    `tilt_deg` is that of the vehicle; `speed_m_s` is the greatest speed of the load (0 in an attitude run,
    which gives none). Of paths through waypoints, `beside_m` is the greatest distance from the straight line
    between two of them, and `asked_m_s` the speed asked for if the path is much slower, else 0. `lead_s` is
    the time from the beginning of the item to that of the requested signals or trajectory.
    """

    item: int
    kind: str
    duration_s: float
    distance_m: float
    rotor_low_n: float
    rotor_high_n: float
    tension_low_n: float
    tilt_deg: float
    slowed: float = 1.0  # times as long as requested
    speed_m_s: float = 0.0
    beside_m: float = 0.0
    asked_m_s: float = 0.0
    lead_s: float = 0.0

    def __str__(self) -> str:
        return self.text()

    def merged(self, other: PathReport) -> PathReport:
        """The worst of two times that the same item is flown."""
        return replace(
            self,
            duration_s=max(self.duration_s, other.duration_s),
            distance_m=max(self.distance_m, other.distance_m),
            slowed=max(self.slowed, other.slowed),
            beside_m=max(self.beside_m, other.beside_m),
            speed_m_s=max(self.speed_m_s, other.speed_m_s),
            rotor_low_n=min(self.rotor_low_n, other.rotor_low_n),
            rotor_high_n=max(self.rotor_high_n, other.rotor_high_n),
            tension_low_n=min(self.tension_low_n, other.tension_low_n),
            tilt_deg=max(self.tilt_deg, other.tilt_deg),
            lead_s=max(self.lead_s, other.lead_s),
        )

    def text(self, times: int = 1) -> str:
        """The report as a line; `times`: how often the item is flown, at worst like this."""
        near = ""
        if self.kind in LOAD_PATH_KINDS and self.distance_m == 0.0:
            near = ", as asked"
        elif self.kind in LOAD_PATH_KINDS:
            near = f", at most {1e3 * self.distance_m:.1f} mm from the path asked"
        if self.slowed != 1.0:
            near = f", {self.slowed:.2f} times as long as asked{near.removesuffix(' asked')}"
        if self.beside_m > _TOLD_BESIDE_M:
            near = f", up to {self.beside_m:.1f} m beside the straight line"
        if self.lead_s:
            near = f" with {self.lead_s:.2f} s before it begins{near}"
        speed = f"load to {self.speed_m_s:.2f} m/s, " if self.speed_m_s else ""
        return (
            f"items[{self.item}] ({self.kind}): {f'{times} times, up to ' if times > 1 else ''}"
            f"{self.duration_s:.1f} s{near}; {speed}"
            f"rotors {self.rotor_low_n:.2f} ... {self.rotor_high_n:.2f} N, "
            f"tension from {self.tension_low_n:.2f} N, tilt to {self.tilt_deg:.0f} deg"
        )


@dataclass(frozen=True, slots=True)
class Violation:
    """A limit that a step breaks, at the worst place: `value` instead of `limit`, `time_s` into the step."""

    item: int
    quantity: str
    value: float
    limit: float
    time_s: float
    text: str

    def __str__(self) -> str:
        return self.text


def check(mission: Mission, limits: VehicleLimits, shaped: bool = False) -> list[Violation]:
    """All limits of the vehicle that the mission breaks, step by step; empty if it can be flown.

    `shaped`: an autopilot that shapes its paths flies it: signals pass if a path near them is possible, and
    transfers take longer where rotors, cable or tilt require it. Paths through waypoints do so in any case.
    """
    found: list[Violation] = _hover_violations(limits)
    if found:
        return found
    flown_through = frozenset() if shaped else _flown_through(mission, limits)
    for entry in _timeline(mission, limits):
        carries_load = isinstance(entry.step, Takeoff | Waypoint) and not entry.before.released
        if carries_load and entry.end[2] < MIN_HEIGHT_M:
            text = (
                f"{_item_label(entry)}: the load would be carried {entry.end[2]:.2f} m above "
                f"the ground; it must be at least {MIN_HEIGHT_M:g} m: raise altitude_m"
            )
            found.append(Violation(entry.item, "height", entry.end[2], MIN_HEIGHT_M, entry.transfer_s, text))
        if isinstance(entry.step, LoadPath):
            jumps = list(_jumps(entry.item, entry.step)) if isinstance(entry.step, Signals) else []
            found += jumps
            if shaped and not jumps:
                extremes = _survey(entry, limits)
                assert extremes is not None
                problem = shaped_path(entry.step, limits.shaping).problem
                path_violations = list(_violations_along(entry, extremes, limits))
                if not problem:
                    found += [v for v in path_violations if v.quantity == "height"]
                elif path_violations:
                    found += path_violations
                else:
                    drag_advice = _drag_advice(entry, extremes, limits)
                    text = f"{_item_label(entry)}: {problem}; {_bounds_text(entry.step, limits, drag_advice)}"
                    found.append(Violation(entry.item, "shaping", inf, limits.max_shaping_m, 0.0, text))
                continue
        extremes = _survey(entry, limits, shaped or entry.item in flown_through)
        if extremes is not None:
            found += _violations_along(entry, extremes, limits)
    return found


def _flown_through(mission: Mission, limits: VehicleLimits) -> frozenset[int]:
    """The items along a path through waypoints, which takes as long as the limits require with every law."""
    shaping = limits.shaping._replace(shape_paths=False)
    prepared = prepare(mission.steps, range(len(mission.steps)), shaping, loop_ends=mission.loop_ends)
    return frozenset(item for item, path in enumerate(prepared.paths) if isinstance(path, PathSegment))


def _bounds_text(step: LoadPath, limits: VehicleLimits, drag_advice: str) -> str:
    """The bounds of a shaped path in words, and what to change if it cannot keep them."""
    advice = "lower amplitude_m, lengthen rise_s or period_s"
    if isinstance(step, Trajectory):
        advice = "give its points later times"
    reserve = f"{100.0 * limits.rotor_margin:.0f} % of the rotors' range free at either limit"
    return (
        f"a path must leave {reserve} (MIS_ROTOR_MARG), the cable taut and the tilt below "
        f"{degrees(limits.tilt_max_rad):.0f} deg; {drag_advice}{advice}, or let it be flown slower "
        "(MIS_INFEASIBLE 1)"
    )


def _hover_violations(limits: VehicleLimits) -> list[Violation]:
    """The violation of a vehicle that cannot even hover with its load; empty if it can."""
    vehicle = limits.vehicle
    weight = (vehicle.quad_mass_kg + vehicle.load_mass_kg) * vehicle.gravity_m_s2
    if weight <= limits.usable_thrust_n:
        return _balance_violations(limits)
    too_heavy = vehicle.quad_mass_kg * vehicle.gravity_m_s2 >= limits.usable_thrust_n
    text = (
        f"vehicle ({vehicle.quad_mass_kg:g} kg) and load ({vehicle.load_mass_kg:g} kg) weigh {weight:.2f} N; "
        f"{limits.thrust_text} ({excess_text(weight, limits.usable_thrust_n)}): it cannot hover; "
        f"lower {'quad_mass_kg' if too_heavy else 'load_mass_kg'}, or raise rotor_max_n"
    )
    return [Violation(0, "thrust", weight, limits.usable_thrust_n, 0.0, text)]


def _balance_violations(limits: VehicleLimits) -> list[Violation]:
    """The violation of a vehicle whose rotors cannot hold it level, because the cable is attached too far
    from the centre of mass or because of their own limits; empty if they can."""
    vehicle = limits.vehicle
    forward, left, _ = vehicle.attachment_m
    load_n = vehicle.load_mass_kg * vehicle.gravity_m_s2
    total_n = load_n + vehicle.quad_mass_kg * vehicle.gravity_m_s2
    arm_m = vehicle.arm_m
    demand = np.array([total_n, load_n * left / arm_m, -load_n * forward / arm_m, 0.0])
    efforts = np.array(limits.body.efforts)
    forces_n = efforts @ demand

    def are_within_limits(forces_n: Array) -> bool:
        return bool(vehicle.rotor_min_n <= forces_n.min() and forces_n.max() <= vehicle.rotor_max_n)

    if not vehicle.limited or are_within_limits(forces_n):
        return []
    is_low = forces_n.min() < vehicle.rotor_min_n
    value, limit = (forces_n.min(), vehicle.rotor_min_n) if is_low else (forces_n.max(), vehicle.rotor_max_n)
    bound = "least" if is_low else "most"
    text = f"to hover, one rotor must give {value:.2f} N and gives {limit:.2f} N at {bound}"
    if are_within_limits(efforts @ [total_n, 0.0, 0.0, 0.0]):
        beside_m = np.hypot(forward, left)
        text = f"the cable is attached {beside_m:.2f} m beside the centre of mass: {text}; lower attachment_m"
    else:
        text += "; lower rotor_min_n" if is_low else "; raise rotor_max_n"
    return [Violation(0, "rotor force", float(value), limit, 0.0, text)]


def paths(
    mission: Mission, limits: VehicleLimits, planner: Planner | None = None, shaped: bool = True
) -> list[PathReport]:
    """How each step that carries the load along a path, or tracks an attitude, is flown.

    Steps after the release of the load are left out. `planner` is a custom planner of paths through
    waypoints; PlanError if its path is refused. Without `shaped`, signals are flown as requested.
    """
    shaping = limits.shaping._replace(shape_paths=shaped)
    items, ends = range(len(mission.steps)), mission.loop_ends
    prepared = prepare(mission.steps, items, shaping, planner=planner, loop_ends=ends)
    if planner is not None and prepared.refusal:
        raise PlanError(prepared.refusal)
    reports = []
    for entry in _timeline(mission, limits):
        path, distance, beside, extremes = prepared.paths[entry.item], 0.0, 0.0, None
        slowed = path.duration_factor if isinstance(path, ShapedSignals) else 1.0
        if entry.before.released or isinstance(entry.step, Winch | Land):
            continue
        if isinstance(path, ShapedSignals):
            distance = path.distance_m
            times = linspace(-path.lead_s, path.duration_s + path.tail_s, _REPORT_SAMPLES)
            extremes = survey_path(times, path_jets(path, times), 0.0, shaping.body)
            duration_s = float(times[-1] - times[0])
        elif isinstance(path, PathSegment):
            times = linspace(path.begin_s, path.end_s, _REPORT_SAMPLES)
            jets = sample_path(path.table, times)
            extremes = survey_path(times, jets, 0.0, shaping.body)
            beside = _distance_from_line(jets[0], entry.begin, entry.end)
            duration_s = float(times[-1] - times[0])
        else:
            extremes = _survey(entry, limits, shaped)
            is_run = isinstance(entry.step, AttitudeRun)
            duration_s = entry.duration_s if is_run else _transfer(entry, limits, shaped).duration_s
        if extremes is not None:
            report = _path_report(entry, duration_s, distance, extremes, slowed)
            asked = (s.asked_m_s for s in prepared.slow_paths if s.first <= entry.item <= s.last)
            lead_s = path.lead_s if isinstance(path, ShapedSignals) else 0.0
            reports.append(replace(report, beside_m=beside, asked_m_s=next(asked, 0.0), lead_s=lead_s))
    return reports


def _distance_from_line(places: Array, begin: Vec3, end: Vec3) -> float:
    """The greatest distance (m) of places (n, 3) from the straight line between two points."""
    line, offsets = np.subtract(end, begin), places - np.array(begin)
    share = np.clip(offsets @ line / (line @ line), 0.0, 1.0)
    return float(np.linalg.norm(offsets - share[:, None] * line, axis=1).max())


def _path_report(
    entry: TimelineEntry, duration_s: float, distance_m: float, extremes: Peaks, slowed: float
) -> PathReport:
    return PathReport(
        entry.item,
        KINDS[type(entry.step)],
        duration_s,
        distance_m,
        extremes.rotor_low.value,
        extremes.rotor_high.value,
        extremes.tension_low.value,
        degrees(extremes.tilt.value),
        slowed,
        0.0 if isinstance(entry.step, AttitudeRun) else extremes.speed.value,
    )


def peaks(mission: Mission, limits: VehicleLimits) -> dict[int, Peaks]:
    """The extremes along each step that moves the load, by item number."""
    surveys = {entry.item: _survey(entry, limits) for entry in _timeline(mission, limits)}
    return {item: extremes for item, extremes in surveys.items() if extremes is not None}


def _timeline(mission: Mission, limits: VehicleLimits) -> Iterator[TimelineEntry]:
    usual_m_s = limits.speed_m_s
    start = MissionState(
        cable_m=limits.vehicle.cable_length_m, speed_m_s=usual_m_s, usual_speed_m_s=usual_m_s
    )
    gravity_m_s2 = limits.vehicle.gravity_m_s2
    return timeline(mission.steps, start, accel_m_s2=limits.accel_m_s2, gravity_m_s2=gravity_m_s2)


def _transfer(entry: TimelineEntry, limits: VehicleLimits, shaped: bool) -> Pace:
    """The transfer of a step as it is flown."""
    return entry.transfer.stretched(min_transfer_s(entry, limits.shaping)) if shaped else entry.transfer


def _survey(entry: TimelineEntry, limits: VehicleLimits, shaped: bool = False) -> Peaks | None:
    if isinstance(entry.step, LoadPath):
        return survey_load_path(entry.step, entry.begin, limits.body)
    if isinstance(entry.step, AttitudeRun):
        return survey_attitude(entry.step, entry.begin[2], limits.body)
    if entry.transfer_s > 0.0:
        return survey_transfer(entry.begin, entry.end, _transfer(entry, limits, shaped), limits.body)
    return None


def _violations_along(entry: TimelineEntry, extremes: Peaks, limits: VehicleLimits) -> Iterator[Violation]:
    cause_advice = _drag_advice(entry, extremes, limits) or _length_advice(entry, extremes, limits)

    def violation(quantity: str, worst: Extreme, limit: float, finding: str, advice: str = "") -> Violation:
        advice = advice or f"{cause_advice}{_advice(entry, worst.time_s)}"
        text = f"{_item_label(entry)}: at {worst.time_s:.1f} s {finding}; {advice}"
        return Violation(entry.item, quantity, worst.value, limit, worst.time_s, text)

    fall, thrust, low, high, tilt = (
        extremes.fall,
        extremes.thrust,
        extremes.rotor_low,
        extremes.rotor_high,
        extremes.tilt,
    )
    vehicle = limits.vehicle
    gravity, usable = vehicle.gravity_m_s2, limits.usable_thrust_n
    # a step that begins too low was already reported with the step that led there
    lowest_m = extremes.height_low.value
    least_m = MIN_HEIGHT_M if isinstance(entry.step, LoadPath) else 0.0
    if lowest_m < min(entry.begin[2], least_m) - _GROUND_M:
        place = "above" if lowest_m >= 0.0 else "under"
        finding = f"the load would be {abs(lowest_m):.2f} m {place} the ground"
        if least_m:
            finding += f"; it must be at least {least_m:g} m above"
        advice = f"begin higher (altitude_m) or {_height_advice(entry.step)}"
        yield violation("height", extremes.height_low, least_m, finding, advice)
    if fall.value >= gravity:
        # beyond this the cable would have to push: thrust and tilt then have no meaning
        finding = (
            f"the load would have to fall at {fall.value:.1f} m/s^2 with the cable taut; gravity gives "
            f"{gravity:.2f} m/s^2 ({excess_text(fall.value, gravity)})"
        )
        yield violation("tension", fall, gravity, finding)
        return
    if thrust.value > usable:
        finding = (
            f"the flight needs {thrust.value:.2f} N of thrust; {limits.thrust_text} "
            f"({excess_text(thrust.value, usable)})"
        )
        yield violation("thrust", thrust, usable, finding)
    if high.value > vehicle.rotor_max_n:
        finding = (
            f"one rotor has to give {high.value:.2f} N; it gives {vehicle.rotor_max_n:.2f} N at most "
            f"({excess_text(high.value, vehicle.rotor_max_n)})"
        )
        yield violation("rotor force", high, vehicle.rotor_max_n, finding)
    if low.value < vehicle.rotor_min_n:
        finding = (
            f"one rotor has to give {low.value:.2f} N; it gives {vehicle.rotor_min_n:.2f} N at least "
            f"({vehicle.rotor_min_n - low.value:.2f} N under)"
        )
        yield violation("rotor force", low, vehicle.rotor_min_n, finding)
    if tilt.value > limits.tilt_max_rad:
        angle, bound = degrees(tilt.value), degrees(limits.tilt_max_rad)
        finding = (
            f"the vehicle leans {angle:.0f} deg; the limit is {bound:.0f} deg ({angle - bound:.0f} deg over)"
        )
        yield violation("tilt", tilt, limits.tilt_max_rad, finding)


def _height_advice(step: Step) -> str:
    """What to change in a step that leads too low, besides the height at which it begins."""
    if isinstance(step, Trajectory):
        return "raise its points"
    return f"lower {'length_m' if isinstance(step, Winch) else 'amplitude_m of z'}"


def _drag_advice(entry: TimelineEntry, extremes: Peaks, limits: VehicleLimits) -> str:
    """The advice to check the drag of the vehicle if only this makes the step impossible, and is great beside
    the weight. Else an empty string."""
    body, speed_m_s = limits.body, extremes.speed.value
    linear_n, quadratic_n = body.drag_linear * speed_m_s, body.drag_quadratic * speed_m_s**2
    weight_n = (body.quad_mass + body.load_mass) * body.gravity
    if linear_n + quadratic_n < _GREAT_DRAG_SHARE * weight_n:
        return ""
    without_drag = replace(
        limits,
        vehicle=limits.vehicle.model_copy(
            update={"quad_drag_n_s_m": 0.0, "quad_drag_quadratic_n_s2_m2": 0.0}
        ),
    )
    still = _survey(entry, without_drag)
    if still is None or any(_violations_along(entry, still, without_drag)):
        return ""
    key = "quad_drag_n_s_m" if linear_n > quadratic_n else "quad_drag_quadratic_n_s2_m2"
    return (
        f"check {key}: the drag is {linear_n + quadratic_n:.2f} N at {speed_m_s:.2f} m/s, the weight "
        f"{weight_n:.2f} N; or "
    )


def _length_advice(entry: TimelineEntry, extremes: Peaks, limits: VehicleLimits) -> str:
    """The advice to shorten the cable if the forces are a multiple of the limits because of its length: the
    vehicle has to swing about the load. Else an empty string."""
    worst = extremes.rotor_high.value
    if not (isinstance(entry.step, LoadPath) and worst > _MULTIPLE_FROM * limits.vehicle.rotor_max_n):
        return ""
    # the load alone accelerates faster than the vehicle can, on any cable
    if extremes.accel.value * (limits.body.quad_mass + limits.body.load_mass) > limits.usable_thrust_n:
        return ""
    length_m = limits.body.cable_length
    shorter = limits.body._replace(cable_length=_SHORTER_CABLE * length_m)
    if survey_load_path(entry.step, entry.begin, shorter).rotor_high.value > _SMALLER_FORCE * worst:
        return ""
    return f"shorten cable_length_m, {length_m:g} m, on which the load swings too slowly for this path; or "


def _jumps(item: int, step: Signals) -> Iterator[Violation]:
    """Jumps of position or velocity at the joints, and motion left over at the end of the duration."""
    table = signal_table(step.terms)
    for time in joints(step.terms):
        if time >= step.duration_s:
            continue
        before, after = evaluate(table, nextafter(time, -inf)), evaluate(table, time)
        for order, bound, unit in ((0, _JUMP_M, "m"), (1, _JUMP_M_S, "m/s")):
            jump = norm(sub(after[order], before[order]))
            if jump > bound:
                what = ("position", "velocity")[order]
                text = (
                    f"items[{item}] (signals): at {time:.1f} s the {what} jumps by {jump:.2f} {unit}; "
                    "it must be continuous: lengthen rise_s and fall_s"
                )
                yield Violation(item, f"{what} jump", jump, bound, time, text)
    end = step.duration_s
    speed = norm(evaluate(table, nextafter(end, -inf))[1])
    if speed > _JUMP_M_S:
        rest = max((_end_s(term) for term in step.terms), default=inf)
        advice = f"duration_s to {rest:g}" if end < rest < inf else "the signals so that all come to rest"
        text = (
            f"items[{item}] (signals): at {end:.1f} s, its end, the load still moves at {speed:.2f} m/s; "
            f"it must be at rest: change {advice}"
        )
        yield Violation(item, "velocity at the end", speed, _JUMP_M_S, end, text)


def _end_s(term: Term) -> float:
    """Time (s) at which a term has come to rest; inf for one that swings for ever."""
    if term.hold_s is None:
        return inf if term.factors else term.start_s + term.rise_s
    return term.start_s + term.rise_s + term.hold_s + term.fall_s


def _item_label(entry: TimelineEntry) -> str:
    return f"items[{entry.item}] ({KINDS[type(entry.step)]})"


def excess_text(value: float, limit: float) -> str:
    """By how much a value is greater than its limit, in words."""
    if limit <= 0.0:
        return f"{value - limit:.2f} over"
    times = value / limit
    return (
        f"{100.0 * (times - 1.0):.0f} % over"
        if times < _MULTIPLE_FROM
        else f"{float(f'{times:.2g}'):g} times the limit"
    )


def _advice(entry: TimelineEntry, time: float) -> str:
    """What to change: for signals the axis that accelerates most at that time."""
    step = entry.step
    if isinstance(step, AttitudeRun):
        return "lower the tilt or lengthen duration_s"
    if isinstance(step, Takeoff | Land):
        return "lower load_mass_kg or raise rotor_max_n, or lower MIS_ACCEL in [parameters] of the vehicle"
    if isinstance(step, Trajectory):
        return "give its points later times"
    if not isinstance(step, Signals):
        return "lower speed_m_s or the acceleration of transfers"
    accel = evaluate(signal_table(step.terms), time)[2]
    axis = "xyz"[max(range(3), key=lambda i: abs(accel[i]))]
    waves = any(term.axis == axis and term.factors for term in step.terms)
    return f"lower amplitude_m of {axis} or lengthen its {'period_s' if waves else 'rise_s'}"
