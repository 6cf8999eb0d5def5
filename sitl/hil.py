"""The simulator's end of the simulator link: datagrams in, datagrams out, no socket and no clock.

A tick: `sensor_datagram()` goes to the autopilot, `receive()` takes its answer, `advance()` moves the world.
docs/sensors.md describes the link, for connecting another autopilot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.packed import Row, packed, unpack
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.layout import PLUS, Layout
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.compiled import MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES
from autopilot.wire.convert.battery import BATTERY_PERIOD_US, BatteryReading, battery_status_message
from autopilot.wire.convert.flight import wind_state_message
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.simulator import SIMULATOR_COMPONENT, padded_forces, read_hil_actuator_controls
from autopilot.wire.convert.telemetry import gps_global_origin_message
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_table import ParameterTable
from autopilot.wire.periods import next_multiple
from autopilot.wire.simulator_frames import Answer, read_answer
from sitl.calibration import calibration
from sitl.interfaces.frame import Frame, frame_of
from sitl.messages import (
    CAMERA,
    DIALECT_COMPONENT,
    DIALECT_FRAMES,
    ENCODER,
    NO_READINGS,
    VEHICLE_SYSTEM,
    LatestReadings,
    MessageConstants,
    put_sensors,
    put_truth,
)
from sitl.parameter_server import ParameterServer
from sitl.plant.attachment import effective_mass
from sitl.plant.drive import battery_of, share_left, voltage_until_empty
from sitl.plant.records import Truth
from sitl.sensor_log import NOT_LOGGED, SensorLog
from sitl.sensors.barometer import BarometerReading
from sitl.sensors.files import load_profile
from sitl.sensors.imu import ImuReading
from sitl.sensors.overrides import with_overrides
from sitl.sensors.profile import Profile, reported_std
from sitl.settings import SECOND_US, Settings, settings_of
from sitl.sim_core import Forces, SimCore
from sitl.tick_batch import BatchBuilder, FrameBuffers, TickBatch, Writers
from sitl.vehicles.sim_parameters import apply as apply_parameters
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import truth_of
from sitl.world import rotors_of

_STATUS_PERIOD_US = 200_000  # in real time; in lockstep one a second is enough
_BOOT_PERIOD_US = SECOND_US  # of SIM_BOOT, sent with the sensors
# in real time the rotors stop when no command came for this long, as a speed controller without signal does
COMMAND_TIMEOUT_US = 500_000
MIN_SNAP_SPEED = 1e-3  # m/s, closing speed above which a cable that comes taut is reported

_DIVERGED = mavlink.MAVLink_statustext_message(
    mavlink.MAV_SEVERITY_CRITICAL, b"Simulation stopped: outside its model"
)
_FIX = {"3d": mavlink.GPS_FIX_TYPE_3D_FIX, "rtk": mavlink.GPS_FIX_TYPE_RTK_FIXED}


def _requests_reboot(message: Any) -> bool:
    if message.get_msgId() != mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
        return False
    return bool(message.command == mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN and message.param1 == 1.0)


class PacingFigures(NamedTuple):
    """The shell's measurement of its own punctuality, for SIM_STATUS; all 0 without a wall clock."""

    speed_factor: float = 0.0
    rate_hz: float = 0.0
    late_p50_us: int = 0
    late_p99_us: int = 0
    late_max_us: int = 0


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
        boot_id: int = 0,
        layout: Layout = PLUS,
        log: SensorLog | None = None,
    ) -> None:
        """`truth` as in the vehicle file; `table` holds the SIM_* parameters, which may change in flight.

        `boot_id`: unique number of this run of the world; a reboot begins the run with the next number.
        `log`: receives the sensors of each tick.
        """
        self.pacing = PacingFigures()
        self._file_truth = truth
        self._layout = layout
        self._profile = profile
        self._seed = seed
        self.parameters = ParameterServer(table)
        self._home = home
        self._lockstep = lockstep
        self._status_us = SECOND_US if lockstep else _STATUS_PERIOD_US
        self._truth_every = truth_every
        self._boot_id = boot_id
        self._log = log
        # machine code, after its first use
        self._put_sensors: Callable[..., tuple[int, int]] | None = None
        self._put_truth: Callable[..., int] | None = None
        self._answer_in: Callable[..., Answer] | None = None
        self._payload = np.zeros(MAX_PAYLOAD_BYTES, np.uint8)
        self._sensor_writer = FrameWriter(VEHICLE_SYSTEM, SIMULATOR_COMPONENT)
        self._truth_writer = FrameWriter(VEHICLE_SYSTEM, SIMULATOR_COMPONENT)
        self._dialect_writer = FrameWriter(VEHICLE_SYSTEM, DIALECT_COMPONENT)
        self._batches = BatchBuilder(Writers(self._sensor_writer, self._truth_writer, self._dialect_writer))
        # a separate sequence counter: its frames are not recorded, and the recorded ones must have no gap
        self._run_writer = FrameWriter(VEHICLE_SYSTEM, DIALECT_COMPONENT)
        self._reset()

    def _reset(self) -> None:
        """Put the world to time 0, with the parameters in force."""
        table = self.parameters.table
        settings = settings_of(table)
        truth = apply_parameters(self._file_truth, table)
        core = SimCore(truth, self._profile, settings, self._seed, self._layout)
        self.missed = 0  # ticks without an answer in time
        self.rejected = 0  # controls that were not numbers
        self.answered = False  # whether the present tick was
        self.core = core
        self._constants = self._packed_constants(settings)
        self._stopped = self._command = (0.0,) * len(self._layout)
        self._rotors = mavlink.PLUMBLINE_ROTORS_DISARMED
        self._gripper_open = False
        self._reel_rate = 0.0
        self._command_us = -1  # the tick that the last command answers
        height = BarometerReading(core.state.x_quad[2])
        self._latest = packed(NO_READINGS._replace(height=height))
        sensors, waiting, _ = core.rows.queue.shape
        # room for a frame of each reading that can be on its way, of the rotors, and HIL_SENSOR
        frames = sensors * waiting + len(self._layout) + 1
        self._buffer = np.zeros(frames * MAX_FRAME_BYTES, np.uint8)
        self._written = self._buffer.data
        if self._log is not None:
            known = calibration(
                truth, self._profile, settings, self._home, self._layout, self._seed, core.rows
            )
            self._log.begin(known, len(self._buffer))
        self._announcing_boot = False  # whether SIM_BOOT is sent at the next tick too
        self._sensors = self._sensor_frames()
        self._truth: bytes | None = None
        self._truth_made = False
        self._reported_wind = settings.wind, ZERO
        self._reboot = False  # whether one was requested
        self._snap_mass()  # compiled before the first tick, not at the first snap

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
        boot_id: int = 0,
        log: SensorLog | None = None,
    ) -> HilSimulator:
        """A simulator built from the options of the command line.

        Of `settings` those named SIM_* are used, except SIM_LOSS_PCT, which belongs to the autopilot's ground
        link. Raises ValueError with one line on what is wrong.
        """
        file = load_vehicle(vehicle)
        truth = truth_of(file)
        table = sim_parameters(truth)
        for name, value in (settings or {}).items():
            if name.startswith("SIM_") and name != "SIM_LOSS_PCT":
                table.set(name, value)
        table.freeze()
        profile, place = load_profile(sensors), home or Home()
        return cls(truth, table, profile, seed, place, lockstep, truth_every, boot_id, file.layout, log)

    @property
    def now_us(self) -> int:
        """Simulated time of the present tick."""
        return self.core.now_us

    @property
    def tick_us(self) -> int:
        """Time from tick to tick."""
        return self.core.settings.tick_us

    @property
    def diverged(self) -> bool:
        """Whether the plant has left the domain of its model and stands still."""
        return self.core.state.diverged > 0.0

    def sensor_datagram(self) -> bytes:
        """The readings that arrive at this tick, HIL_SENSOR last; the same bytes until `advance`."""
        return self._sensors

    def truth_datagram(self) -> bytes | None:
        """Truth telemetry of this tick; None on the ticks between. Made when first requested."""
        if not self._truth_made:
            self._truth = self._truth_frames()
            self._truth_made = True
        return self._truth

    def run_datagram(self) -> bytes | None:
        """SIM_BOOT, which states to which run the truth belongs; None on ticks at which it is not due."""
        due = self.core.now_us % self._status_us == 0
        return self._run_writer.frame(self._boot()) if due else None

    def has_heartbeat(self, datagram: bytes) -> bool:
        """Whether the datagram holds a HEARTBEAT of the vehicle's autopilot, which asks to be served."""
        return any(
            one.system == VEHICLE_SYSTEM and one.message.get_msgId() == mavlink.MAVLINK_MSG_ID_HEARTBEAT
            for one in decode(datagram)[0]
        )

    def announce_boot(self) -> None:
        """Send SIM_BOOT, the number of this run of the world, with the sensors of this tick and the next."""
        if not self._announcing_boot:
            self._announcing_boot = True
            frames = map(self._sensor_writer.frame, self._identity())
            self._sensors = b"".join(frames) + self._sensors

    def receive(self, datagram: bytes) -> bool:
        """Take the command out of a datagram; True if the present tick is answered now.

        With an answer PARAM_REQUEST_LIST, PARAM_SET and a command to reboot are obeyed; anything else in a
        datagram is ignored: other messages, systems and ticks, noise.
        In real time a late command is still the newest one, and is used.
        """
        if self._answer_in is None:
            self._answer_in = entry_point_of(read_answer, datagram, VEHICLE_SYSTEM, self._payload)
        answer = self._answer_in(datagram, VEHICLE_SYSTEM, self._payload)
        if answer[0]:
            self._apply_answer(*answer[1:])
            return self.answered
        answered_before = self.answered
        others = []
        for one in decode(datagram)[0]:
            if one.system != VEHICLE_SYSTEM:
                continue
            if one.message.get_msgId() == mavlink.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS:
                controls = read_hil_actuator_controls(one.message)
                self._apply_answer(
                    controls.time_us,
                    controls.forces,
                    controls.armed,
                    controls.gripper_open,
                    controls.reel_rate,
                )
            else:
                others.append(one.message)
        if self.answered and not answered_before:  # a repeated datagram changes nothing
            for message in others:
                if _requests_reboot(message):
                    self._reboot = True
                if self.parameters.receive(message):
                    self._retune()
        return self.answered

    def _apply_answer(
        self, time_us: int, forces: Forces, armed: bool, gripper_open: bool, reel_rate: float
    ) -> None:
        """Take an answer if it is that to this tick or, in real time, the newest to an earlier tick."""
        now_us = self.core.now_us
        if time_us == now_us:
            if self.answered:
                return
            self.answered = True
        elif self._lockstep or not self._command_us < time_us < now_us:
            return
        if not isfinite(sum(forces)):
            self.rejected += 1
        else:
            self._command = forces[: len(self._layout)] if armed else self._stopped
            following, disarmed = mavlink.PLUMBLINE_ROTORS_OBEYING, mavlink.PLUMBLINE_ROTORS_DISARMED
            self._rotors = following if armed else disarmed
        self._gripper_open = gripper_open
        self._reel_rate = reel_rate
        self._command_us = time_us

    def apply_command(self, forces: Forces, armed: bool, gripper_open: bool = False) -> None:
        """Take the answer to the present tick from an autopilot whose messages `receive` does not read."""
        self._apply_answer(self.core.now_us, forces, armed, gripper_open, 0.0)

    @property
    def imu_reading(self) -> ImuReading:
        """The last reading of the inertial unit, body FLU."""
        return unpack(LatestReadings, self._latest, 0).inertial

    @property
    def has_navigation_sensors(self) -> bool:
        """Whether it has the sensors for outdoor navigation: GNSS, barometer and magnetometer."""
        profile = self._profile
        return None not in (profile.gnss, profile.barometer, profile.magnetometer)

    @property
    def home(self) -> Home:
        """Where on the earth the origin of the world is."""
        return self._home

    @property
    def frame(self) -> Frame:
        """The vehicle as third-party firmwares define it; FrameError if they cannot fly it."""
        return frame_of(self._layout, self.core.truth.rotor_min, self.core.truth.rotor_max)

    def restart(self) -> None:
        """Put the world to time 0 again, with the parameters in force: another run."""
        self._boot_id += 1
        self._reset()

    def _retune(self) -> None:
        """Apply a changed parameter."""
        table = self.parameters.table
        if table["SIM_GUST_NOW"] > 0.0:
            # not at this tick, whose truth may have been sent already
            self.parameters.set_and_report("SIM_GUST_AT_S", (self.core.now_us + self.tick_us) / SECOND_US)
            self.parameters.set_and_report("SIM_GUST_NOW", 0.0)
        settings = settings_of(table)
        self.core.retune(apply_parameters(self._file_truth, table), settings)
        self._constants = self._packed_constants(settings)

    def _packed_constants(self, settings: Settings) -> Row:
        profile = with_overrides(self._profile, settings.overrides)
        gnss, cable = profile.gnss, profile.cable_sensor
        return packed(
            MessageConstants(
                reported_std(profile, settings.noise_scale),
                self._home,
                _FIX[gnss.fix] if gnss else 0,
                gnss.satellites if gnss else 0,
                ENCODER if cable is not None and cable.kind == "encoder" else CAMERA,
            )
        )

    def advance(self) -> None:
        """Move the world to the next tick under the last command, or to its beginning if so requested."""
        if self._reboot:
            self.restart()
            return
        if not self._lockstep:
            if not self.answered:
                self.missed += 1
            if self.core.now_us - self._command_us > COMMAND_TIMEOUT_US:
                self._command = self._stopped
                if self._rotors == mavlink.PLUMBLINE_ROTORS_OBEYING:
                    self._rotors = mavlink.PLUMBLINE_ROTORS_UNHEARD
        self.answered = False
        self.core.tick(self._command, self._gripper_open, self._reel_rate)
        self._sensors = self._sensor_frames()
        self._truth_made = False

    def tick_batch(self) -> TickBatch | None:
        """The data with which, and the time until which, machine code can move the world on without Python
        from this tick, whose sensors and truth are sent. None if it cannot, for example because this tick is
        answered already or more must be sent.
        """
        core = self.core
        now_us, tick_us = core.now_us, core.settings.tick_us
        if (
            not self._lockstep
            or self._reboot
            or self._announcing_boot
            or self.answered
            or self.parameters.has_messages
        ):
            return None
        until_us = self._next_message_us
        if until_us <= now_us + tick_us:
            return None
        times = (now_us, core.tick_count, tick_us, until_us, self._truth_every)
        buffers = FrameBuffers(self._latest, self._constants, self._buffer, self._payload)
        log = NOT_LOGGED if self._log is None else self._log.rows
        return self._batches.next_batch(times, core.rows, core.chain, buffers, log)

    @property
    def _next_message_us(self) -> int:
        """Time of the next tick at which more than sensors and truth must be sent in any case."""
        core, now_us = self.core, self.core.now_us
        periods_us = [self._status_us, _BOOT_PERIOD_US]
        if core.truth.drive.battery > 0.0:
            periods_us.append(BATTERY_PERIOD_US)
        return min(core.pulse_changes_us, *(next_multiple(now_us, each_us) for each_us in periods_us))

    def finish_batch(self, sensors_sent: bool) -> None:
        """Take over the state to which machine code has moved the world. `sensors_sent`: the sensors of the
        present tick are in the buffer and its truth is sent; otherwise both are still to be made."""
        result = self._batches.result()
        if result is None:
            return
        if self._log is not None:
            self._log.flush()
        self._command_us = result.now_us - self.core.settings.tick_us
        self.core.set_tick(result.now_us, result.ticks)
        self._command = tuple(result.forces[: len(self._layout)]) if result.armed else self._stopped
        self._rotors = mavlink.PLUMBLINE_ROTORS_OBEYING if result.armed else mavlink.PLUMBLINE_ROTORS_DISARMED
        self._gripper_open, self._reel_rate = result.gripper_open, result.reel_rate
        self.answered = False
        if sensors_sent:
            self._sensors = self._written[: result.sensor_bytes].tobytes()
            self._truth, self._truth_made = None, True  # it has been sent
        else:
            self._sensors = self._sensor_frames()
            self._truth_made = False

    def _sensor_frames(self) -> bytes:
        writer, core = self._sensor_writer, self.core
        messages = self.parameters.pop_messages()
        if self._announcing_boot or core.now_us % _BOOT_PERIOD_US == 0:
            self._announcing_boot = False
            messages += self._identity()
        if core.truth.drive.battery > 0.0 and core.now_us % BATTERY_PERIOD_US == 0:
            messages.append(self._battery())
        if not self._lockstep and core.now_us % SECOND_US == 0:  # for the autopilot: how punctual the run is
            messages.append(self._status())
        message_frames = b"".join(map(writer.frame, messages)) if messages else b""
        buffers = (self._buffer, self._payload)
        arguments = (core.rows, core.now_us, self._latest, self._constants, *buffers, writer.sequence)
        if self._put_sensors is None:
            self._put_sensors = entry_point_of(put_sensors, *arguments)
        length, writer.sequence = self._put_sensors(*arguments)
        frames = self._written[:length].tobytes()
        if self._log is not None:
            self._log.put(core.rows, self._buffer, length)
        return message_frames + frames if message_frames else frames

    def _truth_frames(self) -> bytes | None:
        core = self.core
        due = core.tick_count % self._truth_every == 0
        status_due = core.now_us % self._status_us == 0
        wind_due = status_due or self._wind != self._reported_wind
        snapped = core.snap_speed > MIN_SNAP_SPEED
        if not (due or wind_due or snapped):
            return None
        writer, dialect, datagram = self._truth_writer, self._dialect_writer, b""
        if due:
            buffers = (self._buffer, self._payload)
            rows = (core.rows.world, core.rows.model, rotors_of(core.rows), self._constants)
            if self._put_truth is None:
                self._put_truth = entry_point_of(
                    put_truth, *rows, *buffers, writer.sequence, dialect.sequence
                )
            length = self._put_truth(*rows, *buffers, writer.sequence, dialect.sequence)
            writer.sequence = (writer.sequence + 1) & 0xFF
            dialect.sequence = (dialect.sequence + DIALECT_FRAMES) & 0xFF
            datagram = self._written[:length].tobytes()
        if wind_due or snapped:
            datagram += b"".join(map(dialect.frame, self._events(wind_due, snapped, status_due)))
            if status_due and self.diverged:
                datagram += writer.frame(_DIVERGED)
        return datagram

    @property
    def _wind(self) -> tuple[Vec3, Vec3]:
        """Mean wind and gust pulse."""
        return self.core.settings.wind, self.core.pulse

    def _events(self, wind_due: bool, snapped: bool, status_due: bool) -> list[Any]:
        """The messages that are sent besides the state when they are due."""
        core, now_us = self.core, self.core.now_us
        messages: list[Any] = []
        if wind_due:
            self._reported_wind = self._wind
            messages.append(wind_state_message(now_us, *self._reported_wind))
        if snapped:
            speed = core.snap_speed
            messages.append(mavlink.MAVLink_cable_snap_message(now_us, speed, self._snap_mass() * speed))
        if status_due:
            messages.append(self._status())
        return messages

    def _identity(self) -> list[Any]:
        """SIM_BOOT and, if a receiver measures positions on the earth, GPS_GLOBAL_ORIGIN."""
        if self._profile.gnss is None:
            return [self._boot()]
        return [self._boot(), gps_global_origin_message(self.core.now_us, self._home)]

    def _boot(self) -> Any:
        """SIM_BOOT: which run of the world this is, and the state that an autopilot finds that starts now."""
        core = self.core
        reeled_m = core.cable_length - core.truth.cable_length
        forces = padded_forces(self._command)
        return mavlink.MAVLink_sim_boot_message(
            core.now_us,
            self._boot_id,
            forces[:4],
            reeled_m,
            self._rotors,
            int(core.released),
            forces[4:],
        )

    def _snap_mass(self) -> float:
        """The effective mass of vehicle and load along a cable that comes taut now, kg."""
        state = self.core.state
        return effective_mass(state.q_cable, rotation_from_quat(state.quat_wxyz), self.core.truth)

    def _battery(self) -> Any:
        """BATTERY_STATUS, as a power module measures it."""
        drive, supply = self.core.truth.drive, self.core.world.supply
        voltage = supply.voltage
        if not self.core.tick_count:
            battery = battery_of(self.core.truth, len(self.core.rotor_force))
            voltage = voltage_until_empty(drive.capacity_as * (1.0 - drive.charge), battery)
        return battery_status_message(
            BatteryReading(voltage, supply.current, supply.used_as / 3.6, share_left(supply, drive))
        )

    def _status(self) -> object:
        pacing, state = self.pacing, self.core.state
        return mavlink.MAVLink_sim_status_message(
            self.core.now_us,
            pacing.speed_factor,
            pacing.rate_hz,
            pacing.late_p50_us,
            pacing.late_p99_us,
            pacing.late_max_us,
            self.missed,
            int(state.vehicle_on_ground),
            int(state.load_on_ground),
        )
