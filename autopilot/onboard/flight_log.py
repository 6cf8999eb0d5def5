"""The on-board flight log: from arming until shortly after disarming, as ULog bytes for the shell to store.

The topics bear PX4's names and fields where PX4 has them, so that its tools draw them; those that begin with
`load_`, `cascade_`, `rotor_` and `estimator_plumbline` are our own. World axes are NED, body axes FRD, units
SI, as in PX4. The log holds what the autopilot knows: the truth of a simulated flight is not in it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime
from math import isfinite, nan
from typing import NamedTuple

from autopilot.estimation.records import EstimatorState, ImuReading
from autopilot.geometry.frames import quat_ned_frd_from_enu_flu
from autopilot.geometry.linear import Vec3
from autopilot.services import identity
from autopilot.services.files import LOG_ENDING, LOG_FOLDER, Path
from autopilot.services.snapshot import Snapshot
from autopilot.wire import ulog
from autopilot.wire.convert.axes import frd_from_flu, ned_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_table import ParameterTable
from autopilot.wire.ulog import Topic, UlogWriter

TAIL_US = 1_000_000  # so long the log goes on behind the disarming
SLOW_US = 500_000  # between two records of the slow topics
MOST_WAITING = 4 * 2**20  # bytes that the shell has not taken; beyond them records are dropped
TEXTS_BEFORE = 20  # said before arming, the log begins with them
_OUTPUTS = 16  # actuator_outputs.output
_MOTORS = 12  # actuator_motors.control
_STOP_US, _FULL_US = 1000.0, 2000.0  # actuator_outputs as most tools expect them
_FLOAT32_MAX = 3.4028234663852886e38
# PX4's vehicle_status
_DISARMED, _ARMED = 1, 2
_NAV_STATES = {
    identity.AUTO_MISSION: 3,
    identity.AUTO_LOITER: 4,
    identity.AUTO_RTL: 5,
    identity.AUTO_TAKEOFF: 17,
    identity.AUTO_LAND: 18,
}
_ROTARY_WING = 1


class Sample(NamedTuple):
    """One instant of the flight."""

    snapshot: Snapshot
    imu: ImuReading | None
    accel_quad: Vec3  # m/s^2, ENU
    estimator: Callable[[], EstimatorState]  # for the slow topics


class LogChunk(NamedTuple):
    """Bytes that belong behind those of the same file before; `ended`: nothing follows."""

    path: Path
    data: bytes
    ended: bool


Numbers = tuple[float, ...]


def _local_position(s: Sample) -> Numbers:
    v = s.snapshot
    home = v.home
    return (
        *(home.latitude_deg, home.longitude_deg),
        *ned_from_enu(v.x_quad),
        *ned_from_enu(v.v_quad),
        *ned_from_enu(s.accel_quad),
        *(home.altitude_m, v.horizontal_std, v.vertical_std),
        *(v.estimator_flags != 0,) * 6,
    )


def _attitude(s: Sample) -> Numbers:
    return quat_ned_frd_from_enu_flu(s.snapshot.quat_wxyz)


def _angular_velocity(s: Sample) -> Numbers:
    return frd_from_flu(s.snapshot.omega_body)


def _sensor_combined(s: Sample) -> Numbers | None:
    return None if s.imu is None else (*frd_from_flu(s.imu.gyro), *frd_from_flu(s.imu.accel))


def _outputs(s: Sample) -> Numbers:
    pulses = [_STOP_US + (_FULL_US - _STOP_US) * share for share in _shares(s.snapshot)]
    return (len(pulses), *pulses, *(0.0,) * (_OUTPUTS - len(pulses)))


def _motors(s: Sample) -> Numbers:
    shares = _shares(s.snapshot)
    return (*shares, *(nan,) * (_MOTORS - len(shares)))


def _shares(v: Snapshot) -> list[float]:
    """Rotor forces between none and the greatest, where there is one."""
    most = v.rotor_max if isfinite(v.rotor_max) and v.rotor_max > 0.0 else 1.0
    return [min(max(force / most, 0.0), 1.0) for force in v.forces]


def _position_setpoint(s: Sample) -> Numbers:
    v = s.snapshot
    return (*ned_from_enu(v.x_quad_d), *ned_from_enu(v.v_quad_d), *ned_from_enu(v.a_quad_d))


def _attitude_setpoint(s: Sample) -> Numbers:
    return quat_ned_frd_from_enu_flu(s.snapshot.quat_c_wxyz)


def _load_state(s: Sample) -> Numbers:
    v = s.snapshot
    return (
        *ned_from_enu(v.x_load),
        *ned_from_enu(v.v_load),
        *ned_from_enu(v.q_cable),
        *ned_from_enu(v.q_cable_dot),
        *(v.distance, v.tension, v.slack_events, v.taut),
    )


def _load_setpoint(s: Sample) -> Numbers:
    v = s.snapshot
    return (
        *ned_from_enu(v.x_load_d),
        *ned_from_enu(v.v_load_d),
        *ned_from_enu(v.a_load_d),
        *ned_from_enu(v.x_load_asked),
        *ned_from_enu(v.v_load_asked),
        *ned_from_enu(v.q_cable_c),
        *(v.elapsed_s, v.duration_s),
        *(v.seq & 0xFFFF, v.phase, v.control_mode),
    )


def _cascade_errors(s: Sample) -> Numbers:
    v = s.snapshot
    return (
        *ned_from_enu(v.e_x),
        *ned_from_enu(v.e_v),
        *ned_from_enu(v.e_q),
        *ned_from_enu(v.e_q_dot),
        *frd_from_flu(v.e_R),
        *frd_from_flu(v.e_Omega),
        *(v.psi_R, v.psi_q, v.thrust),
        *frd_from_flu(v.moment),
    )


def _rotor_forces(s: Sample) -> Numbers:
    v = s.snapshot
    return (*v.forces, v.rotor_min, v.rotor_max, v.saturated)


def _estimator(s: Sample) -> Numbers:
    estimator = s.estimator()
    vehicle, load = estimator.vehicle, estimator.load
    return (
        *frd_from_flu(vehicle.gyro_bias),
        *frd_from_flu(vehicle.accel_bias),
        *(vehicle.age_s, vehicle.rejected, load.age_s, load.rejected),
    )


def _status(s: Sample) -> Numbers:
    v = s.snapshot
    failsafe = v.system_status == mavlink.MAV_STATE_EMERGENCY
    return (
        *(_ARMED if v.armed else _DISARMED, _NAV_STATES.get(v.sub_mode, _NAV_STATES[identity.AUTO_LOITER])),
        *(_ROTARY_WING, failsafe),
    )


def _land_detected(s: Sample) -> Numbers:
    return (s.snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND,)


def _battery(s: Sample) -> Numbers:
    v = s.snapshot
    return (v.battery_voltage, nan, v.battery_remaining, True)


def _vector(name: str) -> str:
    return f"float[3] {name}"


_AXES = ("float x", "float y", "float z", "float vx", "float vy", "float vz")
_VALID = ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid", "xy_global", "z_global")
_Builder = Callable[[Sample], "Numbers | None"]

FAST: tuple[tuple[Topic, _Builder], ...] = (
    (
        Topic(
            "vehicle_local_position",
            (
                *("double ref_lat", "double ref_lon", *_AXES, "float ax", "float ay", "float az"),
                *("float ref_alt", "float eph", "float epv", *(f"bool {name}" for name in _VALID)),
            ),
        ),
        _local_position,
    ),
    (Topic("vehicle_attitude", ("float[4] q",)), _attitude),
    (Topic("vehicle_angular_velocity", (_vector("xyz"),)), _angular_velocity),
    (Topic("sensor_combined", (_vector("gyro_rad"), _vector("accelerometer_m_s2"))), _sensor_combined),
    (Topic("actuator_outputs", ("uint32_t noutputs", f"float[{_OUTPUTS}] output")), _outputs),
    (Topic("actuator_motors", (f"float[{_MOTORS}] control",)), _motors),
    (Topic("vehicle_local_position_setpoint", (*_AXES, _vector("acceleration"))), _position_setpoint),
    (Topic("vehicle_attitude_setpoint", ("float[4] q_d",)), _attitude_setpoint),
    (
        Topic(
            "load_state",
            (
                *(_vector(name) for name in ("position", "velocity", "cable", "cable_rate")),
                *("float distance", "float tension", "uint32_t slack_events", "bool taut"),
            ),
        ),
        _load_state,
    ),
    (
        Topic(
            "load_setpoint",
            (
                *(_vector(name) for name in ("position", "velocity", "acceleration")),
                *(_vector(name) for name in ("position_asked", "velocity_asked", "cable")),
                *("float elapsed", "float duration"),
                *("uint16_t item", "uint8_t phase", "uint8_t control_mode"),
            ),
        ),
        _load_setpoint,
    ),
    (
        Topic(
            "cascade_errors",
            (
                *(_vector(name) for name in ("e_x", "e_v", "e_q", "e_q_dot", "e_r", "e_omega")),
                *("float psi_r", "float psi_q", "float thrust", _vector("moment")),
            ),
        ),
        _cascade_errors,
    ),
    (
        Topic("rotor_forces", ("float[4] force", "float force_min", "float force_max", "uint8_t saturated")),
        _rotor_forces,
    ),
)
SLOW: tuple[tuple[Topic, _Builder], ...] = (
    (
        Topic(
            "vehicle_status",
            ("uint8_t arming_state", "uint8_t nav_state", "uint8_t vehicle_type", "bool failsafe"),
        ),
        _status,
    ),
    (Topic("vehicle_land_detected", ("bool landed",)), _land_detected),
    (
        Topic("battery_status", ("float voltage_v", "float current_a", "float remaining", "bool connected")),
        _battery,
    ),
    (
        Topic(
            "estimator_plumbline",
            (
                *(_vector("gyro_bias"), _vector("accel_bias")),
                *("float vehicle_age", "float vehicle_rejected", "float load_age", "float load_rejected"),
            ),
        ),
        _estimator,
    ),
)


class FlightLog:
    """Makes one log for each flight. `step` at every tick, `take` whenever the shell can store."""

    def __init__(self, table: ParameterTable, release: str, boot_unix_us: int) -> None:
        self._table = table
        self._release = release
        self._boot_unix_us = boot_unix_us
        self._writer = UlogWriter(topic for topic, _ in (*FAST, *SLOW))
        self._path: Path | None = None  # of the log that is open
        self._due_us = self._slow_us = 0
        self._disarmed_us = -1  # -1: armed
        self._state: tuple[bool, int] = (False, 0)  # armed, phase: a change is logged at once
        self._chunks: list[bytes] = []
        self._waiting = 0
        self._dropped_us = -1  # since when records are dropped, -1: none are
        self._ended: LogChunk | None = None
        self._parameters: dict[str, float] = {}
        self._version = -1
        self._texts: deque[tuple[int, int, str]] = deque(maxlen=TEXTS_BEFORE)

    @property
    def path(self) -> Path | None:
        """The log that is being written."""
        return self._path

    def say(self, now_us: int, severity: int, text: str) -> None:
        """A line that the operators were told."""
        if self._path is None:
            self._texts.append((now_us, severity, text))
        else:
            self._add(ulog.text(now_us, severity, text), now_us)

    def step(
        self,
        now_us: int,
        armed: bool,
        rate_hz: float,
        taken: Callable[[], set[str]],
        make: Callable[[], Sample],
    ) -> None:
        """Begin, go on or end; `taken` tells the names in the log folder, `make` the instant if it is due."""
        if self._path is None:
            if not armed or rate_hz <= 0.0:
                return
            self._begin(now_us, taken())
        if armed:
            self._disarmed_us = -1
        elif self._disarmed_us < 0:
            self._disarmed_us = now_us
        elif now_us - self._disarmed_us >= TAIL_US:
            self.end()
            return
        if self._table.version != self._version:
            self._follow_parameters(now_us)
        if now_us >= self._due_us and rate_hz > 0.0:
            period_us = round(1e6 / rate_hz)
            self._due_us = now_us - now_us % period_us + period_us
            self._log(make(), now_us)

    def end(self) -> None:
        """Nothing more belongs to the open log."""
        if self._path is not None:
            self._ended = LogChunk(self._path, b"".join(self._chunks), True)
            self._path = None
            self._chunks.clear()
            self._waiting = 0

    def give_up(self) -> None:
        """The shell could not store: forget the open log."""
        self._path = self._ended = None
        self._chunks.clear()
        self._waiting = 0

    def take(self, least_bytes: int = 1) -> LogChunk | None:
        """What is to be stored, once it is so much or the log has ended."""
        if self._ended is not None:
            chunk, self._ended = self._ended, None
            return chunk
        if self._path is None or self._waiting < least_bytes:
            return None
        data = b"".join(self._chunks)
        self._chunks.clear()
        self._waiting = 0
        return LogChunk(self._path, data, False)

    def _begin(self, now_us: int, taken: set[str]) -> None:
        self._path = (*LOG_FOLDER, _free_name(self._boot_unix_us + now_us, taken))
        self._due_us = self._slow_us = now_us
        self._disarmed_us = self._dropped_us = -1
        table = self._table
        self._parameters, self._version = table.values(), table.version
        defaults = {
            name: default
            for name, value in self._parameters.items()
            if (default := table.describe(name).default) != value
        }
        facts: dict[str, str | int] = {
            "sys_name": "Plumbline",
            "ver_hw": "SITL",
            "ver_sw": self._release,
            "time_boot_utc_s": self._boot_unix_us // 1_000_000,
        }
        self._add(self._writer.beginning(now_us, facts, self._parameters, defaults), now_us)
        for at_us, severity, line in self._texts:
            self._add(ulog.text(at_us, severity, line), now_us)
        self._texts.clear()

    def _follow_parameters(self, now_us: int) -> None:
        values = self._table.values()
        for name, value in values.items():
            if self._parameters.get(name) != value:
                self._add(ulog.parameter(name, value), now_us)
        self._parameters, self._version = values, self._table.version

    def _log(self, sample: Sample, now_us: int) -> None:
        state = (sample.snapshot.armed, sample.snapshot.phase)
        for number, (_, build) in enumerate(FAST):
            self._record(number, build(sample), now_us)
        if now_us >= self._slow_us or state != self._state:
            self._slow_us = now_us - now_us % SLOW_US + SLOW_US
            self._state = state
            for number, (_, build) in enumerate(SLOW, start=len(FAST)):
                self._record(number, build(sample), now_us)

    def _record(self, topic: int, numbers: Numbers | None, now_us: int) -> None:
        if numbers is None:
            return
        try:
            record = self._writer.record(topic, now_us, *numbers)
        except OverflowError:  # a diverged flight has numbers that no float32 holds
            record = self._writer.record(topic, now_us, *map(_within_float32, numbers))
        self._add(record, now_us)

    def _add(self, data: bytes, now_us: int) -> None:
        dropping = self._dropped_us >= 0 and self._waiting > 0  # until the shell has taken what waits
        if dropping or self._waiting + len(data) > MOST_WAITING:
            if self._dropped_us < 0:
                self._dropped_us = now_us
            return
        if self._dropped_us >= 0:
            data = ulog.dropout((now_us - self._dropped_us) // 1000) + data
            self._dropped_us = -1
        self._chunks.append(data)
        self._waiting += len(data)


def _free_name(unix_us: int, taken: set[str]) -> str:
    """The UTC time as a file name that no log has."""
    name = stem = _utc(unix_us // 1_000_000)
    count = 0
    while name + LOG_ENDING in taken:
        count += 1
        name = f"{stem}_{count:03}"
    return name + LOG_ENDING


def _utc(unix_s: int) -> str:
    """2026-01-31_12-30-59."""
    return datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%d_%H-%M-%S")


def _within_float32(value: float) -> float:
    return min(max(value, -_FLOAT32_MAX), _FLOAT32_MAX) if isinstance(value, float) else value
