"""The flight core's state as the services' snapshot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import inf, isnan, nan, sqrt
from typing import Any, NamedTuple

import numpy as np

from autopilot.control.drag import Drag
from autopilot.core.flight_core import FlightCore, PlannedSetpoints, Setup
from autopilot.core.health import (
    Condition,
    battery_constants,
    present_and_healthy,
    remaining_charge,
    vibration,
    voltage,
)
from autopilot.core.sensor_inbox import SensorInbox, SlowSensors
from autopilot.estimation.filter import MAX_FIX_AGE_S
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
from autopilot.geometry.entry import entry_point_of, kernel_address_of
from autopilot.geometry.linear import Vec3, norm, scale
from autopilot.geometry.packed import Row, unpack, width
from autopilot.guidance.jet_table import flies_requested_path, jets
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION, Leg
from autopilot.onboard.instant_row import NO_LEG, put_instant
from autopilot.own.own_code import NO_OWN_CODE, OwnCode
from autopilot.services import identity, snapshot
from autopilot.services.instant import Instant
from autopilot.services.mission_store import StoredMission
from autopilot.services.snapshot import NO_TEST_RATIOS, GpsFix, SensorReadings, Snapshot, Sortie, TestRatios
from autopilot.supervisor.mission import present_item
from autopilot.supervisor.requests.arming import arming_problems
from autopilot.supervisor.state import (
    CARRYING,
    IN_AIR,
    ON_GROUND,
    UNARMED,
    ActionWhenArmed,
    Fall,
    Flight,
    Phase,
    SetpointSource,
    View,
    has_fence,
    is_placing,
)
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.wire.convert.battery import NO_READING, BatteryReading
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import HilGps
from autopilot.wire.dialect import plumbline as mavlink

TRACKER_TIMEOUT_S = 0.5  # a tracker is healthy while its last reading is younger
_FIX_TIMEOUT_US = round(MAX_FIX_AGE_S * 1e6)  # after this time, a receiver that is silent has no fix
_NO_VELOCITY = (nan, nan, nan)
_UNKNOWN_COUNT = 255  # number of satellites of a fix without a receiver: unknown

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
_ACTION_MODES = {
    ActionWhenArmed.NOTHING: identity.AUTO_LOITER,
    ActionWhenArmed.TAKEOFF: identity.AUTO_TAKEOFF,
    ActionWhenArmed.MISSION: identity.AUTO_MISSION,
    ActionWhenArmed.OFFBOARD: identity.AUTO_LOITER,
}
_SOURCE_MODES = {
    SetpointSource.OFFBOARD: (identity.OFFBOARD, 0),
    SetpointSource.MANUAL: (identity.POSCTL, 0),
    SetpointSource.TARGET: identity.FOLLOW_MODE,
}
_LANDED_STATES = {
    Phase.ARMED: mavlink.MAV_LANDED_STATE_ON_GROUND,
    Phase.TAUTEN: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Phase.LIFT: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Phase.LOWER: mavlink.MAV_LANDED_STATE_LANDING,
    Phase.SET_DOWN: mavlink.MAV_LANDED_STATE_LANDING,
}
_FALL_STATES = {
    Fall.NONE: mavlink.MAV_LANDED_STATE_ON_GROUND,
    Fall.FALLING: mavlink.MAV_LANDED_STATE_IN_AIR,
    Fall.UNKNOWN: mavlink.MAV_LANDED_STATE_UNDEFINED,
}
_ALWAYS_PRESENT = snapshot.MOTORS | snapshot.AHRS | snapshot.BATTERY
_REPLACED_BY_TRACKER = snapshot.GPS | snapshot.MAG | snapshot.BARO
_WIDTH = width(Instant)


@dataclass(frozen=True)
class Options:
    """Options of the command line for the whole run."""

    home: Home
    boot_unix_us: int
    lockstep: bool = True
    clock_waits: bool = True  # the clock waits for the autopilot, however long it works
    log: bool = False  # flights are logged, and the shell stores what `Onboard.take_log` returns
    own: OwnCode = NO_OWN_CODE  # user code, by its names
    setup_signing: bool = False  # a first signing key is accepted from any sender


def sub_mode(flight: Flight) -> int:
    """Sub-mode of AUTO: the request that is being executed, of which the phase is a part."""
    if flight.mission.active or flight.mission.waiting:
        return identity.AUTO_MISSION
    if flight.returning:
        return identity.AUTO_RTL
    if flight.phase in ON_GROUND:
        return _ACTION_MODES[flight.action_when_armed]
    return _PHASE_MODES[flight.phase]


def reported_mode(flight: Flight) -> tuple[int, int]:
    """PX4's pair of the mode that was requested."""
    rising = flight.phase in ON_GROUND or flight.phase in (Phase.TAUTEN, Phase.LIFT)
    if flight.action_when_armed == ActionWhenArmed.OFFBOARD and rising:
        return identity.OFFBOARD, 0
    if flight.phase == Phase.GUIDED and flight.setpoints.source in _SOURCE_MODES:
        return _SOURCE_MODES[flight.setpoints.source]
    return identity.AUTO, sub_mode(flight)


def landed_state(flight: Flight) -> int:
    """MAV_LANDED_STATE of the flight."""
    if flight.phase in UNARMED:
        return _FALL_STATES[flight.fall]
    if is_placing(flight):
        return int(mavlink.MAV_LANDED_STATE_IN_AIR)
    return _LANDED_STATES.get(flight.phase, mavlink.MAV_LANDED_STATE_IN_AIR)


def system_status(flight: Flight) -> int:
    """MAV_STATE of the flight."""
    if flight.phase == Phase.FAILSAFE or flight.fall == Fall.FALLING:
        return mavlink.MAV_STATE_FLIGHT_TERMINATION
    if flight.phase == Phase.DISARMED:
        return mavlink.MAV_STATE_STANDBY
    return mavlink.MAV_STATE_CRITICAL if flight.is_failsafe else mavlink.MAV_STATE_ACTIVE


def mission_state(flight: Flight, items: int) -> int:
    """MISSION_STATE of the flight."""
    if items == 0:
        return mavlink.MISSION_STATE_NO_MISSION
    if flight.mission.active:
        return mavlink.MISSION_STATE_ACTIVE
    on_ground, mission = flight.phase in ON_GROUND, flight.mission
    begins_flight = flight.action_when_armed == ActionWhenArmed.MISSION
    if mission.done and not (mission.waiting or (on_ground and begins_flight)):
        return mavlink.MISSION_STATE_COMPLETE
    was_begun = begins_flight or mission.step > 0 or mission.step_anchor is not None
    return mavlink.MISSION_STATE_PAUSED if was_begun and not on_ground else mavlink.MISSION_STATE_NOT_STARTED


def is_tracked(estimator: EstimatorState) -> bool:
    """Whether a tracker measures the vehicle, with recent readings."""
    return estimator.vehicle.source == TRACKER and estimator.vehicle.age_s < TRACKER_TIMEOUT_S


def sensor_bits(
    condition: Condition,
    estimator: EstimatorState,
    ready: bool,
    fake_gps: bool,
    now_us: int,
    battery_empty: bool = False,
) -> tuple[int, int]:
    """Sensors present and healthy, as bits of SYS_STATUS; with `fake_gps`, a tracker counts as the sensors
    that it replaces. A battery that is too empty to fly is not healthy."""
    present, healthy = (bits | _ALWAYS_PRESENT for bits in present_and_healthy(condition, now_us))
    if estimator.vehicle.source == TRACKER:
        tracker_bits = snapshot.TRACKER | (_REPLACED_BY_TRACKER & ~present if fake_gps else 0)
        present |= tracker_bits
        if is_tracked(estimator):
            healthy |= tracker_bits
    if battery_empty:
        healthy &= ~snapshot.BATTERY
    if ready:
        healthy |= snapshot.PREARM
    return present, healthy


def estimated_wind(drag_force: Vec3, drag: Drag) -> Vec3:
    """The wind (m/s) whose drag on a resting vehicle equals the observed push (N); NaN without drag."""
    force = norm(drag_force)
    if force == 0.0:
        return drag_force
    # force = (linear + quadratic speed) speed
    root = sqrt(drag.linear * drag.linear + 4.0 * drag.quadratic * force)
    slope = 0.5 * (drag.linear + root)
    return scale(1.0 / slope, drag_force) if slope > 0.0 else (nan, nan, nan)


class FlightStatus(NamedTuple):
    """What telemetry takes from a flight record, independent of the estimate: fields of `Snapshot`."""

    home_position: Vec3
    fence_enabled: bool
    breach: str
    last_breach: str
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
    released: bool


def flight_status(flight: Flight, items: int) -> FlightStatus:
    """What telemetry takes from a flight record with a mission of `items` items."""
    area, seq = flight.area, present_item(flight)
    return FlightStatus(
        area.home,
        area.fence_enabled,
        area.breach,
        area.last_breach,
        area.breaches,
        area.breach_us,
        flight.phase not in UNARMED,
        int(flight.phase),
        *reported_mode(flight),
        landed_state(flight),
        seq,
        seq,
        items,
        mission_state(flight, items),
        flight.cable.reel_rate,
        flight.cable.released,
    )


def sortie_after(sortie: Sortie, previous: Flight, now: Flight) -> Sortie:
    """The present or the last flight, after the flight record `previous` has been followed by `now`."""
    if previous.phase in UNARMED and now.phase not in UNARMED:
        sortie = Sortie(armed_us=now.phase_start_us)
    if now.phase in IN_AIR and not sortie.takeoff_us:
        return sortie._replace(takeoff_us=now.phase_start_us)
    if previous.phase in IN_AIR and now.phase in ON_GROUND and now.fall == Fall.NONE:
        return sortie._replace(landed_us=now.phase_start_us)
    return sortie


class MeasuredBattery(NamedTuple):
    """The last reading of a power module, and its time."""

    time_us: int
    reading: BatteryReading


NOT_MEASURED = MeasuredBattery(-(2**62), NO_READING)
BATTERY_TIMEOUT_US = 2_000_000  # after this time without a reading, the battery's model is reported


class SnapshotSource:
    """Makes the snapshots of one flight core; stores what follows from a flight record while it lasts."""

    def __init__(
        self,
        core: FlightCore,
        options: Options,
        parameters: AutopilotParameters,
        health: Row,
        readings: SensorInbox,
    ) -> None:
        """`health` is the row of `Condition`; the fix of `readings` counts once `has_fix` is set."""
        self.core = core
        self.options = options
        self.parameters = parameters
        self.health = health
        self.readings = readings
        self.has_fix = False
        self.sortie = Sortie()
        self.battery = battery_constants(parameters)
        self.measured = NOT_MEASURED
        self._flight = core.flight
        self._items = 0
        self._flight_status = flight_status(core.flight, 0)
        self._constants = _instant_constants(core, core.flight, None)
        self._put: Callable[..., None] | None = None  # machine code, after the first call

    def flight_status(self, flight: Flight, items: int) -> FlightStatus:
        """What telemetry takes from a flight record with a mission of `items` items."""
        if flight is not self._flight or items != self._items:
            self.sortie = sortie_after(self.sortie, self._flight, flight)
            self._flight, self._items = flight, items
            status = flight_status(flight, items)
            if (
                status != self._flight_status
            ):  # else it stays the same object: a change is noticed by its identity
                self._flight_status = status
        return self._flight_status

    def note_rest(self, now_us: int) -> None:
        """The vehicle rests on the ground, after its rotors had stopped in the air."""
        self.sortie = self.sortie._replace(landed_us=now_us)

    def instant_constants(self, flight: Flight) -> InstantConstants:
        """What stays the same in the next instants, as long as this flight record is in force."""
        core, constants = self.core, self._constants
        if (
            flight is not constants.flight
            or core.planned is not constants.setpoints
            or core.setup is not constants.setup
        ):
            constants = self._constants = _instant_constants(core, flight, constants)
        return constants

    def instant(self, flight: Flight, seq: int, now_us: int) -> Row:
        """The packed `Instant` of the core's present state with this flight record."""
        core, constants = self.core, self.instant_constants(flight)
        elapsed_s = (now_us - constants.start_us) * 1e-6
        targets, requested, row = constants.targets, constants.requested, 0
        if constants.has_setpoints:
            row = core.setpoint_row(now_us)
            if row < 0:
                row, (targets, requested) = 0, _setpoint(flight.legs[0], elapsed_s)
        instant = np.empty(_WIDTH)
        arguments = (
            *(
                *constants.rows,
                targets,
                requested,
                row,
                constants.control_mode,
                elapsed_s,
                constants.duration_s,
                now_us,
            ),
            *(constants.phase, seq, *constants.load_and_vehicle, instant),
        )
        if self._put is None:
            self._put = entry_point_of(put_instant, *arguments)
        self._put(*arguments)
        return instant


def address_of_instant(constants: InstantConstants, instant: Row) -> int:
    """The address of `put_instant`, compiled or loaded if necessary."""
    arguments = (
        *constants.rows,
        constants.targets,
        constants.requested,
        0,
        constants.control_mode,
        0.0,
        constants.duration_s,
        0,
    )
    return kernel_address_of(
        put_instant, *arguments, constants.phase, 0, *constants.load_and_vehicle, instant
    )


class InstantConstants(NamedTuple):
    """What stays the same in each instant while flight record, setpoints and parameters do: arguments of
    `put_instant`."""

    flight: Flight
    setpoints: PlannedSetpoints | None
    setup: Setup
    rows: tuple[Row, Row, Row, Row]  # `summary`, `estimator`, `control`, forces of the rotors
    has_setpoints: bool  # the leg has setpoints:
    targets: Array
    requested: Array  # the requested path, row by row as `targets`
    control_mode: int
    start_us: int  # when the leg began, or the phase if there is no leg
    duration_s: float
    phase: int
    # `load_tracked`, `assumed_load_kg`, `rotor_min`, `rotor_max`, `rotors`, `heading`
    load_and_vehicle: tuple[bool, float, float, float, int, float]


def _instant_constants(core: FlightCore, flight: Flight, before: InstantConstants | None) -> InstantConstants:
    rows, setup, setpoints = core.rows, core.setup, core.planned
    targets = requested = rows.targets
    mode, start_us, duration_s = NO_LEG, flight.phase_start_us, nan
    if flight.legs:
        leg = flight.legs[0]
        mode, start_us = int(leg.control_mode), flight.leg_start_us
        duration_s = leg.duration_s if leg.duration_s < inf else nan
        if not flies_requested_path(leg) and setpoints is not None and setpoints.legs is flight.legs:
            # while a winch reels, the flight record is replaced at each tick
            unchanged = (
                before is not None and before.setpoints is setpoints and before.flight.legs is flight.legs
            )
            requested = (
                before.requested if before and unchanged else jets(leg, setpoints.times_s, requested=True)
            )
    limits = (setup.vehicle.rotor_min, setup.vehicle.rotor_max) if setup.limited else (-inf, inf)
    load_kg = setup.vehicle.load_mass if core.built_in is None else 0.0
    return InstantConstants(
        flight,
        setpoints,
        setup,
        (rows.summary, core.reported_estimator, rows.control, core.force_row),
        mode in (LOAD_POSITION, QUAD_POSITION),
        targets,
        requested,
        mode,
        start_us,
        float(duration_s),
        int(flight.phase),
        (flight.phase in CARRYING, load_kg, *limits, len(setup.layout), flight.heading.angle),
    )


def _setpoint(leg: Leg, elapsed_s: float) -> tuple[Array, Array]:
    """The setpoint of a leg for this instant, and the requested path, if they are not laid out in tables."""
    times_s = np.array([elapsed_s])
    targets = jets(leg, times_s)
    return targets, targets if flies_requested_path(leg) else jets(leg, times_s, requested=True)


class CoreSnapshot(Snapshot):
    """The present instant of the flight core; to be read before anything changes there.

    Its fields are computed when they are first read, each together with those of its part below, because few
    of them are sent at most instants.
    """

    instant: Row  # the values that are sent and logged most often

    def __init__(self, source: SnapshotSource, mission: StoredMission, now_us: int) -> None:
        self.now_us = now_us
        self.boot_unix_us = source.options.boot_unix_us
        self.home = source.options.home
        self.source = source
        self.core = source.core
        self.flight = source.core.flight
        self.flight_status = source.flight_status(self.flight, len(mission.items))
        # a disarmed vehicle also reports whether it may be armed
        self.change_token = None if self.flight.phase == Phase.DISARMED else self.flight_status
        self.armed, self.phase = self.flight_status.armed, self.flight_status.phase
        self.instant = source.instant(self.flight, self.flight_status.seq, now_us)

    @cached_property
    def estimator(self) -> EstimatorState:
        """The estimate."""
        return self.core.estimator

    @cached_property
    def condition(self) -> Condition:
        """Times of the sensors' readings, vibration, battery."""
        return unpack(Condition, self.source.health, 0)

    @cached_property
    def view(self) -> View:
        """What the supervisor sees."""
        return self.core.view(self.now_us)

    @cached_property
    def ready(self) -> bool:
        """Whether the vehicle may be armed or is armed: in flight, reasons against arming do not count."""
        if self.flight.phase not in UNARMED:
            return True
        return not arming_problems(self.flight, self.view, self.core.settings)

    @property
    def fake_gps(self) -> bool:
        """Whether the tracker is reported as a GNSS receiver if there is none."""
        return self.source.parameters["MAV_FAKE_GPS"] == 1.0


FieldGroup = Callable[[CoreSnapshot], tuple[Any, ...]]


class _LazyField:
    """A field of a `CoreSnapshot` that is not computed yet: reading it computes all fields of its part."""

    def __init__(self, group: FieldGroup, names: tuple[str, ...], name: str) -> None:
        self._group, self._names, self._name = group, names, name

    def __get__(self, snapshot: CoreSnapshot, owner: Any) -> Any:
        values = snapshot.__dict__
        values.update(zip(self._names, self._group(snapshot), strict=True))
        return values[self._name]


def _provides(*names: str) -> Callable[[FieldGroup], FieldGroup]:
    """Decorator: the part returns the values of these fields."""

    def decorate(group: FieldGroup) -> FieldGroup:
        for name in names:
            setattr(CoreSnapshot, name, _LazyField(group, names, name))
        return group

    return decorate


@_provides(*Instant._fields)
def _instant(m: CoreSnapshot) -> tuple[Any, ...]:
    return unpack(Instant, m.instant, 0)


@_provides(*FlightStatus._fields)
def _flight_status_fields(m: CoreSnapshot) -> tuple[Any, ...]:
    return m.flight_status


@_provides("system_status")
def _system_status(m: CoreSnapshot) -> tuple[Any, ...]:
    return (system_status(m.flight),)


@_provides("sensors_present", "sensors_healthy")
def _sensors(m: CoreSnapshot) -> tuple[Any, ...]:
    is_empty = m.flight.is_battery_empty
    present, healthy = sensor_bits(m.condition, m.estimator, m.ready, m.fake_gps, m.now_us, is_empty)
    return present | (snapshot.GEOFENCE if has_fence(m.flight, m.core.settings) else 0), healthy


@_provides("gps")
def _gps(m: CoreSnapshot) -> tuple[Any, ...]:
    if m.source.has_fix:
        gps = unpack(HilGps, m.source.readings.fix, 0)
        position = (gps.position, gps.velocity, gps.horizontal_std, gps.vertical_std)
        if m.now_us - m.condition.fix_us > _FIX_TIMEOUT_US:
            lost = (mavlink.GPS_FIX_TYPE_NO_FIX, gps.position, _NO_VELOCITY, nan, nan, _UNKNOWN_COUNT)
            return (GpsFix(gps.time_us, *lost),)
        return (GpsFix(gps.time_us, gps.fix_type, *position, gps.satellites),)
    if m.fake_gps and is_tracked(m.estimator):
        fix_type, accuracy = mavlink.GPS_FIX_TYPE_3D_FIX, (m.horizontal_std, m.vertical_std)
        return (GpsFix(m.now_us, fix_type, m.x_quad, m.v_quad, *accuracy, _UNKNOWN_COUNT),)
    return (None,)


@_provides("cable_length")
def _cable_length(m: CoreSnapshot) -> tuple[Any, ...]:
    length = m.flight.cable.length_m
    return (m.core.setup.vehicle.cable_length if length is None else length,)


@_provides("built_in")
def _built_in(m: CoreSnapshot) -> tuple[Any, ...]:
    return (m.core.built_in,)


@_provides("readings")
def _readings(m: CoreSnapshot) -> tuple[Any, ...]:
    readings = m.source.readings
    imu, slow = unpack(ImuReading, readings.imu, 0), unpack(SlowSensors, readings.slow, 0)
    if isnan(imu.gyro[0]):
        return (None,)
    _, _, field_us, pressure_us = m.condition.last_received_us
    return (SensorReadings(imu.gyro, imu.accel, *slow, field_us, pressure_us),)


@_provides("test_ratios")
def _test_ratios(m: CoreSnapshot) -> tuple[Any, ...]:
    if m.built_in is not None:
        return (NO_TEST_RATIOS,)  # a custom estimator flies
    ratios, source = m.core.rows.history.consistency[:, TEST_RATIO], m.estimator.vehicle.source
    if source == TRACKER:
        pose = float(ratios[POSE])
        return (TestRatios(nan, pose, pose, nan),)  # the test is of the position
    if source == RECEIVER:
        fix = float(ratios[FIX])  # of position and velocity together
        return (TestRatios(fix, fix, max(fix, float(ratios[PRESSURE])), float(ratios[MAGNETIC])),)
    return (NO_TEST_RATIOS,)


@_provides("rotor_rpm", "rotors_lost")
def _rotors(m: CoreSnapshot) -> tuple[Any, ...]:
    return m.core.reported_rpm, m.flight.rotors_lost


@_provides("sortie")
def _sortie(m: CoreSnapshot) -> tuple[Any, ...]:
    return (m.source.sortie,)


@_provides("vibration", "clipped_samples")
def _vibration(m: CoreSnapshot) -> tuple[Any, ...]:
    return vibration(m.condition), int(m.estimator.clipping.samples)


@_provides("wind")
def _wind(m: CoreSnapshot) -> tuple[Any, ...]:
    is_airborne = m.flight.phase in IN_AIR
    return (
        estimated_wind(m.core.control.observed.push, m.core.setup.drag) if is_airborne else (nan, nan, nan),
    )


@_provides("charge_levels")
def _charge_levels(m: CoreSnapshot) -> tuple[Any, ...]:
    return (m.core.settings.battery.levels,)


@_provides("battery_voltage", "battery_current", "battery_used_mah", "battery_remaining")
def _battery(m: CoreSnapshot) -> tuple[Any, ...]:
    measured = m.source.measured
    if m.now_us - measured.time_us <= BATTERY_TIMEOUT_US:
        return measured.reading
    condition, battery = m.condition, m.source.battery
    used_mah = condition.used_as / 3.6
    return voltage(condition, battery), condition.current, used_mah, remaining_charge(condition, battery)
