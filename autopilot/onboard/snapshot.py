"""The flight core's state as the services' snapshot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import inf, nan, sqrt
from operator import itemgetter
from typing import Any, get_type_hints

from autopilot.control.load_motion import Drag
from autopilot.core.flight_core import FlightCore
from autopilot.core.health import BatteryConstants, Condition, remaining, sensors, vibration, voltage
from autopilot.core.tick import Pilot, Seen
from autopilot.estimation.records import TRACKER, EstimatorState
from autopilot.geometry.linear import ZERO, Vec3, norm, scale, sub
from autopilot.geometry.packed import Row, width
from autopilot.geometry.so3 import quat_from_rotation
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION, Run, asked_jet
from autopilot.services import identity, snapshot
from autopilot.services.mission_store import StoredMission
from autopilot.services.snapshot import GpsFix, Snapshot
from autopilot.supervisor.requests.arming import arming_complaints
from autopilot.supervisor.state import (
    CARRYING,
    IN_AIR,
    ON_GROUND,
    Flight,
    Guide,
    Phase,
    Selected,
    View,
    leg_time_s,
)
from autopilot.wire.convert import HilGps, Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_table import ParameterTable

FRESH_S = 0.5  # a tracker is healthy while its last reading is no older
_NO_COUNT = 255  # satellites of a fix that no receiver gave

_PHASE_MODES = {
    Phase.TAUTEN: identity.AUTO_TAKEOFF,
    Phase.LIFT: identity.AUTO_TAKEOFF,
    Phase.HOLD: identity.AUTO_LOITER,
    Phase.MISSION: identity.AUTO_MISSION,
    Phase.RETURN: identity.AUTO_RTL,
    Phase.LOWER: identity.AUTO_LAND,
    Phase.SET_DOWN: identity.AUTO_LAND,
    Phase.FAILSAFE: identity.AUTO_LAND,
    Phase.GUIDED: identity.AUTO_LOITER,
}
_SELECTED_MODES = {
    Selected.NOTHING: identity.AUTO_LOITER,
    Selected.TAKEOFF: identity.AUTO_TAKEOFF,
    Selected.MISSION: identity.AUTO_MISSION,
    Selected.OFFBOARD: identity.AUTO_LOITER,
}
_GUIDE_MODES = {Guide.OFFBOARD: identity.OFFBOARD, Guide.MANUAL: identity.POSCTL}
_LANDED_STATES = {
    Phase.DISARMED: mavlink.MAV_LANDED_STATE_ON_GROUND,
    Phase.ARMED: mavlink.MAV_LANDED_STATE_ON_GROUND,
    Phase.TAUTEN: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Phase.LIFT: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Phase.LOWER: mavlink.MAV_LANDED_STATE_LANDING,
    Phase.SET_DOWN: mavlink.MAV_LANDED_STATE_LANDING,
}
_ALWAYS = snapshot.MOTORS | snapshot.AHRS | snapshot.BATTERY
_BY_TRACKER = snapshot.GPS | snapshot.MAG | snapshot.BARO
_ESTIMATING = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_HORIZ_REL
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_POS_VERT_ABS
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
)


@dataclass(frozen=True)
class Options:
    """What the command line decides for the whole run."""

    home: Home
    boot_unix_us: int
    lockstep: bool = True
    clock_waits: bool = True  # for the autopilot, however long it works
    log: bool = False  # flights are logged, and the shell stores what `Onboard.take_log` gives


def sub_mode(flight: Flight) -> int:
    """Sub-mode of AUTO: what was asked for, of which the phase is a part."""
    if flight.mission.active:
        return identity.AUTO_MISSION
    if flight.phase in ON_GROUND:
        return _SELECTED_MODES[flight.selected]
    return _PHASE_MODES[flight.phase]


def mode_of(flight: Flight) -> tuple[int, int]:
    """PX4's pair of what was asked for."""
    rising = flight.phase in ON_GROUND or flight.phase in (Phase.TAUTEN, Phase.LIFT)
    if flight.selected == Selected.OFFBOARD and rising:
        return identity.OFFBOARD, 0
    if flight.phase == Phase.GUIDED and flight.setpoints.guide in _GUIDE_MODES:
        return _GUIDE_MODES[flight.setpoints.guide], 0
    return identity.AUTO, sub_mode(flight)


def system_status(flight: Flight, ready: bool) -> int:
    """MAV_STATE of the flight."""
    if flight.phase == Phase.FAILSAFE:
        return mavlink.MAV_STATE_EMERGENCY
    if flight.phase == Phase.DISARMED:
        return mavlink.MAV_STATE_STANDBY if ready else mavlink.MAV_STATE_CALIBRATING
    return mavlink.MAV_STATE_ACTIVE


def mission_state(flight: Flight, items: int) -> int:
    """MISSION_STATE of the flight."""
    if items == 0:
        return mavlink.MISSION_STATE_NO_MISSION
    if flight.mission.active:
        return mavlink.MISSION_STATE_ACTIVE
    if flight.mission.done:
        return mavlink.MISSION_STATE_COMPLETE
    if flight.phase not in ON_GROUND and (flight.mission.step > 0 or flight.mission.step_anchor is not None):
        return mavlink.MISSION_STATE_PAUSED
    return mavlink.MISSION_STATE_NOT_STARTED


def tracked(estimator: EstimatorState) -> bool:
    """Whether a tracker tells where the vehicle is, and of late."""
    vehicle, load = estimator.vehicle, estimator.load
    return vehicle.source == TRACKER and vehicle.age_s < FRESH_S and load.age_s < FRESH_S


def sensor_bits(
    condition: Condition, estimator: EstimatorState, ready: bool, fake_gps: bool, now_us: int
) -> tuple[int, int]:
    """Sensors present and healthy, as bits of SYS_STATUS; a tracker stands in for what it makes needless."""
    present, healthy = (bits | _ALWAYS for bits in sensors(condition, now_us))
    if estimator.vehicle.source == TRACKER:
        by_tracker = snapshot.TRACKER | (_BY_TRACKER & ~present if fake_gps else 0)
        present |= by_tracker
        if tracked(estimator):
            healthy |= by_tracker
    if ready:
        healthy |= snapshot.PREARM
    return present, healthy


def wind(push: Vec3, drag: Drag) -> Vec3:
    """The wind (m/s) whose drag on a resting vehicle is the push (N) that is felt; NaN if there is none."""
    force = norm(push)
    if force == 0.0:
        return push
    # force = (linear + quadratic speed) speed
    root = sqrt(drag.linear * drag.linear + 4.0 * drag.quadratic * force)
    slope = 0.5 * (drag.linear + root)
    return scale(1.0 / slope, push) if slope > 0.0 else (nan, nan, nan)


class Moments:
    """Makes the snapshots of one flight core; remembers what follows from a flight record while it lasts."""

    def __init__(self, core: FlightCore, options: Options, parameters: ParameterTable) -> None:
        self.core = core
        self.options = options
        self.parameters = parameters
        self._flight: Flight | None = None
        self._items = 0
        self._told: tuple[Any, ...] = ()

    def told(self, flight: Flight, items: int) -> tuple[Any, ...]:
        """The fields of `_flight`, of a flight record with a mission of so many items."""
        if flight is not self._flight or items != self._items:
            self._flight, self._items = flight, items
            area, sequence = flight.area, flight.mission.plan.sequence
            seq = sequence[min(flight.mission.step, len(sequence) - 1)] if sequence else 0
            self._told = (
                *(area.home, area.breach, area.breaches, area.breach_us),
                *(flight.phase not in (Phase.DISARMED, Phase.FAILSAFE), int(flight.phase), *mode_of(flight)),
                _LANDED_STATES.get(flight.phase, mavlink.MAV_LANDED_STATE_IN_AIR),
                *(seq, seq, items, mission_state(flight, items), flight.cable.reel_rate),
            )
        return self._told


class Moment(Snapshot):
    """The instant at which the flight core stands; to be read before anything changes there.

    Its fields are made when they are first read, each with those of its part below: at most instants few of
    them are sent.
    """

    def __init__(
        self,
        moments: Moments,
        mission: StoredMission,
        condition: Condition,
        battery: BatteryConstants,
        receiver: HilGps | None,
        now_us: int,
    ) -> None:
        self.now_us = now_us
        self.boot_unix_us = moments.options.boot_unix_us
        self.home = moments.options.home
        self.moments = moments
        self.core = moments.core
        self.flight = moments.core.flight
        self.items = len(mission.items)
        self.condition = condition
        self.battery = battery
        self.receiver = receiver

    accel_quad: Vec3  # inertial acceleration, ENU: for the flight log

    @cached_property
    def estimator(self) -> EstimatorState:
        """The estimate."""
        return self.core.estimator

    @cached_property
    def view(self) -> View:
        """What the supervisor sees."""
        return self.core.view(self.now_us)

    @cached_property
    def ready(self) -> bool:
        """Whether the vehicle may be armed."""
        return not arming_complaints(self.flight, self.view, self.core.settings)

    @property
    def fake_gps(self) -> bool:
        """Whether the tracker is shown as a receiver where there is none."""
        return self.moments.parameters["MAV_FAKE_GPS"] == 1.0


Part = Callable[[Moment], tuple[Any, ...]]


class _Field:
    """A field of a `Moment` that is not made yet: it is with those beside it in its part."""

    def __init__(self, part: Part, names: tuple[str, ...], name: str) -> None:
        self._part, self._names, self._name = part, names, name

    def __get__(self, moment: Moment, owner: Any) -> Any:
        made = moment.__dict__
        made.update(zip(self._names, self._part(moment), strict=True))
        return made[self._name]


def _makes(*names: str) -> Callable[[Part], Part]:
    """The part gives the values of these fields."""

    def decorate(part: Part) -> Part:
        for name in names:
            setattr(Moment, name, _Field(part, names, name))
        return part

    return decorate


def _slot(record: Any, *path: str) -> slice | int:
    """Where in a packed record the numbers of a field lie: of a vector all, of a number its place."""
    first, kind = 0, record
    for name in path:
        hints = get_type_hints(kind)
        first += sum(width(hints[one]) for one in kind._fields[: kind._fields.index(name)])
        kind = hints[name]
    return first if width(kind) == 1 else slice(first, first + width(kind))


def _reader(record: Any, *paths: str) -> Callable[[Row], Any]:
    """Reads the fields of a packed record that lie at these paths, a.b for the field b of the field a."""
    take = itemgetter(*(_slot(record, *path.split(".")) for path in paths))
    # of a tuple even a part is a tuple
    return lambda row: take(tuple(row.tolist()))


_read_seen = _reader(
    Seen,
    *(f"state.{name}" for name in ("x_load", "v_load", "q_cable", "q_cable_dot", "x_quad", "v_quad")),
    *("state.omega_body", "taut"),
)
_read_estimator = _reader(
    EstimatorState,
    *("vehicle.quat_wxyz", "load.tension", "doubt.horizontal", "doubt.vertical", "vehicle.accel_quad"),
)
_read_pilot = _reader(
    Pilot,
    *("control_mode", "slack_events", "mixed.saturated", "mixed.forces"),
    *(f"command.{name}" for name in ("e_x", "e_v", "e_q", "e_q_dot", "e_R", "e_Omega", "psi_R", "psi_q")),
    *(f"command.{name}" for name in ("q_c", "thrust", "moment")),
)


_read_attitude_asked = _reader(Pilot, "command.R_c")


@_makes(
    *("launch", "breach", "breaches", "breach_us", "armed", "phase", "main_mode", "sub_mode"),
    *("landed_state", "seq", "mission_current", "mission_total", "mission_state", "reel_rate"),
    "system_status",
)
def _flight(m: Moment) -> tuple[Any, ...]:
    told, flight = m.moments.told(m.flight, m.items), m.flight
    return (*told, system_status(flight, flight.phase == Phase.DISARMED and m.ready))


@_makes("x_load", "v_load", "q_cable", "q_cable_dot", "x_quad", "v_quad", "omega_body", "taut", "distance")
def _motion(m: Moment) -> tuple[Any, ...]:
    x_load, v_load, q_cable, q_cable_dot, x_quad, v_quad, omega_body, taut = _read_seen(m.core.rows.seen)
    distance = norm(sub(x_load, x_quad))
    return x_load, v_load, q_cable, q_cable_dot, x_quad, v_quad, omega_body, taut != 0.0, distance


@_makes("quat_wxyz", "tension", "horizontal_std", "vertical_std", "accel_quad")
def _estimate(m: Moment) -> tuple[Any, ...]:
    return _read_estimator(m.core.rows.estimator)  # type: ignore[no-any-return]


@_makes("estimator_flags")
def _flags(m: Moment) -> tuple[Any, ...]:
    return (0 if m.view.complaints else _ESTIMATING,)


@_makes(
    *("control_mode", "slack_events", "saturated", "forces", "e_x", "e_v"),
    *("e_q", "e_q_dot", "e_R", "e_Omega", "psi_R", "psi_q", "q_cable_c", "thrust", "moment"),
)
def _command(m: Moment) -> tuple[Any, ...]:
    mode, slack_events, saturated, forces, e_x, e_v, *others = _read_pilot(m.core.rows.pilot)
    if m.flight.phase not in CARRYING:
        e_x = e_v = ZERO
    return (int(mode), int(slack_events), int(saturated), forces, e_x, e_v, *others)


@_makes("quat_c_wxyz")
def _attitude_asked(m: Moment) -> tuple[Any, ...]:
    r = _read_attitude_asked(m.core.rows.pilot)
    return (quat_from_rotation((r[0:3], r[3:6], r[6:9])),)


@_makes(
    *("elapsed_s", "duration_s", "x_load_d", "v_load_d", "a_load_d", "x_load_asked", "v_load_asked"),
    "x_quad_d",
)
def _setpoint(m: Moment) -> tuple[Any, ...]:
    flight, now_us, x_load, nowhere = m.flight, m.now_us, m.x_load, (nan, nan, nan)
    if not flight.legs:
        elapsed = (now_us - flight.phase_start_us) * 1e-6
        return elapsed, nan, x_load, ZERO, ZERO, x_load, ZERO, nowhere
    leg, elapsed = flight.legs[0], leg_time_s(flight, now_us)
    duration = leg.duration_s if leg.duration_s < inf else nan
    if leg.control_mode == LOAD_POSITION:
        jet = leg.jet(elapsed)
        asked = (
            asked_jet(leg, elapsed) if isinstance(leg, Run) else jet
        )  # a second time only where it differs
        return elapsed, duration, jet[0], jet[1], jet[2], asked[0], asked[1], nowhere
    x_quad_d = leg.jet(elapsed)[0] if leg.control_mode == QUAD_POSITION else nowhere
    return elapsed, duration, x_load, ZERO, ZERO, x_load, ZERO, x_quad_d


@_makes("rotor_min", "rotor_max")
def _limits(m: Moment) -> tuple[Any, ...]:
    setup = m.core.setup
    return (setup.vehicle.rotor_min, setup.vehicle.rotor_max) if setup.limited else (-inf, inf)


@_makes("sensors_present", "sensors_healthy")
def _sensors(m: Moment) -> tuple[Any, ...]:
    return sensor_bits(m.condition, m.estimator, m.ready, m.fake_gps, m.now_us)


@_makes("gps")
def _gps(m: Moment) -> tuple[Any, ...]:
    gps = m.receiver
    if gps is not None:
        place = (gps.position, gps.velocity, gps.horizontal_std, gps.vertical_std)
        return (GpsFix(gps.time_us, gps.fix_type, *place, gps.satellites),)
    if m.fake_gps and tracked(m.estimator):
        fixed, accuracy = mavlink.GPS_FIX_TYPE_3D_FIX, (m.horizontal_std, m.vertical_std)
        return (GpsFix(m.now_us, fixed, m.x_quad, m.v_quad, *accuracy, _NO_COUNT),)
    return (None,)


@_makes("vibration")
def _vibration(m: Moment) -> tuple[Any, ...]:
    return (vibration(m.condition),)


@_makes("wind")
def _wind(m: Moment) -> tuple[Any, ...]:
    felt = m.flight.phase in IN_AIR
    return (wind(m.core.pilot.observed.push, m.core.setup.drag) if felt else (nan, nan, nan),)


@_makes("battery_voltage", "battery_current", "battery_used_mah", "battery_remaining")
def _battery(m: Moment) -> tuple[Any, ...]:
    condition = m.condition
    used_mah = condition.used_as / 3.6
    return voltage(condition, m.battery), condition.current, used_mah, remaining(condition, m.battery)
