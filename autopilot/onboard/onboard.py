"""The whole autopilot without its sockets: datagrams in, datagrams out.

The simulator link drives it: each new tick of sensors runs the flight core once. Messages of ground stations
wait until the shell hands them over between two ticks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from autopilot.control.believed import (
    believed_actuation,
    believed_drag,
    believed_factor_share,
    believed_observer,
    believed_rotor_watch,
    believed_vehicle,
)
from autopilot.control.laws import build_law, chosen_law, is_own
from autopilot.core.flight_core import (
    SETPOINTS_LOCKSTEP,
    SETPOINTS_PER_CALL,
    FlightCore,
    Setup,
    commanded_rate,
)
from autopilot.core.health import Condition, battery_constants, low_battery_text
from autopilot.core.sensor_inbox import INERTIAL, SensorInbox, Tick
from autopilot.core.warmup import warm_up
from autopilot.estimation.filter import estimator_tuning
from autopilot.estimation.records import ImuReading
from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.linear import ZERO, Vec3, norm
from autopilot.geometry.packed import pack, packed, unpack
from autopilot.onboard.fall_watch import FallWatch
from autopilot.onboard.flight_log import FlightLog, LogChunk
from autopilot.onboard.ground_watch import BACK_TEXT, LOST_TEXT, GroundWatch
from autopilot.onboard.log_topics import Sample
from autopilot.onboard.packet_loss import LOSS_PARAMETER, PacketLoss
from autopilot.onboard.path_work import (
    PathWork,
    begin_now,
    later_path_work,
    path_work,
    use_later_paths,
    use_paths,
)
from autopilot.onboard.punctuality import Punctuality
from autopilot.onboard.simulator_parameters import FAILING_ROTORS, SimulatorParameters
from autopilot.onboard.snapshot import (
    BATTERY_TIMEOUT_US,
    CoreSnapshot,
    MeasuredBattery,
    Options,
    SnapshotSource,
    sensor_bits,
)
from autopilot.onboard.tick_answer import answer_tick
from autopilot.onboard.tick_batch import NO_TIMESYNC_REQUESTS, BatchBuilder, TickBatch, TimesyncRequests
from autopilot.onboard.warmup import warm_up_answer, warm_up_telemetry
from autopilot.own.own_code import NO_OWN_CODE, OwnCode, OwnSetup
from autopilot.own.planning import plan_function_for
from autopilot.services.endpoint import VehicleEndpoint
from autopilot.services.files import LOG_FOLDER, Card, FileError
from autopilot.services.heartbeat import heartbeat_message
from autopilot.services.identity import AUTOPILOT_COMPONENT, Identity
from autopilot.services.mission_store import StoredMission
from autopilot.services.records import (
    AreasChanged,
    Event,
    Link,
    MissionChanged,
    ParameterChanged,
    SimulatorParameterRequested,
    SimulatorParametersSaved,
    Verdict,
)
from autopilot.services.requests import (
    MOTION_REQUESTS,
    ChangeSigningKey,
    ChangeVehicle,
    InjectFailure,
    Reboot,
    ResetParameters,
    SetHome,
    StartMission,
    Takeoff,
)
from autopilot.services.streams import NEVER_US
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.recovery import RestartState
from autopilot.supervisor.requests.mission_checks import (
    curve_exit_problem,
    forbidden_rally_text,
    remaining_timeline,
)
from autopilot.supervisor.settings import settings_from
from autopilot.supervisor.state import (
    UNARMED,
    Fall,
    MissionPlan,
    Phase,
    Report,
    interrupt_mission,
    with_battery,
)
from autopilot.supervisor.watches.battery import due_event
from autopilot.trajectory.prepare import AT_HOME, PENDING, PathLimits, PreparedPaths, prepare
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.vehicle.rates import RateError, control_divider
from autopilot.wire.codec import FrameWriter, layout_of
from autopilot.wire.command_names import command_name
from autopilot.wire.compiled import MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES
from autopilot.wire.convert.battery import NO_READING, BatteryReading, read_battery_status
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.convert.simulator import SIMULATOR_COMPONENT
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, endless_loops, read_items, unflown_items
from autopilot.wire.periods import next_multiple
from autopilot.wire.signing import Signing
from autopilot.wire.statustext import TextReader, listed
from missions.model import Land, ReturnHome, Signals, Term, Waypoint

GROUND_WINDOW_US = 20_000  # in lockstep: time between two turns of the ground station
SIMULATOR_SYSTEM = 1  # our system id on the simulator link, whatever MAV_SYS_ID ground stations see
# asks whether the ground has caught up: separate, since no log has its messages and gaps would be noticed
LOCKSTEP_COMPONENT = mavlink.MAV_COMP_ID_SYSTEM_CONTROL
_TIMESYNC = layout_of(mavlink.MAVLink_timesync_message)
_REBOOT = mavlink.MAVLink_command_long_message(
    1, SIMULATOR_COMPONENT, mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
)
MAX_LEAP_US = 5_000_000  # a single tick that lies farther ahead is rejected
MIN_GAP_US = 500_000  # time without a tick after which a vehicle in the air has long been out of control
RATE_TICKS = 1  # ticks in which the tick rate is determined
# ticks in a row in the past or far ahead, after which the clock is assumed to have changed
CLOCK_CHANGE_TICKS = 3
_MAX_NAMED_COMMANDS = 3  # in one text
_SIMULATOR, _GROUND_STATION = "simulator", "ground station"  # sources of reasons that prevent arming
HOME_TOLERANCE_M = 1.0  # between the homes of simulator and autopilot: digits may have been left out
MIN_THRUST_SHARE = 0.3  # share of the vehicle's weight: rotors commanded to less did not carry it


class SetupWork(NamedTuple):
    """Work for another process, as `PathWork`: what is derived from the parameters, mainly the law's
    gains."""

    parameters: AutopilotParameters
    control_every: int
    own: OwnCode = NO_OWN_CODE  # user code, by its names

    def run(self) -> Setup:
        """The result; takes up to half a second."""
        return build_setup(self.parameters, self.control_every, self.own)

    def failure(self, why: str) -> None:
        """The result if the work failed: none."""


class WarmupWork(NamedTuple):
    """Work whose result is not used, with which a process loads what real work needs."""

    paths: PathWork
    setup: SetupWork

    def run(self) -> None:
        """Do it."""
        self.paths.run()
        self.setup.run()


def build_setup(table: AutopilotParameters, control_every: int, own: OwnCode = NO_OWN_CODE) -> Setup:
    """The setup of the flight core from the parameters and the number of ticks between two runs of the law;
    `own` names user code, of which the law flies if CTL_LAW selects it."""
    kind, law, vehicle = chosen_law(table), build_law(table), believed_vehicle(table)
    return Setup(
        vehicle=vehicle,
        limited=table["VEH_ROTOR_LIM"],
        law=law,
        actuation=believed_actuation(table),
        observer=believed_observer(table, vehicle),
        drag=believed_drag(table),
        tuning=estimator_tuning(table),
        settings=settings_from(table, kind.ramp_lag_s(law), kind.supports_reeling, kind.follows_shaped),
        control_every=control_every,
        own=OwnSetup(own.law, table.values()) if is_own(law) else None,
        estimator=OwnSetup(own.estimator, table.values()) if own.estimator else None,
        planner=OwnSetup(own.planner, table.values()) if own.planner else None,
        layout=table.layout,
        rotor_watch=believed_rotor_watch(table),
        factor_share=believed_factor_share(table),
    )


def _named_items(items: Sequence[WireItem], numbers: Sequence[int]) -> str:
    """The first commands of these items, each with the numbers of its items."""
    by_command: dict[int, list[int]] = {}
    for number in numbers:
        by_command.setdefault(items[number].command, []).append(number)
    named = [
        f"{command_name(command)} (item{'s' if len(found) > 1 else ''} {listed(found)})"
        for command, found in by_command.items()
    ]
    return ", ".join([*named[:_MAX_NAMED_COMMANDS], *["..."] * (len(named) > _MAX_NAMED_COMMANDS)])


def mission_plan(
    mission: StoredMission,
    home: Home,
    limits: PathLimits | None,
    return_to: Vec3 = ZERO,
    planner: OwnSetup | None = None,
) -> MissionPlan:
    """The steps of a mission as it was uploaded, prepared for a vehicle with these limits; limits None: not
    prepared yet. A return leads to `return_to`; `planner` is a custom planner."""
    steps, visits = read_items(mission.items, home, return_to)
    flown, sequence = tuple(s.step for s in steps), tuple(s.last for s in steps)
    loops = endless_loops(steps)
    prepared = PENDING
    if limits is not None:
        planned = plan_function_for(planner)
        prepared = prepare(flown, sequence, limits, return_to, planned, loop_ends=loops)
    aims = tuple(s.aims for s in steps)
    return MissionPlan(flown, sequence, len(mission.items), prepared, aims, loops, visits)


def home_problems(origin: Any, home: Home) -> tuple[str, ...]:
    """Why the vehicle must not be armed, from the simulator's GPS_GLOBAL_ORIGIN and our own home; empty: no
    reason. With different homes a receiver places the vehicle where it is not."""
    distance_m = norm(enu_from_geodetic(origin.latitude, origin.longitude, origin.altitude, home))
    if distance_m <= HOME_TOLERANCE_M:
        return ()
    return (f"the home of sitl is {distance_m:.0f} m from that of autopilot: give both the same --home",)


class Onboard:
    """One autopilot. Its clock advances in `receive_sensors`, and in the ticks that machine code flies
    (`finish_batch`, `complete`)."""

    def __init__(
        self,
        parameters: AutopilotParameters,
        identity: Identity,
        options: Options,
        mission: StoredMission | None,
        card: Card | None = None,
        signing: Signing | None = None,
    ) -> None:
        self.parameters = parameters
        self.endpoint = VehicleEndpoint(
            identity,
            options.home,
            parameters,
            mission,
            card,
            signing,
            options.boot_unix_us,
            options.setup_signing,
        )
        self.now_us = 0
        self.tick = -1
        self.fault = ""  # the reason if the vehicle cannot be flown at all
        self._options = options
        self._writer = FrameWriter(SIMULATOR_SYSTEM, AUTOPILOT_COMPONENT)
        self._answer = b""
        self._imu_sane = False  # the inertial sample of this tick is sane
        self._health = packed(Condition())
        self._battery_row = packed(battery_constants(parameters))
        self._frame = np.zeros(MAX_FRAME_BYTES, np.uint8)
        self._frame_view = self._frame.data
        self._payload = np.zeros(MAX_PAYLOAD_BYTES, np.uint8)
        # machine code, after the first call
        self._put: Callable[..., tuple[int, bool]] | None = None
        self._shortest_us = 0  # shortest time between two ticks so far
        self._version = parameters.version
        self.bad_time_ticks = 0  # ticks in a row that lay in the past or far ahead
        self.restarted = False  # the simulator has restarted; this autopilot is of no use any more
        self._simulator_texts = TextReader()
        self._boot_id: int | None = None  # of the simulator, if it has reported one
        self._received_loss, self._sent_loss = PacketLoss(0), PacketLoss(1)
        self._next_request_us = 0
        self._simulator_parameters = SimulatorParameters(parameters)
        self._punctuality = Punctuality()
        self._ground = GroundWatch()
        self._ground_missing = False
        self._fall: FallWatch | None = None  # while the vehicle falls with its rotors stopped
        self._simulator_parameters_known = False  # the simulator has reported its parameters
        self.endpoint.expect_parameters()
        self._reboot = False  # the simulator is requested to restart
        setpoints_per_call = SETPOINTS_LOCKSTEP if options.clock_waits else SETPOINTS_PER_CALL
        self.core = FlightCore(build_setup(parameters, 1, options.own), setpoints_per_call)
        self._sensors = SensorInbox(options.home, self.core.rows.inbox)
        self._snapshot_source = SnapshotSource(self.core, options, parameters, self._health, self._sensors)
        # work that waits for `finish`
        self._path_work: PathWork | None = None
        self._setup_work: SetupWork | None = None
        # values of our parameters that are in force, or will be, and the period of the ticks
        self._applied: tuple[dict[str, float], int] = ({}, 0)
        self._prepared_for = (self.core.setup.settings.limits, self.core.setup.planner)
        self._prepared_from = AT_HOME
        self._batches = BatchBuilder(self._snapshot_source, self._battery_row, self._writer, options.lockstep)
        self._set_plan(self.endpoint.mission)
        self.has_log_data = False  # something was logged since the log was last taken
        self._log: FlightLog | None = None
        if options.log:
            release = ".".join(map(str, identity.version))
            self._log = FlightLog(parameters, release, options.boot_unix_us, options.home)
            self.endpoint.on_text = self._log_text

    # ---- simulator link

    def receive_sensors(self, datagram: bytes) -> bytes | None:
        """The answer to a datagram of sensors: a new answer to a new tick, the same again to a repeated tick.

        None for anything else: garbage, or a past tick.
        """
        before_us, started = self.now_us, self.tick >= 0
        tick = self._sensors.read(datagram, before_us if started else -1)
        if tick is None:
            return None
        now_us = tick.now_us
        if tick.other_messages and self._has_restarted(tick.other_messages):
            self.restarted = True
            return None
        late, ahead = now_us < before_us, started and now_us > before_us + MAX_LEAP_US
        if late or ahead:
            self.bad_time_ticks += 1
            if late or self.bad_time_ticks < CLOCK_CHANGE_TICKS:
                # the restart of a simulator that sends no SIM_BOOT is recognised by its clock
                self.restarted = late and self._boot_id is None and self.bad_time_ticks >= CLOCK_CHANGE_TICKS
                return None
        self.bad_time_ticks = 0
        if now_us == before_us and started:
            return self._answer
        answer = self._run_tick(tick)
        extra_messages = (
            self._simulator_parameters.messages(now_us) if self._simulator_parameters.has_messages else []
        )
        if self._reboot:
            extra_messages.append(_REBOOT)
        if extra_messages:
            answer += b"".join(map(self._writer.frame, extra_messages))
        self._answer = answer
        return answer

    def _has_restarted(self, messages: tuple[Any, ...]) -> bool:
        """Whether the simulator reports that it has restarted since its first message."""
        runs = [m.boot_id for m in messages if m.get_msgId() == mavlink.MAVLINK_MSG_ID_SIM_BOOT]
        return self._boot_id is not None and any(run != self._boot_id for run in runs)

    def _put_answer(self, tick: Tick, dt: float) -> bytes:
        """HIL_ACTUATOR_CONTROLS of this tick; also brings the vehicle's condition up to date."""
        core, writer, now_us = self.core, self._writer, tick.now_us
        flight = core.flight
        arguments = (
            *(self._health, self._sensors.imu, core.force_row, self._battery_row),
            *(tick.fields_updated, tick.has_fix, now_us, dt, self._frame, self._payload),
            *(writer.sequence, writer.system, writer.component, flight.phase not in UNARMED),
            *(self._options.lockstep, flight.cable.released),
            commanded_rate(flight, now_us, self._shortest_us * 1e-6) if core.is_reeling else 0.0,
        )
        if self._put is None:
            self._put = entry_point_of(answer_tick, *arguments)
        end, self._imu_sane = self._put(*arguments)
        writer.sequence = (writer.sequence + 1) & 0xFF
        return self._frame_view[:end].tobytes()

    @property
    def phase(self) -> Phase:
        """The phase of flight."""
        return self.core.flight.phase

    @property
    def tick_us(self) -> int:
        """Duration of a tick by the clock of the simulator; 0 until two ticks have arrived."""
        return self._shortest_us

    @property
    def armed(self) -> bool:
        """Whether rotors may turn."""
        return self.core.flight.phase not in UNARMED

    def _run_tick(self, tick: Tick) -> bytes:
        """One tick of the flight software; returns the answer to it."""
        now_us = tick.now_us
        period_us = now_us - self.now_us if self.tick >= 0 else 0
        self._begin_tick(tick)
        for message in tick.other_messages:
            self._handle_simulator_message(message)
        if not self._simulator_parameters_known and self._simulator_parameters.is_settled(tick.now_us):
            self._simulator_parameters_known = True
            self.endpoint.parameters_complete(tick.now_us)
        if period_us > 0 and not 0 < self._shortest_us <= period_us:
            # ticks may be lost in real time: the shortest step is that of the sensors' rate
            self._shortest_us = period_us
            self._apply_parameters()
        elif self.parameters.version != self._version:
            self._apply_parameters()
        dt = period_us * 1e-6
        if period_us > MIN_GAP_US:
            self._restart_after_gap(period_us)
        if self._ground.has_changed(now_us, self.endpoint.gcs_heartbeat_us):
            self._handle_ground_loss()
        elif self._ground_missing and not self._ground.lost:
            self._set_ground_missing(False)
        if self.fault:
            return self._put_answer(tick, dt)
        core, sensors = self.core, self._sensors
        if sensors.rows is not core.rows.inbox:
            core.use_inbox(sensors.rows)
        return self._end_tick(tick, dt, core.step(tick.readings, now_us, self.tick, dt))

    def complete(self, tick: Tick) -> bytes:
        """Complete a tick that machine code has begun and that needs a decision; returns the answer to it."""
        dt = (tick.now_us - self.now_us) * 1e-6
        self._begin_tick(tick)
        self.bad_time_ticks = 0
        report = self.core.complete(tick.readings, tick.now_us, self.tick, dt)
        self._answer = self._end_tick(tick, dt, report)
        return self._answer

    def _begin_tick(self, tick: Tick) -> None:
        """Make this tick the present one."""
        self.tick += 1
        self.now_us = tick.now_us
        if tick.has_fix:
            self._snapshot_source.has_fix = True

    def _end_tick(self, tick: Tick, dt: float, report: Report) -> bytes:
        """What follows a tick of the flight software: texts, completed items, the log; returns the answer."""
        now_us = tick.now_us
        answer = self._put_answer(tick, dt)
        if self._fall is not None or self.core.flight.fall != Fall.NONE:
            self._follow_fall(tick)
        if self.core.flight.low_battery is not None:
            self._forget_silent_battery(now_us)
        for severity, text in report.texts:
            self.endpoint.send_text(severity, text)
        for seq in report.reached:
            last = self.core.flight.mission.done and seq == report.reached[-1]
            self.endpoint.item_reached(seq, last)
        log = self._log
        if log is not None and log.is_due(now_us, self.armed):
            log.step(now_us, self.armed, self._log_names, self.log_sample)
            self.has_log_data = True
            self.endpoint.files.protected = log.path
        return answer

    def _follow_fall(self, tick: Tick) -> None:
        """Follow a vehicle whose rotors have stopped in the air until it rests."""
        core, flight, now_us = self.core, self.core.flight, tick.now_us
        if flight.fall == Fall.NONE:  # armed again
            self._fall = None
            return
        self._fall = self._fall or FallWatch(now_us)
        measured = self._imu_sane and tick.fields_updated & INERTIAL == INERTIAL
        sample = unpack(ImuReading, self._sensors.imu, 0) if measured else None
        fall = self._fall.advance(sample, core.known_speed, core.settings.gravity_m_s2, now_us)
        if fall != flight.fall:
            core.replace_flight(replace(flight, fall=fall))
        if fall == Fall.NONE:
            self._fall = None
            self._snapshot_source.note_rest(now_us)

    # ---- ticks without Python

    def tick_batch(self, timesync_requests: TimesyncRequests = NO_TIMESYNC_REQUESTS) -> TickBatch | None:
        """With which data, and until when, machine code can fly the next ticks; None: it cannot."""
        now_us, period_us, core = self.now_us, self._shortest_us, self.core
        heartbeat_us = self.endpoint.gcs_heartbeat_us
        if (
            not (
                self._simulator_parameters_known
                and self._options.lockstep
                and core.can_run_compiled
                and self.tick > RATE_TICKS
            )
            or (self._simulator_parameters.has_messages or self._reboot or self.fault or self.restarted)
            or (self.parameters.version != self._version or self.parameters[LOSS_PARAMETER] > 0.0)
            or self._sensors.rows is not core.rows.inbox
            or core.flight.fall != Fall.NONE
            or self._ground.has_changed(now_us + period_us, heartbeat_us)
        ):
            return None
        flight = core.flight
        status = self._snapshot_source.flight_status(flight, len(self.endpoint.mission.items))
        constants = self._snapshot_source.instant_constants(flight)
        ends_us = core.setpoints_until_us(period_us) if constants.has_setpoints else NEVER_US
        next_us = now_us + period_us
        log = None if self._log is None else self._log.compiled_logging(next_us, status.armed, status.phase)
        if log is None and self._log is not None:
            return None
        until_us = min(
            ends_us, NEVER_US if log is None else log.until_us, self._ground.lost_at_us(heartbeat_us)
        )
        if self._next_request_us >= timesync_requests.no_wait_until_us or timesync_requests.max_windows == 0:
            until_us = min(until_us, self._next_request_us)
        if until_us <= next_us:
            return None
        streams = self.endpoint.compiled_streams(status, now_us, LOCKSTEP_COMPONENT)
        if streams is None or streams.until_us <= next_us:
            return None
        times = (now_us, self.tick, period_us, min(until_us, streams.until_us))
        schedule = (self._next_request_us, GROUND_WINDOW_US, timesync_requests)
        return self._batches.next_batch(times, constants, status.seq, streams, log, schedule)

    def warmup_batch(self) -> TickBatch:
        """What `tick_batch` returns, only for compiling; it cannot be flown."""
        return self._batches.warmup_batch()

    def finish_batch(self) -> bool:
        """Take over what machine code has changed in a `tick_batch`; returns whether it flew any tick."""
        result = self._batches.result()
        if result is None:
            return False
        self.now_us, self.tick, self._imu_sane, self._answer = result
        self.bad_time_ticks = 0
        self.endpoint.streams_written(self._batches.streams, self.now_us)
        self._next_request_us = self._batches.next_request_us
        if self._log is not None and (records := self._batches.log_bytes):
            self._log.records_written(records, self._batches.next_log_us, self.now_us)
            self.has_log_data = True
        return True

    @property
    def unsent_windows(self) -> list[bytes]:
        """Messages that machine code has not sent to the ground station: each window that ends with a
        timesync request, and the messages of the open window."""
        return self._batches.unsent

    def _handle_ground_loss(self) -> None:
        """React to a silent ground station as soon as the phase allows it, or report that it is back."""
        if self._ground.lost:
            self._ground.lost = False
            self.endpoint.send_text(mavlink.MAV_SEVERITY_NOTICE, BACK_TEXT)
            return
        self._set_ground_missing(True)
        reaction = self._ground.request(self.core.flight)
        if (
            reaction is not None
            and self.core.handle_request(reaction[0], self.now_us).result == mavlink.MAV_RESULT_ACCEPTED
        ):
            self._ground.lost = True
            self.core.replace_flight(replace(self.core.flight, is_failsafe=True))
            self.endpoint.state_changed()
            self.endpoint.send_text(mavlink.MAV_SEVERITY_ERROR, LOST_TEXT.format(reaction[1]))

    def _set_ground_missing(self, missing: bool) -> None:
        """Let a silent ground station prevent arming: the flight would end at once."""
        self._ground_missing = missing
        problem = "ground station silent (COM_DL_LOSS_T)"
        self._set_arming_problems(_GROUND_STATION, (problem,) if missing else ())

    def _restart_after_gap(self, period_us: int) -> None:
        """Restart the estimate after a gap in the ticks so long that the estimate is lost and no command was
        given."""
        why = f"no tick of the simulator for {period_us * 1e-6:.1f} s"
        for severity, text in self.core.restart_estimate(why, self.now_us):
            self.endpoint.send_text(severity, text)

    def _handle_simulator_message(self, message: Any) -> None:
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_STATUSTEXT:
            text = self._simulator_texts.read(message)
            if text is not None:
                self.endpoint.send_text(message.severity, text)
            return
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_SIM_STATUS:
            self._set_arming_problems("clock", self._punctuality.arming_problems(message, self.tick))
            return
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN:
            self._set_arming_problems("home", home_problems(message, self._options.home))
            return
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_SIM_BOOT:
            self.endpoint.simulator_boot = message
            if self._boot_id is None:
                self._boot_id = message.boot_id
                self._resume_flight(message)
            return
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_BATTERY_STATUS:
            self._receive_battery(read_battery_status(message))
            return
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_PARAM_ERROR:
            client = self._simulator_parameters.client_of(message.param_id)
            if client is not None:
                self.endpoint.refuse_simulator_parameter(message.param_id, message.error, client)
            return
        name = self._simulator_parameters.receive(message)
        if name is not None:
            self.endpoint.parameter_changed(name)
        if name == FAILING_ROTORS:  # those of the others that were lost are repaired
            flight = self.core.flight
            still_lost = flight.rotors_lost_before & int(self.parameters[name])
            self.core.replace_flight(replace(flight, rotors_lost_before=still_lost))

    def _receive_battery(self, reading: BatteryReading) -> None:
        before = self._snapshot_source.measured.reading
        self._snapshot_source.measured = MeasuredBattery(self.now_us, reading)
        self._note_battery(reading)
        text = low_battery_text(before, reading, self.core.settings.battery.levels)
        # what follows from the charge is told by the supervisor
        if text is not None and due_event(self.core.flight, self.core.settings) is None:
            self.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, text)

    def _forget_silent_battery(self, now_us: int) -> None:
        """A battery that is not measured any more is not known to be low."""
        if now_us - self._snapshot_source.measured.time_us > BATTERY_TIMEOUT_US:
            self._note_battery(NO_READING)

    def _note_battery(self, reading: BatteryReading) -> None:
        """Note whether the measured battery is low."""
        flight = with_battery(self.core.flight, reading, self.core.settings.battery.levels)
        if flight is not self.core.flight:
            self.core.replace_flight(flight)

    def _resume_flight(self, boot: Any) -> None:
        """Take over a flight under way, which the autopilot had begun before it was restarted."""
        if boot.rotors == mavlink.PLUMBLINE_ROTORS_DISARMED:
            return
        vehicle, thrust_n = self.core.setup.vehicle, float(sum((*boot.force, *boot.more_force)))
        if boot.rotors == mavlink.PLUMBLINE_ROTORS_UNHEARD:
            self.core.replace_flight(replace(self.core.flight, fall=Fall.FALLING))
            text = "Restarted in flight after the rotors had stopped: disarmed"
            self.endpoint.send_text(mavlink.MAV_SEVERITY_CRITICAL, text)
        elif thrust_n < MIN_THRUST_SHARE * vehicle.quad_mass * vehicle.gravity:
            self.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, "Restarted on the ground: disarmed")
        else:
            self.core.resume_flight(RestartState(thrust_n, boot.reeled, bool(boot.released)), self.now_us)

    # ---- flight log

    def set_wall_clock(self, unix_us: int) -> None:
        """Set the time of the wall clock, for what must be in order across flights."""
        self.endpoint.set_wall_clock(unix_us)
        if self._log is not None:
            self._log.set_wall_clock(unix_us)

    def take_log(self, min_bytes: int = 1) -> LogChunk | None:
        """The part of the flight log to be stored, if it has `min_bytes` or the log has ended."""
        self.has_log_data = False
        return None if self._log is None else self._log.take_chunk(min_bytes)

    def end_log(self) -> None:
        """The program ends: the last of the log can be taken."""
        if self._log is not None:
            self._log.end()

    def abandon_log(self, why: str) -> None:
        """The shell could not store the log."""
        if self._log is not None:
            self._log.abandon()
            self.endpoint.files.protected = None
        self.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, f"Flight log lost: {why}")

    def _log_names(self) -> set[str]:
        try:
            return {entry.name for entry in self.endpoint.files.card.entries(LOG_FOLDER)}
        except FileError:
            return set()

    def log_sample(self) -> Sample:
        """The sample that the flight log records at this tick."""
        snapshot = self._snapshot()
        return Sample(
            snapshot, snapshot.instant, self._sensors.imu, self._imu_sane, lambda: snapshot.estimator
        )

    def _log_text(self, severity: int, text: str) -> None:
        if self._log is not None:
            self._log.add_text(self.now_us, severity, text)

    # ---- parameters

    def _apply_parameters(self) -> None:
        self._version = self.parameters.version
        try:
            every = control_divider(1e6 / self._shortest_us, self.parameters) if self._shortest_us else 1
        except RateError as error:
            self.fault = str(error)
            self.endpoint.send_text(mavlink.MAV_SEVERITY_CRITICAL, self.fault)
            return
        self.fault = ""
        self._ground.update_parameters(self.parameters)
        self._snapshot_source.battery = battery_constants(self.parameters)
        pack(self._snapshot_source.battery, self._battery_row, 0)
        values, simulator_names = self.parameters.values(), self.parameters.remote_names
        applied = (
            {name: value for name, value in values.items() if name not in simulator_names},
            self._shortest_us,
        )
        if applied == self._applied:  # only parameters of the simulator changed, which do not affect flying
            return
        self._applied = applied
        setup_work = SetupWork(self.parameters, every, self._options.own)
        if self._options.clock_waits or self.tick <= RATE_TICKS:
            self._apply_setup(setup_work.run())
        else:
            self._setup_work = setup_work

    def _apply_setup(self, setup: Setup) -> None:
        """Fly with this setup from the next tick on."""
        self.core.use_setup(setup)
        if (setup.settings.limits, setup.planner) != self._prepared_for:
            self._prepare()

    # ---- ground

    def add_link(self, link: Link, program: bool = False) -> None:
        """Add a link that always receives telemetry; `program`: with the streams for programs instead of
        those for ground stations."""
        self.endpoint.add_link(link, self.now_us, program)

    def receive_ground(self, datagram: bytes, link: Link, program: bool = False) -> list[Event]:
        """Handle a datagram from a ground station or a program; what must be stored is returned as events."""
        if self._received_loss.drops(datagram, self.parameters[LOSS_PARAMETER]):
            return []
        events = self.endpoint.receive(datagram, link, self.now_us, self._decide, program)
        for_shell: list[Event] = []
        for event in events:
            match event:
                case MissionChanged(mission):
                    self._set_plan(mission)
                case AreasChanged(kind, items):
                    self.set_areas(kind, items)
                case SimulatorParameterRequested(name, value, client):
                    self._simulator_parameters.request(name, value, client)
                case SimulatorParametersSaved(values) if (
                    values
                ):  # with values that the simulator has not confirmed yet
                    for_shell.append(
                        SimulatorParametersSaved({**values, **self._simulator_parameters.unanswered})
                    )
                    continue
                case _:
                    pass  # for the shell, which waits for it, stores it, or shows it
            if self._is_for_shell(event):
                for_shell.append(event)
        return for_shell

    def _is_for_shell(self, event: Event) -> bool:
        """Whether the event is returned to the shell: not requests to the simulator, nor parameters that are
        not stored, such as the loss of the link."""
        if isinstance(event, ParameterChanged):
            return self.parameters.describe(event.name).stored
        return not isinstance(event, SimulatorParameterRequested)

    def ground_datagrams(self) -> list[tuple[Link, bytes]]:
        """The datagrams due on the ground links at this tick."""
        datagrams = self.endpoint.poll(self._snapshot, self.now_us)
        if datagrams and (percent := self.parameters[LOSS_PARAMETER]) > 0.0:
            datagrams = [
                (link, datagram)
                for link, datagram in datagrams
                if not self._sent_loss.drops(datagram, percent)
            ]
        return datagrams

    def timesync_request(self, link: Link) -> bytes | None:
        """TIMESYNC for a ground station that shares our clock, at the first tick of each window; else None.

        The shell sends it after `ground_datagrams` and does not continue until it is answered.
        """
        if self.now_us < self._next_request_us:
            return None
        self._next_request_us = next_multiple(self.now_us, GROUND_WINDOW_US)
        return self.endpoint.datagram(link, (_TIMESYNC, (0, self.now_us * 1000)), LOCKSTEP_COMPONENT)

    def restore_simulator_parameters(self, values: Mapping[str, float]) -> None:
        """Set the saved values of the simulator's parameters as soon as the simulator is there."""
        self._simulator_parameters.restore(values)

    def paused_heartbeat(self, link: Link) -> bytes:
        """A heartbeat of a vehicle without sensor data, for a shell whose clock stands."""
        snapshot = self._snapshot()
        critical, emergency = mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY
        snapshot.system_status = emergency if snapshot.armed else critical
        return self.endpoint.datagram(link, heartbeat_message(snapshot, self.endpoint.identity))

    @property
    def warmup_work(self) -> WarmupWork:
        """Work whose result is not used, with which a process loads what real work needs."""
        path = Signals(1.0, (Term("x", 0.01, 0.0, 0.5, None, 0.0),))
        steps = (Waypoint(0.0, 0.0, 2.0, 1.0), Waypoint(1.0, 0.0, 2.0), Waypoint(1.0, 1.0, 2.0), path)
        paths = PathWork(steps, tuple(range(len(steps))), self.core.setup.settings.limits)
        return WarmupWork(paths, SetupWork(self.parameters, self.core.setup.control_every, self._options.own))

    def warm_up(self) -> None:
        """Call every kernel once, so that none is compiled in flight."""
        warm_up(self.core.setup)
        self.warm_up_messages()

    def warm_up_messages(self) -> None:
        """Call the kernels of the simulator link, of telemetry and of the flight log once."""
        self._sensors.read(b"", -1)
        warm_up_answer()
        warm_up_telemetry(self.core.setup, self.parameters, self.endpoint.identity)

    def _decide(self, request: object) -> Verdict:
        if isinstance(request, ChangeSigningKey):
            if self.armed:
                return Verdict(mavlink.MAV_RESULT_DENIED, "disarm first")
            return Verdict(mavlink.MAV_RESULT_ACCEPTED)
        if isinstance(request, ChangeVehicle):
            if self.armed:
                text = f"{request.parameter} not set while armed: disarm first"
                return Verdict(mavlink.MAV_RESULT_DENIED, text)
            return Verdict(mavlink.MAV_RESULT_ACCEPTED)
        if isinstance(request, InjectFailure):
            return self._decide_failure(request)
        if isinstance(request, ResetParameters):
            if self.armed:
                return Verdict(mavlink.MAV_RESULT_DENIED, "Reset of parameters denied: armed")
            return Verdict(mavlink.MAV_RESULT_ACCEPTED)
        if isinstance(request, Reboot):
            if self.armed:
                return Verdict(mavlink.MAV_RESULT_DENIED, "Reboot denied: armed")
            # the simulator restarts, and when its clock does, the shell builds a new autopilot
            self._reboot = True
            return Verdict(mavlink.MAV_RESULT_ACCEPTED)
        if self.fault:
            return Verdict(mavlink.MAV_RESULT_DENIED, self.fault)
        simulator_problems = self.core.flight.external_arming_problems.get(_SIMULATOR)
        if simulator_problems and isinstance(request, MOTION_REQUESTS):
            return Verdict(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, f"Not flown: {simulator_problems[0]}")
        if isinstance(request, Takeoff) and request.altitude_m is None:
            # a height that was set just before is the one that is meant, although its setup may not be ready
            request = Takeoff(self.parameters["MIS_TAKEOFF_ALT"])
        home = self.core.flight.area.home
        verdict = self.core.handle_request(request, self.now_us)
        if isinstance(request, SetHome) and self.core.flight.area.home != home:
            self._update_home()
        if self.core.flight.mission.waiting and self._path_work is None:
            self._prepare()  # again, from where it begins
        return verdict

    def _decide_failure(self, failure: InjectFailure) -> Verdict:
        """A sensor of which no reading has ever come cannot fail."""
        snapshot = self._snapshot()
        carried, _ = sensor_bits(snapshot.condition, snapshot.estimator, False, False, self.now_us)
        if failure.fail and failure.sensor & ~carried:
            return Verdict(mavlink.MAV_RESULT_UNSUPPORTED, "Failure: no such sensor is carried")
        return Verdict(mavlink.MAV_RESULT_ACCEPTED)

    def _update_home(self) -> None:
        """Read and prepare the mission again if it returns to a home that has changed. A mission under way
        keeps its paths, as when a parameter is changed."""
        flight = self.core.flight
        self.endpoint.move_home(flight.area.home)
        mission = flight.mission
        if mission.active or not any(isinstance(step, ReturnHome) for step in mission.plan.steps):
            return
        plan = mission_plan(self.endpoint.mission, self._options.home, None, flight.area.home)
        current, item = mission.step, mission.plan.sequence[mission.step]
        if len(plan.steps) != len(mission.plan.steps):
            # landing at another place than home may consist of two steps now
            current = plan.sequence.index(item)
        mission = replace(mission, plan=plan, step=current)
        self.core.replace_flight(replace(flight, mission=mission))
        self._prepare()

    def set_areas(self, kind: int, items: tuple[WireItem, ...]) -> None:
        """Take over another fence or other rally points."""
        self.endpoint.set_areas(kind, items)
        flight = self.core.flight
        area = flight.area.with_items(kind, items, self._options.home)
        self.core.replace_flight(replace(flight, area=area))
        self._warn_of_rally()

    def _warn_of_rally(self) -> None:
        """Report rally points that the fence forbids; they may have been uploaded before it."""
        text = forbidden_rally_text(self.core.flight, self.core.settings)
        if text:
            self.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, text)

    def set_storage_losses(self, lost: tuple[str, ...]) -> None:
        """State what cannot be read from the storage: the vehicle is not armed until this is repaired."""
        self._set_arming_problems("storage", lost)

    def set_simulator_silent(self, silent: bool) -> None:
        """State whether the simulator is silent: until it is back, the vehicle is not armed, accepts no
        command that would be flown, and sets no parameter of the simulator."""
        self.endpoint.set_simulator_silent(silent)
        if silent:
            self._simulator_parameters.drop_unanswered()
        self._set_arming_problems(_SIMULATOR, ("the simulator is silent",) if silent else ())

    def _set_arming_problems(self, source: str, reasons: tuple[str, ...]) -> None:
        """Set the reasons for which this source prevents arming."""
        external_arming_problems = self.core.flight.external_arming_problems
        if external_arming_problems.get(source, ()) != reasons:
            self.core.replace_flight(
                replace(
                    self.core.flight, external_arming_problems={**external_arming_problems, source: reasons}
                )
            )

    def _set_plan(self, mission: StoredMission) -> None:
        plan = mission_plan(mission, self._options.home, None, self.core.flight.area.home)
        self.core.replace_flight(with_plan(self.core.flight, plan))
        self._prepare()
        unflown = unflown_items(mission.items)
        if unflown:
            text = f"Kept, but not flown: {_named_items(mission.items, unflown)}"
            self.endpoint.send_text(mavlink.MAV_SEVERITY_INFO, text)
        early = zip(plan.steps[:-1], plan.sequence, strict=False)  # all steps but the last
        landing = next((item for step, item in early if isinstance(step, Land)), None)
        if landing is not None:
            text = f"Mission ends with the landing of item {landing}; no later item is flown"
            self.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, text)

    def _prepare(self) -> None:
        """Have the paths of the plan prepared: immediately if the clock waits, else as `work`. Meanwhile, a
        mission under way keeps the paths that it has."""
        if self.core.flight.mission.active:
            work = later_path_work(self.core, self._prepared_from)
        else:
            work = path_work(self.core, self.now_us)
            use_paths(self.core, PENDING)
        self._path_work = work
        self._prepared_for, self._prepared_from = (work.limits, work.planner), work.begin
        if self._options.clock_waits or not work.steps:
            self.finish(work, work.run())

    @property
    def work(self) -> PathWork | SetupWork | None:
        """Work to be done by another process, whose result is passed to `finish`."""
        return self._setup_work or self._path_work

    def finish(self, work: PathWork | SetupWork, result: Any) -> None:
        """Take over the result of `work`, unless there is newer work of its kind."""
        if work is self._setup_work:
            self._setup_work = None
            if result is None:
                self.endpoint.send_text(
                    mavlink.MAV_SEVERITY_WARNING, "Gains not designed: the old ones are in force"
                )
            else:
                self._apply_setup(result)
        elif work is self._path_work:
            self._path_work = None
            if self.core.flight.mission.active:
                for note in result.notes:
                    self.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, note)
                text = use_later_paths(self.core, result, self.now_us)
                self.endpoint.send_text(mavlink.MAV_SEVERITY_INFO, text)
                return
            self._set_paths(result)
            if self.core.flight.mission.waiting and begin_now(self.core, self.now_us) != work.begin:
                self._prepare()  # it begins elsewhere by now, and waits for other paths

    def _set_paths(self, prepared: PreparedPaths) -> None:
        """Take over the paths of the plan, and begin the mission if it waited for them."""
        for note in prepared.notes:
            self.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, note)
        use_paths(self.core, prepared)
        if self.core.flight.mission.waiting:
            self._begin_mission()
        elif self.tick >= 0:
            self._warn_of_curves()

    def _warn_of_curves(self) -> None:
        """Report a curve of the mission that the fence forbids: the mission would be refused at its start."""
        flight, settings = self.core.flight, self.core.settings
        if flight.mission.active or not flight.mission.plan.steps:
            return
        ahead = remaining_timeline(flight, self.core.view(self.now_us), settings)
        problem = curve_exit_problem(flight, ahead, settings)
        if problem:
            self.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, f"Mission will not start: {problem}")

    def _begin_mission(self) -> None:
        """Begin the mission that waited for its paths, or report why not."""
        verdict = self.core.handle_request(StartMission(None), self.now_us)
        self.endpoint.state_changed()
        if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
            self.core.replace_flight(interrupt_mission(self.core.flight))
            text, subject = verdict.text or "Mission denied", mavlink.MAV_CMD_MISSION_START
            self.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, text, subject)

    def _snapshot(self) -> CoreSnapshot:
        return CoreSnapshot(self._snapshot_source, self.endpoint.mission, self.now_us)
