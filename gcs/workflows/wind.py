"""What steady, level wind a vehicle withstands in its simulated world, and what it lacks in more.

Judged are standing on the ground, pulling the cable taut, holding the load, and the paths of a mission, each
at its worst and with the wind from the worst direction. Not judged are gusts, a battery that sags, and how
well a law holds against the wind. A vehicle at rest that leans by theta in wind of speed u is in balance if

    m g sin(theta) = D cos(theta) + T h u cos(theta)     across the rotors' axis
    T = m g cos(theta) + D sin(theta)                    along it

D is the drag of frame, load and cable, T the thrust, and h = k/g + a the drag of the rotors in their plane,
for each newton of thrust and m/s across it (`sitl.plant.air`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import atan, cos, degrees, hypot, pi, radians, sin, tan
from typing import NamedTuple

from autopilot.control.quad_position import MAX_LEAN_TANGENT
from autopilot.supervisor.requests.arming import GROUND_SPEED_M_S
from autopilot.trajectory.feasibility import PathReport, VehicleLimits, Violation, excess_text
from autopilot.vehicle.file import load_truth_and_belief
from gcs.errors import InputError
from gcs.workflows.flight_options import Settings
from missions.model import KINDS, AttitudeRun
from sitl.plant.cable_drag import DRAG_COEFFICIENT
from sitl.plant.records import Truth
from sitl.vehicles.sim_parameters import apply, definitions, sim_parameters
from sitl.vehicles.truth import truth_of

WIND_PARAMETERS = ("SIM_WIND_E", "SIM_WIND_N")
_MAX_LEAN = atan(MAX_LEAN_TANGENT)  # of the law that flies while the cable is slack
_BISECTIONS = 40


class WindLimit(NamedTuple):
    """The greatest wind that the vehicle withstands, and why not more."""

    speed_m_s: float
    reason: str


class Lack(NamedTuple):
    """What a wind asks of the vehicle and what it has, in words and in short."""

    violation: Violation
    reason: str


def split_wind(settings: Settings) -> tuple[float, list[tuple[str, float]]]:
    """The speed (m/s) of the wind among the settings, and the other settings; InputError if it is out of
    range."""
    given, max_wind_m_s = list(settings), _max_wind_m_s()
    wind = dict(one for one in given if one[0] in WIND_PARAMETERS)
    for name, value in wind.items():
        if not abs(value) <= max_wind_m_s:
            raise InputError(f"--set {name} = {value:g} m/s; must be -{max_wind_m_s:g} ... {max_wind_m_s:g}")
    return hypot(0.0, *wind.values()), [one for one in given if one[0] not in WIND_PARAMETERS]


class Craft:
    """A vehicle with its load, as it is in the simulated world, in wind; `limits` are those it is flown
    within."""

    def __init__(self, truth: Truth, limits: VehicleLimits) -> None:
        self._truth = truth
        self._limits = limits
        self._cable = (
            0.5 * truth.air.density * DRAG_COEFFICIENT * truth.air.cable_diameter * truth.cable_length
        )
        self._rotor_drag = truth.air.rotor_drag / truth.gravity + truth.air.rotor_flap

    def limit(self, reports: Sequence[PathReport] = ()) -> WindLimit | None:
        """The greatest wind that the vehicle withstands along these paths; None if it withstands any."""
        low, high = 0.0, _max_wind_m_s()
        first = next(self.lacks(high, reports), None)
        if first is None:
            return None
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            found = next(self.lacks(middle, reports), None)
            low, high, first = (middle, high, first) if found is None else (low, middle, found)
        return WindLimit(low, first.reason)

    def lacks(self, wind_m_s: float, reports: Iterable[PathReport] = ()) -> Iterator[Lack]:
        """What the vehicle lacks in a wind of this speed, in the order of a flight."""
        yield from self._on_ground(wind_m_s)
        yield from self._with_slack_cable(wind_m_s)
        yield from self._with_load(wind_m_s)
        for report in reports:
            yield from self._along(wind_m_s, report)

    def _on_ground(self, wind_m_s: float) -> Iterator[Lack]:
        t = self._truth
        across_m_s = max(wind_m_s - GROUND_SPEED_M_S, 0.0)
        drag_n = self._drag_n(across_m_s, t.load_drag, t.load_drag_quadratic)
        friction_n = t.friction * self._weight_n(t.load_mass)
        if drag_n > friction_n:
            text = (
                f"in wind of {wind_m_s:.1f} m/s vehicle and load are blown along the ground by "
                f"{drag_n:.2f} N; friction holds {friction_n:.2f} N ({excess_text(drag_n, friction_n)}): it "
                "is not armed"
            )
            reason = (
                f"vehicle and load are blown along the ground at more than {GROUND_SPEED_M_S:g} m/s, and "
                "not armed"
            )
            yield _lack(0, "friction", drag_n, friction_n, text, reason)

    def _with_slack_cable(self, wind_m_s: float) -> Iterator[Lack]:
        lean, _ = self._balance(wind_m_s, self._drag_n(wind_m_s), 0.0)
        if lean > _MAX_LEAN:
            angle, bound = degrees(lean), degrees(_MAX_LEAN)
            text = (
                f"in wind of {wind_m_s:.1f} m/s the vehicle leans {angle:.0f} deg to stay in place "
                f"while it pulls the cable taut; the limit is {bound:.0f} deg ({angle - bound:.0f} deg over)"
            )
            reason = f"it would have to lean more than {bound:.0f} deg to pull the cable taut"
            yield _lack(0, "tilt", lean, _MAX_LEAN, text, reason)

    def _with_load(self, wind_m_s: float) -> Iterator[Lack]:
        _, thrust_n = self._carrying(wind_m_s)
        usable_n = self._limits.usable_thrust_n
        if thrust_n > usable_n:
            text = (
                f"in wind of {wind_m_s:.1f} m/s the vehicle needs {thrust_n:.2f} N of thrust to hold "
                f"the load; {self._limits.thrust_text} ({excess_text(thrust_n, usable_n)})"
            )
            yield _lack(0, "thrust", thrust_n, usable_n, text, "its thrust would not hold the load")

    def _along(self, wind_m_s: float, report: PathReport) -> Iterator[Lack]:
        """What is lacking on a path that can be flown in still air; an attitude run may drift."""
        if report.kind == KINDS[AttitudeRun]:
            return
        share = max(effort[0] for effort in self._limits.body.efforts)
        sideways_n = self._weight_n(self._truth.load_mass) * tan(radians(report.tilt_deg))
        (_, still_n), (_, thrust_n) = self._carrying(0.0, sideways_n), self._carrying(wind_m_s, sideways_n)
        # where the load is fastest, it accelerates least
        _, cruise_n = self._carrying(wind_m_s + report.speed_m_s)
        force_n = max(report.rotor_high_n + share * (thrust_n - still_n), share * cruise_n)
        max_n = self._limits.vehicle.rotor_max_n
        if report.rotor_high_n <= max_n < force_n:
            text = (
                f"items[{report.item}] ({report.kind}): in wind of {wind_m_s:.1f} m/s from the worst "
                f"direction one rotor has to give {force_n:.2f} N; it gives {max_n:.2f} N at most "
                f"({excess_text(force_n, max_n)})"
            )
            reason = f"a rotor would be at its limit in items[{report.item}] ({report.kind})"
            yield _lack(report.item, "rotor force", force_n, max_n, text, reason)

    def _drag_n(self, air_m_s: float, linear: float = 0.0, quadratic: float = 0.0) -> float:
        """The drag of the vehicle's frame, and of what has these coefficients."""
        t = self._truth
        return (t.quad_drag + linear + (t.quad_drag_quadratic + quadratic) * air_m_s) * air_m_s

    def _weight_n(self, carried_kg: float) -> float:
        return self._truth.gravity * (self._truth.quad_mass + carried_kg)

    def _carrying(self, air_m_s: float, sideways_n: float = 0.0) -> tuple[float, float]:
        """Lean (rad) and thrust (N) with which the vehicle carries its load in air of this speed, and gives a
        level force beside what holds it there."""
        t = self._truth
        drag_n = self._drag_n(air_m_s, t.load_drag, t.load_drag_quadratic + self._cable)
        return self._balance(air_m_s, drag_n + sideways_n, t.load_mass)

    def _balance(self, air_m_s: float, level_n: float, carried_kg: float) -> tuple[float, float]:
        """Lean (rad) and thrust (N) of the balance above with the level force D = `level_n`."""
        weight_n, low, high = self._weight_n(carried_kg), 0.0, 0.5 * pi
        for _ in range(_BISECTIONS):
            lean = 0.5 * (low + high)
            thrust_n = weight_n * cos(lean) + level_n * sin(lean)
            leans_more = weight_n * tan(lean) < level_n + thrust_n * self._rotor_drag * air_m_s
            low, high = (lean, high) if leans_more else (low, lean)
        return low, weight_n * cos(low) + level_n * sin(low)


def _max_wind_m_s() -> float:
    """The greatest wind that the simulator can be given."""
    limits = definitions().parameters[WIND_PARAMETERS[0]].range
    assert limits is not None
    return limits[1]


def _lack(item: int, quantity: str, value: float, limit: float, text: str, reason: str) -> Lack:
    return Lack(Violation(item, quantity, value, limit, 0.0, text), reason)


def craft_of(vehicle: str, limits: VehicleLimits, settings: Settings = ()) -> Craft:
    """The true vehicle of a vehicle file, in a simulated world with these parameters."""
    truth = truth_of(load_truth_and_belief(vehicle)[0])
    table = sim_parameters(truth)
    for name, value in settings:
        if name in table:
            table.set(name, value)
    return Craft(apply(truth, table), limits)
