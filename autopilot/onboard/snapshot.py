"""The flight core's state as the services' snapshot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import inf, isnan, nan, sqrt
from typing import Any, NamedTuple

import numpy as np

from autopilot.control.drag import Drag
from autopilot.core.flight_core import FlightCore, LaidOut, Setup
from autopilot.core.health import Condition, battery_constants, remaining, sensors, vibration, voltage
from autopilot.core.sensor_inbox import SensorInbox, SlowSensors
from autopilot.estimation.records import (
    FIX,
    MAGNETIC,
    POSE,
    PRESSURE,
    RECEIVER,
    TEST_RATIO,
    TRACKER,
    Array,
    EstimatorState,
    ImuReading,
)
from autopilot.geometry.entry import entry_of, native_address_of
from autopilot.geometry.linear import Vec3, norm, scale
from autopilot.geometry.packed import Row, unpack, width
from autopilot.guidance.layout import jets
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION, Leg, Run
from autopilot.onboard.instant_row import NO_LEG, put_instant
from autopilot.own.chosen import NOTHING_OWN, Own
from autopilot.services import identity, snapshot
from autopilot.services.instant import Instant
from autopilot.services.mission_store import StoredMission
from autopilot.services.snapshot import UNTESTED, GpsFix, Sensed, Snapshot, Sortie, TestRatios
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
    carries,
)
from autopilot.supervisor.watches.fence import limited
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.wire.convert.battery import BatteryReading
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import HilGps
from autopilot.wire.dialect import plumbline as mavlink

FRESH_S = 0.5  # a tracker is healthy while its last reading is younger
UNARMED = (Phase.DISARMED, Phase.FAILSAFE)  # the rotors stand
_NO_COUNT = 255  # number of satellites of a fix without a receiver: unknown

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
_WIDTH = width(Instant)


@dataclass(frozen=True)
class Options:
    """Options of the command line for the whole run."""

    home: Home
    boot_unix_us: int
    lockstep: bool = True
    clock_waits: bool = True  # the clock waits for the autopilot, however long it works
    log: bool = False  # flights are logged, and the shell stores what `Onboard.take_log` returns
    own: Own = NOTHING_OWN  # user code, by its names
    setup_signing: bool = False  # a first signing key is accepted from any sender


def sub_mode(flight: Flight) -> int:
    """Sub-mode of AUTO: the request that is being executed, of which the phase is a part."""
    if flight.mission.active or flight.mission.waiting:
        return identity.AUTO_MISSION
    if flight.returning:
        return identity.AUTO_RTL
    if flight.phase in ON_GROUND:
        return _SELECTED_MODES[flight.selected]
    return _PHASE_MODES[flight.phase]


def mode_of(flight: Flight) -> tuple[int, int]:
    """PX4's pair of the mode that was requested."""
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
    """Whether a tracker measures the vehicle, with recent readings of vehicle and load."""
    vehicle, load = estimator.vehicle, estimator.load
    return vehicle.source == TRACKER and vehicle.age_s < FRESH_S and load.age_s < FRESH_S


def sensor_bits(
    condition: Condition, estimator: EstimatorState, ready: bool, fake_gps: bool, now_us: int
) -> tuple[int, int]:
    """Sensors present and healthy, as bits of SYS_STATUS; with `fake_gps`, a tracker counts as the sensors
    that it replaces."""
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
    """The wind (m/s) whose drag on a resting vehicle equals the observed push (N); NaN without drag."""
    force = norm(push)
    if force == 0.0:
        return push
    # force = (linear + quadratic speed) speed
    root = sqrt(drag.linear * drag.linear + 4.0 * drag.quadratic * force)
    slope = 0.5 * (drag.linear + root)
    return scale(1.0 / slope, push) if slope > 0.0 else (nan, nan, nan)


class Told(NamedTuple):
    """What telemetry takes from a flight record, independent of the estimate: fields of `Snapshot`."""

    launch: Vec3
    guarded: bool
    breach: str
    breaches: int
    breach_us: int
    armed: bool
    phase: int
    main_mode: int
    sub_mode: int
    landed_state: int
    seq: int
    mission_current: int
    mission_total: int
    mission_state: int
    reel_rate: float


def told(flight: Flight, items: int) -> Told:
    """What telemetry takes from a flight record with a mission of `items` items."""
    area, sequence = flight.area, flight.mission.plan.sequence
    seq = sequence[min(flight.mission.step, len(sequence) - 1)] if sequence else 0
    return Told(
        area.home,
        area.guarded,
        area.breach,
        area.breaches,
        area.breach_us,
        flight.phase not in UNARMED,
        int(flight.phase),
        *mode_of(flight),
        _LANDED_STATES.get(flight.phase, mavlink.MAV_LANDED_STATE_IN_AIR),
        seq,
        seq,
        items,
        mission_state(flight, items),
        flight.cable.reel_rate,
    )


def sortie_after(before: Sortie, was: Flight, now: Flight) -> Sortie:
    """The present or the last flight, after the flight record `was` has been followed by `now`."""
    if was.phase in UNARMED and now.phase not in UNARMED:
        before = Sortie(armed_us=now.phase_start_us)
    if now.phase in IN_AIR and not before.takeoff_us:
        return before._replace(takeoff_us=now.phase_start_us)
    if was.phase in IN_AIR and now.phase in ON_GROUND:
        return before._replace(landed_us=now.phase_start_us)
    return before


class MeasuredBattery(NamedTuple):
    """The last reading of a power module, and its time."""

    at_us: int
    reading: BatteryReading


NOT_MEASURED = MeasuredBattery(-(2**62), BatteryReading())
_FRESH_BATTERY_US = 2_000_000  # after this time without a reading, the battery's model is reported


class Moments:
    """Makes the snapshots of one flight core; stores what follows from a flight record while it lasts."""

    def __init__(
        self,
        core: FlightCore,
        options: Options,
        parameters: AutopilotParameters,
        health: Row,
        readings: SensorInbox,
    ) -> None:
        """`health` is the row of `Condition`; the fix of `readings` counts once `fixed` is set."""
        self.core = core
        self.options = options
        self.parameters = parameters
        self.health = health
        self.readings = readings
        self.fixed = False
        self.sortie = Sortie()
        self.battery = battery_constants(parameters)
        self.measured = NOT_MEASURED
        self._flight = core.flight
        self._items = 0
        self._told = told(core.flight, 0)
        self._standing = _standing(core, core.flight, None)
        self._put: Callable[..., None] | None = None  # machine code, after the first call

    def told(self, flight: Flight, items: int) -> Told:
        """What telemetry takes from a flight record with a mission of `items` items."""
        if flight is not self._flight or items != self._items:
            self.sortie = sortie_after(self.sortie, self._flight, flight)
            self._flight, self._items = flight, items
            says = told(flight, items)
            if says != self._told:  # else it stays the same object: a change is noticed by its identity
                self._told = says
        return self._told

    def standing(self, flight: Flight) -> Standing:
        """What stays the same in the next instants, as long as this flight record is in force."""
        core, known = self.core, self._standing
        if flight is not known.flight or core.laid is not known.laid or core.setup is not known.setup:
            known = self._standing = _standing(core, flight, known)
        return known

    def instant(self, flight: Flight, seq: int, now_us: int) -> Row:
        """The packed `Instant` of the core's present state with this flight record."""
        core, known = self.core, self.standing(flight)
        elapsed_s = (now_us - known.since_us) * 1e-6
        targets, asked, at = known.targets, known.asked, 0
        if known.tracks:
            at = core.setpoint_row(now_us)
            if at < 0:
                at, (targets, asked) = 0, _setpoint(flight.legs[0], elapsed_s)
        instant = np.empty(_WIDTH)
        arguments = (
            *(*known.rows, targets, asked, at, known.control_mode, elapsed_s, known.duration_s, now_us),
            *(known.phase, seq, *known.facts, instant),
        )
        if self._put is None:
            self._put = entry_of(put_instant, *arguments)
        self._put(*arguments)
        return instant


def address_of_instant(known: Standing, instant: Row) -> int:
    """The address of `put_instant`, compiled or loaded if necessary."""
    flown = (*known.rows, known.targets, known.asked, 0, known.control_mode, 0.0, known.duration_s, 0)
    return native_address_of(put_instant, *flown, known.phase, 0, *known.facts, instant)


class Standing(NamedTuple):
    """What stays the same in each instant while flight record, setpoints and parameters do: arguments of
    `put_instant`."""

    flight: Flight
    laid: LaidOut | None
    setup: Setup
    rows: tuple[Row, Row, Row, Row]  # `seen`, `estimator`, `pilot`, forces of the rotors
    tracks: bool  # the leg has setpoints:
    targets: Array
    asked: Array  # the requested path, row by row as `targets`
    control_mode: int
    since_us: int  # when the leg began, or the phase if there is no leg
    duration_s: float
    phase: int
    facts: tuple[bool, bool, float, float, int]  # `carrying`, `carries`, `rotor_min`, `rotor_max`, `rotors`


def _standing(core: FlightCore, flight: Flight, before: Standing | None) -> Standing:
    rows, setup, laid = core.rows, core.setup, core.laid
    targets = asked = rows.targets
    mode, since_us, duration_s = NO_LEG, flight.phase_start_us, nan
    if flight.legs:
        leg = flight.legs[0]
        mode, since_us = int(leg.control_mode), flight.leg_start_us
        duration_s = leg.duration_s if leg.duration_s < inf else nan
        if isinstance(leg, Run) and laid is not None and laid.legs is flight.legs:
            # while a winch reels, the flight record is replaced at each tick
            same = before is not None and before.laid is laid and before.flight.legs is flight.legs
            asked = before.asked if before and same else jets(leg, laid.times_s, asked=True)
    limits = (setup.vehicle.rotor_min, setup.vehicle.rotor_max) if setup.limited else (-inf, inf)
    return Standing(
        flight,
        laid,
        setup,
        (rows.seen, core.shown_estimator, rows.pilot, core.force_row),
        mode in (LOAD_POSITION, QUAD_POSITION),
        targets,
        asked,
        mode,
        since_us,
        float(duration_s),
        int(flight.phase),
        (flight.phase in CARRYING, carries(flight), *limits, len(setup.layout)),
    )


def _setpoint(leg: Leg, elapsed_s: float) -> tuple[Array, Array]:
    """The setpoint of a leg for this instant, and the requested path, if they are not laid out in tables."""
    times_s = np.array([elapsed_s])
    targets = jets(leg, times_s)
    return targets, jets(leg, times_s, asked=True) if isinstance(leg, Run) else targets


class Moment(Snapshot):
    """The present instant of the flight core; to be read before anything changes there.

    Its fields are computed when they are first read, each together with those of its part below, because few
    of them are sent at most instants.
    """

    instant: Row  # the values that are sent and logged most often

    def __init__(self, moments: Moments, mission: StoredMission, now_us: int) -> None:
        self.now_us = now_us
        self.boot_unix_us = moments.options.boot_unix_us
        self.home = moments.options.home
        self.moments = moments
        self.core = moments.core
        self.flight = moments.core.flight
        self.told = moments.told(self.flight, len(mission.items))
        # a disarmed vehicle also reports whether it may be armed
        self.unchanged = None if self.flight.phase == Phase.DISARMED else self.told
        self.armed, self.phase = self.told.armed, self.told.phase
        self.instant = moments.instant(self.flight, self.told.seq, now_us)

    @cached_property
    def estimator(self) -> EstimatorState:
        """The estimate."""
        return self.core.estimator

    @cached_property
    def condition(self) -> Condition:
        """Times of the sensors' readings, vibration, battery."""
        return unpack(Condition, self.moments.health, 0)

    @cached_property
    def view(self) -> View:
        """What the supervisor sees."""
        return self.core.view(self.now_us)

    @cached_property
    def ready(self) -> bool:
        """Whether the vehicle may be armed or is armed: in flight, reasons against arming do not count."""
        if self.flight.phase not in UNARMED:
            return True
        return not arming_complaints(self.flight, self.view, self.core.settings)

    @property
    def fake_gps(self) -> bool:
        """Whether the tracker is reported as a GNSS receiver if there is none."""
        return self.moments.parameters["MAV_FAKE_GPS"] == 1.0


Part = Callable[[Moment], tuple[Any, ...]]


class _Field:
    """A field of a `Moment` that is not computed yet: reading it computes all fields of its part."""

    def __init__(self, part: Part, names: tuple[str, ...], name: str) -> None:
        self._part, self._names, self._name = part, names, name

    def __get__(self, moment: Moment, owner: Any) -> Any:
        made = moment.__dict__
        made.update(zip(self._names, self._part(moment), strict=True))
        return made[self._name]


def _makes(*names: str) -> Callable[[Part], Part]:
    """Decorator: the part returns the values of these fields."""

    def decorate(part: Part) -> Part:
        for name in names:
            setattr(Moment, name, _Field(part, names, name))
        return part

    return decorate


@_makes(*Instant._fields)
def _instant(m: Moment) -> tuple[Any, ...]:
    return unpack(Instant, m.instant, 0)


@_makes(*Told._fields)
def _told(m: Moment) -> tuple[Any, ...]:
    return m.told


@_makes("system_status")
def _system_status(m: Moment) -> tuple[Any, ...]:
    return (system_status(m.flight, m.flight.phase == Phase.DISARMED and m.ready),)


@_makes("sensors_present", "sensors_healthy")
def _sensors(m: Moment) -> tuple[Any, ...]:
    present, healthy = sensor_bits(m.condition, m.estimator, m.ready, m.fake_gps, m.now_us)
    return present | (snapshot.GEOFENCE if limited(m.flight, m.core.settings) else 0), healthy


@_makes("gps")
def _gps(m: Moment) -> tuple[Any, ...]:
    if m.moments.fixed:
        gps = unpack(HilGps, m.moments.readings.fix, 0)
        place = (gps.position, gps.velocity, gps.horizontal_std, gps.vertical_std)
        return (GpsFix(gps.time_us, gps.fix_type, *place, gps.satellites),)
    if m.fake_gps and tracked(m.estimator):
        fixed, accuracy = mavlink.GPS_FIX_TYPE_3D_FIX, (m.horizontal_std, m.vertical_std)
        return (GpsFix(m.now_us, fixed, m.x_quad, m.v_quad, *accuracy, _NO_COUNT),)
    return (None,)


@_makes("cable_length")
def _cable_length(m: Moment) -> tuple[Any, ...]:
    length = m.flight.cable.length_m
    return (m.core.setup.vehicle.cable_length if length is None else length,)


@_makes("built_in")
def _built_in(m: Moment) -> tuple[Any, ...]:
    return (m.core.built_in,)


@_makes("sensed")
def _sensed(m: Moment) -> tuple[Any, ...]:
    readings = m.moments.readings
    imu, slow = unpack(ImuReading, readings.imu, 0), unpack(SlowSensors, readings.slow, 0)
    if isnan(imu.gyro[0]):
        return (None,)
    _, _, field_us, pressure_us = m.condition.heard_us
    return (Sensed(imu.gyro, imu.accel, *slow, field_us, pressure_us),)


@_makes("test_ratios")
def _test_ratios(m: Moment) -> tuple[Any, ...]:
    if m.built_in is not None:
        return (UNTESTED,)  # a custom estimator flies
    ratios, source = m.core.rows.history.consistency[:, TEST_RATIO], m.estimator.vehicle.source
    if source == TRACKER:
        pose = float(ratios[POSE])
        return (TestRatios(nan, pose, pose, nan),)  # the test is of the position
    if source == RECEIVER:
        fix = float(ratios[FIX])  # of position and velocity together
        return (TestRatios(fix, fix, max(fix, float(ratios[PRESSURE])), float(ratios[MAGNETIC])),)
    return (UNTESTED,)


@_makes("rotor_rpm", "rotors_lost")
def _rotors(m: Moment) -> tuple[Any, ...]:
    return m.core.told_rpm, m.flight.rotors_lost


@_makes("sortie")
def _sortie(m: Moment) -> tuple[Any, ...]:
    return (m.moments.sortie,)


@_makes("vibration")
def _vibration(m: Moment) -> tuple[Any, ...]:
    return (vibration(m.condition),)


@_makes("wind")
def _wind(m: Moment) -> tuple[Any, ...]:
    felt = m.flight.phase in IN_AIR
    return (wind(m.core.pilot.observed.push, m.core.setup.drag) if felt else (nan, nan, nan),)


@_makes("battery_voltage", "battery_current", "battery_used_mah", "battery_remaining")
def _battery(m: Moment) -> tuple[Any, ...]:
    measured = m.moments.measured
    if m.now_us - measured.at_us <= _FRESH_BATTERY_US:
        return measured.reading
    condition, battery = m.condition, m.moments.battery
    used_mah = condition.used_as / 3.6
    return voltage(condition, battery), condition.current, used_mah, remaining(condition, battery)
