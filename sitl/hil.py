"""The simulator's end of the simulator link: datagrams in, datagrams out, no socket and no clock.

A tick: `sensor_datagram()` goes to the autopilot, `receive()` takes its answer, `advance()` moves the world.
docs/sensors.md describes the link for those who connect an autopilot of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, nan
from typing import Any, NamedTuple

from autopilot.geometry.linear import Vec3, apply_transposed, norm, sub
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.wire import convert
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_table import ParameterTable
from sitl.parameter_server import ParameterServer
from sitl.plant.records import Rotors, Truth
from sitl.sensors.files import load_profile
from sitl.sensors.imu import ImuReading
from sitl.sensors.profile import Profile, stated_of
from sitl.sim_core import SECOND_US, STOPPED, Readings, SimCore, settings_of
from sitl.vehicles.sim_parameters import apply as apply_parameters
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth

VEHICLE_SYSTEM = 1
SIMULATOR_COMPONENT = 26
STATUS_PERIOD_US = 200_000
# in real time the rotors stop when no command came for this long, as a speed controller without signal does
COMMAND_TIMEOUT_US = 500_000
LEAST_SNAP = 1e-3  # m/s, closing speed from which a cable that comes taut is told of

_ZERO: Vec3 = (0.0, 0.0, 0.0)
_DIVERGED = mavlink.MAVLink_statustext_message(
    mavlink.MAV_SEVERITY_CRITICAL, b"Simulation stopped: outside its model"
)
_TRACKER, _CAMERA, _ENCODER = 0, 1, 2  # LOAD_SENSOR.sensor_id
_FIX = {"3d": mavlink.GPS_FIX_TYPE_3D_FIX, "rtk": mavlink.GPS_FIX_TYPE_RTK_FIXED}


def _asks_reboot(message: Any) -> bool:
    if message.get_msgId() != mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
        return False
    return bool(message.command == mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN and message.param1 == 1.0)


class PacingFigures(NamedTuple):
    """What the shell measured of its own timeliness, for SIM_STATUS; all 0 in lockstep."""

    speed_factor: float = 0.0
    rate_hz: float = 0.0
    late_p50_us: int = 0
    late_p99_us: int = 0
    late_max_us: int = 0


def _measured(v: Vec3) -> Vec3 | None:
    """A vector, or None if the sensor does not measure it (nan)."""
    return v if v[0] == v[0] else None


def pressure_pa(altitude_m: float) -> float:
    """International standard atmosphere below 11 km; altitude above mean sea level."""
    return float(101_325.0 * max(1.0 - 2.25577e-5 * altitude_m, 0.0) ** 5.25588)


class HilSimulator:
    """The simulated vehicle on the simulator link. Same arguments and datagrams in: same datagrams out."""

    def __init__(
        self,
        truth: Truth,
        table: ParameterTable,
        profile: Profile,
        seed: int,
        home: Home,
        lockstep: bool,
        truth_every: int = 2,
    ) -> None:
        """`truth` as its file has it; `table` holds the SIM_* parameters, which may change in flight."""
        self.pacing = PacingFigures()
        self._file_truth = truth
        self._profile = profile
        self._seed = seed
        self._parameters = ParameterServer(table)
        self._home = home
        self._lockstep = lockstep
        self._truth_every = truth_every
        self._fix = _FIX[profile.gnss.fix] if profile.gnss else 0
        self._satellites = profile.gnss.satellites if profile.gnss else 0
        encoder = profile.cable_sensor is not None and profile.cable_sensor.kind == "encoder"
        self._cable_id = _ENCODER if encoder else _CAMERA
        self._sensor_writer = FrameWriter(VEHICLE_SYSTEM, SIMULATOR_COMPONENT)
        self._truth_writer = FrameWriter(VEHICLE_SYSTEM, SIMULATOR_COMPONENT)
        self._begin()

    def _begin(self) -> None:
        """The world at time 0, with the parameters in force."""
        table = self._parameters.table
        settings = settings_of(table)
        core = SimCore(apply_parameters(self._file_truth, table), self._profile, settings, self._seed)
        self.missed = 0  # ticks without an answer in time
        self.rejected = 0  # controls that were not numbers
        self.answered = False  # the present tick was
        self._core = core
        self._stated = stated_of(self._profile, settings.noise_scale)
        self._command: Rotors = STOPPED
        self._gripper_open = False
        self._reel_rate = 0.0
        self._command_us = -1  # the tick that the last command answers
        self._inertial = ImuReading(_ZERO, _ZERO)
        self._field = _ZERO
        self._height = core.state.x_quad[2]
        self._sensors = self._sensor_frames(core.readings)
        self._truth: bytes | None = None
        self._truth_made = False
        self._gust_told = _ZERO
        self._reboot = False  # asked for

    @classmethod
    def build(
        cls,
        vehicle: str = "bebop",
        sensors: str = "lab",
        seed: int = 1,
        settings: Mapping[str, float] | None = None,
        home: Home | None = None,
        lockstep: bool = True,
        truth_every: int = 2,
    ) -> HilSimulator:
        """From the command line's options.

        Of `settings` the SIM_* are taken, but for SIM_LOSS_PCT, which belongs to the autopilot's ground link.
        Raises ValueError with one line on what is wrong.
        """
        truth = load_truth(vehicle)
        table = sim_parameters(truth)
        for name, value in (settings or {}).items():
            if name.startswith("SIM_") and name != "SIM_LOSS_PCT":
                table.set(name, value)
        table.freeze()
        return cls(truth, table, load_profile(sensors), seed, home or Home(), lockstep, truth_every)

    @property
    def now_us(self) -> int:
        """Simulated time of the present tick."""
        return self._core.now_us

    @property
    def tick_us(self) -> int:
        """Time from tick to tick."""
        return self._core.settings.tick_us

    @property
    def diverged(self) -> bool:
        """The plant left the domain of its model and stands still."""
        return self._core.state.diverged > 0.0

    def sensor_datagram(self) -> bytes:
        """What the sensors give at this tick, HIL_SENSOR last; the same bytes until `advance`."""
        return self._sensors

    def truth_datagram(self) -> bytes | None:
        """Truth telemetry of this tick; None on the ticks between. Made when first asked for."""
        if not self._truth_made:
            self._truth = self._truth_frames()
            self._truth_made = True
        return self._truth

    def greets(self, datagram: bytes) -> bool:
        """Is this a HEARTBEAT of the vehicle's autopilot? It asks to be served, from wherever it came."""
        return any(
            one.system == VEHICLE_SYSTEM and one.message.get_msgId() == mavlink.MAVLINK_MSG_ID_HEARTBEAT
            for one in decode(datagram)[0]
        )

    def receive(self, datagram: bytes) -> bool:
        """Take the command out of a datagram; True if the present tick has its answer now.

        Beside the answer PARAM_REQUEST_LIST and PARAM_SET are heeded; whatever else a datagram may hold is
        ignored: other messages, systems and ticks, rubbish.
        In real time a late command is still the newest one, and is used.
        """
        was_answered = self.answered
        aside = []
        for one in decode(datagram)[0]:
            if one.system != VEHICLE_SYSTEM:
                continue
            if one.message.get_msgId() != mavlink.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS:
                aside.append(one.message)
                continue
            answer = convert.read_hil_actuator_controls(one.message)
            current = answer.time_us == self._core.now_us
            if not current and (self._lockstep or not self._command_us < answer.time_us < self._core.now_us):
                continue
            if current and self.answered:
                continue
            if all(map(isfinite, answer.forces)):
                self._command = answer.forces if answer.armed else STOPPED
            else:
                self.rejected += 1
            self._gripper_open = answer.gripper_open
            self._reel_rate = answer.reel_rate
            self._command_us = answer.time_us
            self.answered = self.answered or current
        if self.answered and not was_answered:  # a repeated datagram changes nothing
            for message in aside:
                if _asks_reboot(message):
                    self._reboot = True
                if self._parameters.receive(message):
                    self._retune()
        return self.answered

    def _retune(self) -> None:
        """A parameter has changed."""
        table = self._parameters.table
        if table["SIM_GUST_NOW"] > 0.0:
            # the truth of this tick may be told already
            self._parameters.tell("SIM_GUST_AT_S", (self._core.now_us + self.tick_us) / SECOND_US)
            self._parameters.tell("SIM_GUST_NOW", 0.0)
        settings = settings_of(table)
        self._core.retune(apply_parameters(self._file_truth, table), settings)
        self._stated = stated_of(self._profile, settings.noise_scale)

    def advance(self) -> None:
        """Move the world to the next tick under the last command, or back to its beginning if so asked."""
        if self._reboot:
            self._begin()
            return
        if not self._lockstep:
            if not self.answered:
                self.missed += 1
            if self._core.now_us - self._command_us > COMMAND_TIMEOUT_US:
                self._command = STOPPED
        self.answered = False
        self._sensors = self._sensor_frames(
            self._core.tick(self._command, self._gripper_open, self._reel_rate)
        )
        self._truth_made = False

    def _sensor_frames(self, readings: Readings) -> bytes:
        frame = self._sensor_writer.frame
        stated = self._stated
        frames = [frame(message) for message in self._parameters.take()]
        for time_us, pose in readings.mocap:
            message = convert.odometry_message(
                time_us,
                pose.position,
                pose.quat_wxyz,
                _measured(pose.velocity),
                _measured(pose.omega_body),
                stated.mocap_position,
                stated.mocap_attitude,
                stated.mocap_velocity,
            )
            frames.append(frame(message))
        for time_us, load in readings.load_tracker:
            velocity = _measured(load.velocity)
            velocity_std = nan if velocity is None else stated.load_velocity
            message = convert.load_sensor_message(
                time_us, load.position, velocity, None, stated.load_position, velocity_std, nan, _TRACKER
            )
            frames.append(frame(message))
        for time_us, cable in readings.cable_sensor:
            if cable.seen > 0.0:
                message = convert.load_sensor_message(
                    time_us, None, None, cable.direction_body, nan, nan, stated.direction, self._cable_id
                )
                frames.append(frame(message))
        for time_us, fix in readings.gnss:
            message = convert.hil_gps_message(
                time_us,
                self._fix,
                fix.position,
                fix.velocity,
                stated.gnss_horizontal,
                stated.gnss_vertical,
                self._satellites,
                home=self._home,
            )
            frames.append(frame(message))
        frames.append(frame(self._hil_sensor(readings)))
        return b"".join(frames)

    def _hil_sensor(self, readings: Readings) -> object:
        """HIL_SENSOR: what is not new keeps its last value, without its bits in fields_updated."""
        fields = 0
        if readings.imu:
            self._inertial = readings.imu[-1].reading
            fields |= convert.ACCEL | convert.GYRO
        if readings.magnetometer:
            self._field = readings.magnetometer[-1].reading.field_body
            fields |= convert.MAG
        if readings.barometer:
            self._height = readings.barometer[-1].reading.height
            fields |= convert.PRESSURE | convert.TEMPERATURE
        altitude = self._home.altitude_m + self._height
        return convert.hil_sensor_message(
            self._core.now_us,
            self._inertial.accel_body,
            self._inertial.gyro_body,
            self._field,
            pressure_pa(altitude),
            altitude,
            15.0 - 0.0065 * altitude,
            fields,
        )

    def _truth_frames(self) -> bytes | None:
        core = self._core
        due = core.tick_count % self._truth_every == 0
        status_due = core.now_us % STATUS_PERIOD_US == 0
        wind_due = status_due or core.pulse != self._gust_told
        snapped = core.snap_speed > LEAST_SNAP
        if not (due or wind_due or snapped):
            return None
        frame = self._truth_writer.frame
        frames = []
        now_us, state, truth = core.now_us, core.state, core.truth
        if due:
            a = state.accel_quad
            force = apply_transposed(rotation_from_quat(state.quat_wxyz), (a[0], a[1], a[2] + truth.gravity))
            vehicle = convert.hil_state_quaternion_message(
                now_us,
                state.quat_wxyz,
                state.omega_body,
                state.x_quad,
                state.v_quad,
                norm(sub(state.v_quad, core.wind)),
                force,
                home=self._home,
            )
            load = convert.load_state_message(
                now_us,
                mavlink.PLUMBLINE_SOURCE_TRUTH,
                state.x_load,
                state.v_load,
                state.q_cable,
                state.q_cable_dot,
                norm(sub(state.x_load, state.x_quad)),
                state.tension,
                state.taut > 0.0,
                int(state.slack_events),
            )
            low, high = truth.rotor_min, truth.rotor_max
            cut = sum(1 << i for i, f in enumerate(core.command) if not low <= f <= high)
            rotors = convert.rotor_state_message(
                now_us, mavlink.PLUMBLINE_SOURCE_TRUTH, state.rotor_force, low, high, cut
            )
            frames = [frame(vehicle), frame(load), frame(rotors)]
        if wind_due:
            self._gust_told = core.pulse
            frames.append(frame(convert.wind_state_message(now_us, core.settings.wind, core.pulse)))
        if snapped:
            reduced_mass = truth.quad_mass * truth.load_mass / (truth.quad_mass + truth.load_mass)
            snap = mavlink.MAVLink_cable_snap_message(now_us, core.snap_speed, reduced_mass * core.snap_speed)
            frames.append(frame(snap))
        if status_due:
            frames.append(frame(self._status()))
            if self.diverged:
                frames.append(frame(_DIVERGED))
        return b"".join(frames)

    def _status(self) -> object:
        pacing, state = self.pacing, self._core.state
        return mavlink.MAVLink_sim_status_message(
            self._core.now_us,
            pacing.speed_factor,
            pacing.rate_hz,
            pacing.late_p50_us,
            pacing.late_p99_us,
            pacing.late_max_us,
            self.missed,
            int(state.vehicle_on_ground),
            int(state.load_on_ground),
        )
