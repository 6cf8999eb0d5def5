"""The whole autopilot without its sockets: datagrams in, datagrams out.

The simulator link drives it: each new tick of sensors runs the flight core once. Messages of ground stations
wait until the shell hands them over between two ticks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
from autopilot.core.flight_core import LAID_OUT, LAID_OUT_WAITING, FlightCore, Setup, commanded_rate
from autopilot.core.health import Condition, battery_constants
from autopilot.core.sensor_inbox import SensorInbox, Tick
from autopilot.core.warmup import rehearse
from autopilot.estimation.filter import estimator_tuning
from autopilot.geometry.entry import entry_of
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.packed import pack, packed
from autopilot.onboard.flight_log import FlightLog, LogChunk
from autopilot.onboard.ground_watch import BACK_TEXT, LOST_TEXT, GroundWatch
from autopilot.onboard.log_topics import Sample
from autopilot.onboard.packet_loss import LOSS_PARAMETER, Loss
from autopilot.onboard.punctuality import Punctuality
from autopilot.onboard.running import NO_QUESTIONS, Questions, Runner, Running
from autopilot.onboard.simulator_parameters import SIMULATOR_COMPONENT, WorldParameters
from autopilot.onboard.snapshot import UNARMED, MeasuredBattery, Moment, Moments, Options
from autopilot.onboard.tick_answer import answer_tick
from autopilot.onboard.warmup import rehearse_answer, rehearse_telemetry
from autopilot.own.chosen import NOTHING_OWN, Own, OwnSetup
from autopilot.own.planning import planner_for
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
    Verdict,
    WorldAsked,
    WorldSaved,
)
from autopilot.services.requests import (
    FLOWN,
    ChangeSigningKey,
    Reboot,
    ResetParameters,
    SetHome,
    StartMission,
)
from autopilot.services.streams import NEVER_US
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.recovery import Found
from autopilot.supervisor.settings import settings_from
from autopilot.supervisor.state import MissionPlan, Phase, Report, off_mission
from autopilot.trajectory.prepare import PENDING, Limits, Prepared, prepare
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.vehicle.rates import RateError, control_divider
from autopilot.wire.codec import FrameWriter, layout_of
from autopilot.wire.compiled import FRAME_ROOM, PAYLOAD_ROOM
from autopilot.wire.convert.battery import read_battery_status
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import read_fence, read_rally
from autopilot.wire.items import WireItem, endless_from, located_steps, unflown
from autopilot.wire.periods import next_multiple
from autopilot.wire.signing import Signing
from missions.model import Land, ReturnHome, Signals, Step, Term, Waypoint

GROUND_WINDOW_US = 20_000
SIMULATOR_SYSTEM = 1  # our system id on the simulator link, whatever MAV_SYS_ID ground stations see
# asks whether the ground has caught up: separate, since no log has its messages and gaps would be noticed
LOCKSTEP_COMPONENT = mavlink.MAV_COMP_ID_SYSTEM_CONTROL
_TIMESYNC = layout_of(mavlink.MAVLink_timesync_message)
_REBOOT = mavlink.MAVLink_command_long_message(
    1, SIMULATOR_COMPONENT, mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
)
MOST_NAMED = 8  # items in one text
LEAP_US = 5_000_000  # a single tick that lies farther ahead is rejected
GAP_US = 500_000  # time without a tick after which a vehicle in the air has long been out of control
FIRST_TICKS = 1  # ticks in which the tick rate is determined
BELIEVED = 3  # ticks in a row in the past or far ahead, after which the clock is assumed to have changed
_SIMULATOR = "simulator"  # source of a reason that prevents arming
LEAST_THRUST = 0.3  # share of the vehicle's weight: rotors commanded to less did not carry it


class Gains(NamedTuple):
    """Work for another process, as `Work`: what is derived from the parameters, mainly the law's gains."""

    parameters: AutopilotParameters
    control_every: int
    own: Own = NOTHING_OWN  # user code, by its names

    def done(self) -> Setup:
        """The result; takes up to half a second."""
        return build_setup(self.parameters, self.control_every, self.own)

    def failed(self, why: str) -> None:
        """The result if the work failed: none."""


class Work(NamedTuple):
    """Paths of a mission to be prepared, as plain data, so that another process can do it."""

    steps: tuple[Step, ...]
    sequence: tuple[int, ...]
    limits: Limits
    home: Vec3 = ZERO  # destination of a return
    planner: OwnSetup | None = None  # custom planner

    def done(self) -> Prepared:
        """The result; takes from a millisecond to some seconds."""
        planner = planner_for(self.planner)
        return prepare(self.steps, self.sequence, self.limits, self.home, planner)

    def failed(self, why: str) -> Prepared:
        """The result if the work failed."""
        return Prepared(refusal=why, notes=(why,))


class Rehearsal(NamedTuple):
    """Work whose result is not used, with which a process loads what real work needs."""

    paths: Work
    gains: Gains

    def done(self) -> None:
        """Do it."""
        self.paths.done()
        self.gains.done()


def build_setup(table: AutopilotParameters, control_every: int, own: Own = NOTHING_OWN) -> Setup:
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
        settings=settings_from(table, kind.ramp_lag_s(law), kind.reels, kind.follows_shaped),
        control_every=control_every,
        own=OwnSetup(own.law, table.values()) if is_own(law) else None,
        estimator=OwnSetup(own.estimator, table.values()) if own.estimator else None,
        planner=OwnSetup(own.planner, table.values()) if own.planner else None,
        layout=table.layout,
        rotor_watch=believed_rotor_watch(table),
        factor_share=believed_factor_share(table),
    )


def plan_of(
    mission: StoredMission,
    home: Home,
    limits: Limits | None,
    return_to: Vec3 = ZERO,
    planner: OwnSetup | None = None,
) -> MissionPlan:
    """The steps of a mission as it was uploaded, prepared for a vehicle with these limits; limits None: not
    prepared yet. A return leads to `return_to`; `planner` is a custom planner."""
    steps = located_steps(mission.items, home, return_to)
    flown, sequence = tuple(s.step for s in steps), tuple(s.last for s in steps)
    prepared = PENDING
    if limits is not None:
        prepared = prepare(flown, sequence, limits, return_to, planner_for(planner))
    again_from = endless_from(mission.items, steps)
    aims = tuple(s.aims for s in steps)
    return MissionPlan(flown, sequence, len(mission.items), prepared, aims, again_from)


class Onboard:
    """One autopilot. Its clock advances in `receive_sensors`, and in the ticks that machine code flies
    (`ran`, `complete`)."""

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
        self._sensed = False  # the inertial sample of this tick is sane
        self._health = packed(Condition())
        self._battery_row = packed(battery_constants(parameters))
        self._frame = np.zeros(FRAME_ROOM, np.uint8)
        self._written = self._frame.data
        self._payload = np.zeros(PAYLOAD_ROOM, np.uint8)
        # machine code, after the first call
        self._put: Callable[..., tuple[int, bool]] | None = None
        self._shortest_us = 0  # shortest time between two ticks so far
        self._version = parameters.version
        self.out_of_time = 0  # ticks in a row that lay in the past or far ahead
        self.restarted = False  # the simulator has restarted; this autopilot is of no use any more
        self._boot_id: int | None = None  # of the simulator, if it has reported one
        self._received_loss, self._sent_loss = Loss(0), Loss(1)
        self._next_question_us = 0
        self._world = WorldParameters(parameters)
        self._punctuality = Punctuality()
        self._ground = GroundWatch()
        self._world_told = False  # the simulator has reported its parameters
        self.endpoint.expect_parameters()
        self._reboot = False  # the simulator is requested to restart
        laid_out = LAID_OUT_WAITING if options.clock_waits else LAID_OUT
        self.core = FlightCore(build_setup(parameters, 1, options.own), laid_out)
        self._sensors = SensorInbox(options.home, self.core.rows.inbox)
        self._moments = Moments(self.core, options, parameters, self._health, self._sensors)
        # work that waits for `finish`
        self._paths: Work | None = None
        self._gains: Gains | None = None
        # values of our parameters that are in force, or will be, and the period of the ticks
        self._followed: tuple[dict[str, float], int] = ({}, 0)
        self._prepared_for = (self.core.setup.settings.limits, self.core.setup.planner)
        self._runner = Runner(self._moments, self._battery_row, self._writer, options.lockstep)
        self._take_plan(self.endpoint.mission)
        self.logged = False  # something was logged since the log was last taken
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
        before_us, begun = self.now_us, self.tick >= 0
        tick = self._sensors.read(datagram, before_us if begun else -1)
        if tick is None:
            return None
        now_us = tick.now_us
        if tick.aside and self._is_another_run(tick.aside):
            self.restarted = True
            return None
        late, ahead = now_us < before_us, begun and now_us > before_us + LEAP_US
        if late or ahead:
            self.out_of_time += 1
            if late or self.out_of_time < BELIEVED:
                # the restart of a simulator that sends no SIM_BOOT is recognised by its clock
                self.restarted = late and self._boot_id is None and self.out_of_time >= BELIEVED
                return None
        self.out_of_time = 0
        if now_us == before_us and begun:
            return self._answer
        answer = self._run(tick)
        aside = self._world.messages(now_us) if self._world.speaks else []
        if self._reboot:
            aside.append(_REBOOT)
        if aside:
            answer += b"".join(map(self._writer.frame, aside))
        self._answer = answer
        return answer

    def _is_another_run(self, messages: tuple[Any, ...]) -> bool:
        """Whether the simulator reports that it has restarted since it was first heard."""
        runs = [m.boot_id for m in messages if m.get_msgId() == mavlink.MAVLINK_MSG_ID_SIM_BOOT]
        return self._boot_id is not None and any(run != self._boot_id for run in runs)

    def _put_answer(self, tick: Tick, dt: float) -> bytes:
        """HIL_ACTUATOR_CONTROLS of this tick; also brings the vehicle's condition up to date."""
        core, writer, now_us = self.core, self._writer, tick.now_us
        flight = core.flight
        arguments = (
            *(self._health, self._sensors.imu, core.force_row, self._battery_row),
            *(tick.fields_updated, tick.fixed, now_us, dt, self._frame, self._payload),
            *(writer.sequence, writer.system, writer.component, flight.phase not in UNARMED),
            *(self._options.lockstep, flight.cable.released),
            commanded_rate(flight, now_us, self._shortest_us * 1e-6) if core.reels else 0.0,
        )
        if self._put is None:
            self._put = entry_of(answer_tick, *arguments)
        end, self._sensed = self._put(*arguments)
        writer.sequence = (writer.sequence + 1) & 0xFF
        return self._written[:end].tobytes()

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

    def _run(self, tick: Tick) -> bytes:
        """One tick of the flight software; returns the answer to it."""
        now_us = tick.now_us
        period_us = now_us - self.now_us if self.tick >= 0 else 0
        self._begin_tick(tick)
        for message in tick.aside:
            self._hear_simulator(message)
        if not self._world_told and self._world.settled(tick.now_us):
            self._world_told = True
            self.endpoint.parameters_complete(tick.now_us)
        if period_us > 0 and not 0 < self._shortest_us <= period_us:
            # ticks may be lost in real time: the shortest step is that of the sensors' rate
            self._shortest_us = period_us
            self._follow_parameters()
        elif self.parameters.version != self._version:
            self._follow_parameters()
        dt = period_us * 1e-6
        if period_us > GAP_US:
            self._bridge(period_us)
        if self._ground.changed(now_us, self.endpoint.ground_us):
            self._miss_ground()
        if self.fault:
            return self._put_answer(tick, dt)
        core, sensors = self.core, self._sensors
        if sensors.rows is not core.rows.inbox:
            core.take_inbox(sensors.rows)
        return self._end_tick(tick, dt, core.step(tick.readings, now_us, self.tick, dt))

    def complete(self, tick: Tick) -> bytes:
        """Complete a tick that machine code has begun and that needs a decision; returns the answer to it."""
        dt = (tick.now_us - self.now_us) * 1e-6
        self._begin_tick(tick)
        self.out_of_time = 0
        report = self.core.complete(tick.readings, tick.now_us, self.tick, dt)
        self._answer = self._end_tick(tick, dt, report)
        return self._answer

    def _begin_tick(self, tick: Tick) -> None:
        """Make this tick the present one."""
        self.tick += 1
        self.now_us = tick.now_us
        if tick.fixed:
            self._moments.fixed = True

    def _end_tick(self, tick: Tick, dt: float, report: Report) -> bytes:
        """What follows a tick of the flight software: texts, completed items, the log; returns the answer."""
        now_us = tick.now_us
        answer = self._put_answer(tick, dt)
        for severity, text in report.texts:
            self.endpoint.say(severity, text)
        for seq in report.reached:
            last = self.core.flight.mission.done and seq == report.reached[-1]
            self.endpoint.item_reached(seq, last)
        log = self._log
        if log is not None and log.due(now_us, self.armed):
            log.step(now_us, self.armed, self._log_names, self.log_sample)
            self.logged = True
            self.endpoint.files.protected = log.path
        return answer

    # ---- ticks without Python

    def running(self, questions: Questions = NO_QUESTIONS) -> Running | None:
        """With which data, and until when, machine code can fly the next ticks; None: it cannot."""
        now_us, period_us, core = self.now_us, self._shortest_us, self.core
        heard_us = self.endpoint.ground_us
        if (
            not (self._world_told and self._options.lockstep and core.runs and self.tick > FIRST_TICKS)
            or (self._world.speaks or self._reboot or self.fault or self.restarted)
            or (self.parameters.version != self._version or self.parameters[LOSS_PARAMETER] > 0.0)
            or self._sensors.rows is not core.rows.inbox
            or self._ground.changed(now_us + period_us, heard_us)
        ):
            return None
        flight = core.flight
        told = self._moments.told(flight, len(self.endpoint.mission.items))
        known = self._moments.standing(flight)
        ends_us = core.setpoints_until_us(period_us) if known.tracks else NEVER_US
        next_us = now_us + period_us
        log = None if self._log is None else self._log.running(next_us, told.armed, told.phase)
        if log is None and self._log is not None:
            return None
        until_us = min(ends_us, NEVER_US if log is None else log.until_us, self._ground.changes_us(heard_us))
        if self._next_question_us >= questions.until_us or questions.most == 0:
            until_us = min(until_us, self._next_question_us)
        if until_us <= next_us:
            return None
        written = self.endpoint.written(told, now_us, LOCKSTEP_COMPONENT)
        if written is None or written.until_us <= next_us:
            return None
        times = (now_us, self.tick, period_us, min(until_us, written.until_us))
        asked = (self._next_question_us, GROUND_WINDOW_US, questions)
        return self._runner.running(times, known, told.seq, written, log, asked)

    def rehearsed_running(self) -> Running:
        """What `running` returns, only for compiling; it cannot be flown."""
        return self._runner.rehearsed()

    def ran(self) -> bool:
        """Take over what machine code has changed in `running`; returns whether it flew any tick."""
        ran = self._runner.ran()
        if ran is None:
            return False
        self.now_us, self.tick, self._sensed, self._answer = ran
        self.out_of_time = 0
        self.endpoint.wrote(self._runner.written, self.now_us)
        self._next_question_us = self._runner.next_question_us
        if self._log is not None and (records := self._runner.logged):
            self._log.wrote(records, self._runner.next_log_us, self.now_us)
            self.logged = True
        return True

    @property
    def said(self) -> list[bytes]:
        """Messages that machine code has not sent to the ground station: each window that ends with a
        question, and the messages of the open window."""
        return self._runner.said

    def _miss_ground(self) -> None:
        """React to a silent ground station as soon as the phase allows it, or report that it is back."""
        if self._ground.lost:
            self._ground.lost = False
            self.endpoint.say(mavlink.MAV_SEVERITY_NOTICE, BACK_TEXT)
            return
        asked = self._ground.request(self.phase)
        if asked is not None and self.core.ask(asked[0], self.now_us).result == mavlink.MAV_RESULT_ACCEPTED:
            self._ground.lost = True
            self.endpoint.state_changed()
            self.endpoint.say(mavlink.MAV_SEVERITY_CRITICAL, LOST_TEXT.format(asked[1]))

    def _bridge(self, period_us: int) -> None:
        """Begin anew after a gap in the ticks so long that the estimate is lost and no command was given."""
        why = f"no tick of the simulator for {period_us * 1e-6:.1f} s"
        for severity, text in self.core.begin_anew(why, self.now_us):
            self.endpoint.say(severity, text)

    def _hear_simulator(self, message: Any) -> None:
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_STATUSTEXT:
            self.endpoint.say(message.severity, message.text)
            return
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_SIM_STATUS:
            self._hinder("clock", self._punctuality.hear(message, self.tick))
            return
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_SIM_BOOT:
            self.endpoint.simulator_run = message
            if self._boot_id is None:
                self._boot_id = message.boot_id
                self._find(message)
            return
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_BATTERY_STATUS:
            self._moments.measured = MeasuredBattery(self.now_us, read_battery_status(message))
            return
        name = self._world.receive(message)
        if name is not None:
            self.endpoint.parameter_changed(name)

    def _find(self, boot: Any) -> None:
        """Take over a flight under way, which the autopilot had begun before it was restarted."""
        if boot.rotors == mavlink.PLUMBLINE_ROTORS_DISARMED:
            return
        vehicle, thrust_n = self.core.setup.vehicle, float(sum((*boot.force, *boot.more_force)))
        if boot.rotors == mavlink.PLUMBLINE_ROTORS_UNHEARD:
            text = "Restarted in flight after the rotors had stopped: disarmed"
            self.endpoint.say(mavlink.MAV_SEVERITY_CRITICAL, text)
        elif thrust_n < LEAST_THRUST * vehicle.quad_mass * vehicle.gravity:
            self.endpoint.say(mavlink.MAV_SEVERITY_WARNING, "Restarted on the ground: disarmed")
        else:
            self.core.take_up(Found(thrust_n, boot.reeled, bool(boot.released)), self.now_us)

    # ---- flight log

    def take_log(self, least_bytes: int = 1) -> LogChunk | None:
        """The part of the flight log to be stored, if it has `least_bytes` or the log has ended."""
        self.logged = False
        return None if self._log is None else self._log.take(least_bytes)

    def end_log(self) -> None:
        """The program ends: the last of the log can be taken."""
        if self._log is not None:
            self._log.end()

    def give_up_log(self, why: str) -> None:
        """The shell could not store the log."""
        if self._log is not None:
            self._log.give_up()
            self.endpoint.files.protected = None
        self.endpoint.say(mavlink.MAV_SEVERITY_WARNING, f"Flight log lost: {why}")

    def _log_names(self) -> set[str]:
        try:
            return {entry.name for entry in self.endpoint.files.card.entries(LOG_FOLDER)}
        except FileError:
            return set()

    def log_sample(self) -> Sample:
        """The sample that the flight log records at this tick."""
        moment = self._snapshot()
        return Sample(moment, moment.instant, self._sensors.imu, self._sensed, lambda: moment.estimator)

    def _log_text(self, severity: int, text: str) -> None:
        if self._log is not None:
            self._log.say(self.now_us, severity, text)

    # ---- parameters

    def _follow_parameters(self) -> None:
        self._version = self.parameters.version
        try:
            every = control_divider(1e6 / self._shortest_us, self.parameters) if self._shortest_us else 1
        except RateError as error:
            self.fault = str(error)
            self.endpoint.say(mavlink.MAV_SEVERITY_CRITICAL, self.fault)
            return
        self.fault = ""
        self._ground.follow(self.parameters)
        self._moments.battery = battery_constants(self.parameters)
        pack(self._moments.battery, self._battery_row, 0)
        values, learned = self.parameters.values(), self.parameters.learned
        followed = {name: value for name, value in values.items() if name not in learned}, self._shortest_us
        if followed == self._followed:  # only parameters of the simulator changed, which do not affect flying
            return
        self._followed = followed
        gains = Gains(self.parameters, every, self._options.own)
        if self._options.clock_waits or self.tick <= FIRST_TICKS:
            self._take_setup(gains.done())
        else:
            self._gains = gains

    def _take_setup(self, setup: Setup) -> None:
        """Fly with this setup from the next tick on."""
        self.core.follow(setup)
        # a mission under way keeps the paths that it began with
        wanted = (setup.settings.limits, setup.planner)
        if wanted != self._prepared_for and not self.core.flight.mission.active:
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
        kept: list[Event] = []
        for event in events:
            match event:
                case MissionChanged(mission):
                    self._take_plan(mission)
                case AreasChanged(kind, items):
                    self.take_areas(kind, items)
                case WorldAsked(name, value):
                    self._world.ask(name, value)
                case WorldSaved(values) if values:  # with values that the simulator has not confirmed yet
                    kept.append(WorldSaved({**values, **self._world.asked}))
                    continue
                case _:
                    pass  # for the shell, which waits for it, stores it, or shows it
            if self._outlives(event):
                kept.append(event)
        return kept

    def _outlives(self, event: Event) -> bool:
        """Whether the event is returned to the shell: not requests to the simulator, nor parameters that are
        not stored, such as the loss of the link."""
        if isinstance(event, ParameterChanged):
            return self.parameters.describe(event.name).stored
        return not isinstance(event, WorldAsked)

    def ground_datagrams(self) -> list[tuple[Link, bytes]]:
        """The datagrams due on the ground links at this tick."""
        sent = self.endpoint.poll(self._snapshot, self.now_us)
        if sent and (percent := self.parameters[LOSS_PARAMETER]) > 0.0:
            sent = [
                (link, datagram) for link, datagram in sent if not self._sent_loss.drops(datagram, percent)
            ]
        return sent

    def question(self, link: Link) -> bytes | None:
        """TIMESYNC for a ground station that shares our clock, at the first tick of each window; else None.

        The shell sends it after `ground_datagrams` and does not continue until it is answered.
        """
        if self.now_us < self._next_question_us:
            return None
        self._next_question_us = next_multiple(self.now_us, GROUND_WINDOW_US)
        return self.endpoint.datagram(link, (_TIMESYNC, (0, self.now_us * 1000)), LOCKSTEP_COMPONENT)

    def restore_world(self, values: Mapping[str, float]) -> None:
        """Set the saved values of the simulator's parameters as soon as the simulator is there."""
        self._world.restore(values)

    def stranded_heartbeat(self, link: Link) -> bytes:
        """A heartbeat of a vehicle without sensor data, for a shell whose clock stands."""
        snapshot = self._snapshot()
        critical, emergency = mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY
        snapshot.system_status = emergency if snapshot.armed else critical
        return self.endpoint.datagram(link, heartbeat_message(snapshot, self.endpoint.identity))

    @property
    def rehearsal(self) -> Rehearsal:
        """Work whose result is not used, with which a process loads what real work needs."""
        path = Signals(1.0, (Term("x", 0.01, 0.0, 0.5, None, 0.0),))
        steps = (Waypoint(0.0, 0.0, 2.0, 1.0), Waypoint(1.0, 0.0, 2.0), Waypoint(1.0, 1.0, 2.0), path)
        paths = Work(steps, tuple(range(len(steps))), self.core.setup.settings.limits)
        return Rehearsal(paths, Gains(self.parameters, self.core.setup.control_every, self._options.own))

    def rehearse(self) -> None:
        """Call every kernel once, so that none is compiled in flight."""
        rehearse(self.core.setup)
        self.rehearse_messages()

    def rehearse_messages(self) -> None:
        """Call the kernels of the simulator link, of telemetry and of the flight log once."""
        self._sensors.read(b"", -1)
        rehearse_answer()
        rehearse_telemetry(self.core.setup, self.parameters)

    def _decide(self, request: object) -> Verdict:
        if isinstance(request, ChangeSigningKey):
            if self.armed:
                return Verdict(mavlink.MAV_RESULT_DENIED, "disarm first")
            return Verdict(mavlink.MAV_RESULT_ACCEPTED)
        if isinstance(request, ResetParameters):
            if self.armed:
                return Verdict(mavlink.MAV_RESULT_DENIED, "Reset of parameters denied: armed")
            return Verdict(mavlink.MAV_RESULT_ACCEPTED)
        if isinstance(request, Reboot) and not request.shutdown:
            if self.armed:
                return Verdict(mavlink.MAV_RESULT_DENIED, "Reboot denied: armed")
            # the simulator restarts, and when its clock does, the shell builds a new autopilot
            self._reboot = True
            return Verdict(mavlink.MAV_RESULT_ACCEPTED)
        if self.fault:
            return Verdict(mavlink.MAV_RESULT_DENIED, self.fault)
        silence = self.core.flight.hindrances.get(_SIMULATOR)
        if silence and isinstance(request, FLOWN):
            return Verdict(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, f"Not flown: {silence[0]}")
        home = self.core.flight.area.home
        verdict = self.core.ask(request, self.now_us)
        if isinstance(request, SetHome) and self.core.flight.area.home != home:
            self._follow_home()
        return verdict

    def _follow_home(self) -> None:
        """Read and prepare the mission again if it returns to a home that has changed. A mission under way
        keeps its paths, as when a parameter is changed."""
        flight = self.core.flight
        mission = flight.mission
        if mission.active or not any(isinstance(step, ReturnHome) for step in mission.plan.steps):
            return
        plan = plan_of(self.endpoint.mission, self._options.home, None, flight.area.home)
        current, item = mission.step, mission.plan.sequence[mission.step]
        if len(plan.steps) != len(mission.plan.steps):
            # landing at another place than home may consist of two steps now
            current = plan.sequence.index(item)
        mission = replace(mission, plan=plan, step=current)
        self.core.change(replace(flight, mission=mission))
        self._prepare()

    def take_areas(self, kind: int, items: tuple[WireItem, ...]) -> None:
        """Take over another fence or other rally points."""
        self.endpoint.set_areas(kind, items)
        flight = self.core.flight
        if kind == mavlink.MAV_MISSION_TYPE_FENCE:
            area = replace(flight.area, fence=read_fence(items, self._options.home), breach="")
        else:
            area = replace(flight.area, rally=read_rally(items, self._options.home))
        self.core.change(replace(flight, area=area))

    def take_losses(self, lost: tuple[str, ...]) -> None:
        """State what cannot be read from the storage: the vehicle is not armed until this is repaired."""
        self._hinder("storage", lost)

    def take_silence(self, silent: bool) -> None:
        """State whether the simulator is silent: until it is back, the vehicle is not armed, accepts no
        command that would be flown, and sets no parameter of the simulator."""
        self.endpoint.world_silent(silent)
        if silent:
            self._world.forget_asked()
        self._hinder(_SIMULATOR, ("the simulator is silent",) if silent else ())

    def _hinder(self, source: str, reasons: tuple[str, ...]) -> None:
        """Set the reasons for which this source prevents arming."""
        hindrances = self.core.flight.hindrances
        if hindrances.get(source, ()) != reasons:
            self.core.change(replace(self.core.flight, hindrances={**hindrances, source: reasons}))

    def _take_plan(self, mission: StoredMission) -> None:
        plan = plan_of(mission, self._options.home, None, self.core.flight.area.home)
        self.core.change(with_plan(self.core.flight, plan))
        self._prepare()
        kept = unflown(mission.items)
        if kept:
            numbers = ", ".join(map(str, kept[:MOST_NAMED])) + (" ..." if len(kept) > MOST_NAMED else "")
            self.endpoint.say(mavlink.MAV_SEVERITY_INFO, f"Mission items kept, not flown: {numbers}")
        early = zip(plan.steps[:-1], plan.sequence, strict=False)  # all steps but the last
        landing = next((item for step, item in early if isinstance(step, Land)), None)
        if landing is not None:
            text = f"Mission ends with the landing of item {landing}; no later item is flown"
            self.endpoint.say(mavlink.MAV_SEVERITY_WARNING, text)

    def _prepare(self) -> None:
        """Have the paths of the plan prepared: immediately if the clock waits, else as `work`."""
        plan, setup = self.core.flight.mission.plan, self.core.setup
        self._prepared_for = limits, planner = setup.settings.limits, setup.planner
        home = self.core.flight.area.home
        work = self._paths = Work(plan.steps, plan.sequence, limits, home, planner)
        self._have_prepared(PENDING)
        if self._options.clock_waits or not plan.steps:
            self.finish(work, work.done())

    @property
    def work(self) -> Work | Gains | None:
        """Work to be done by another process, whose result is passed to `finish`."""
        return self._gains or self._paths

    def finish(self, work: Work | Gains, done: Any) -> None:
        """Take over the result of `work`, unless there is newer work of its kind."""
        if work is self._gains:
            self._gains = None
            if done is None:
                self.endpoint.say(
                    mavlink.MAV_SEVERITY_WARNING, "Gains not designed: the old ones are in force"
                )
            else:
                self._take_setup(done)
        elif work is self._paths:
            self._paths = None
            self._take_paths(done)

    def _take_paths(self, prepared: Prepared) -> None:
        """Take over the paths of the plan, and begin the mission if it waited for them."""
        for note in prepared.notes:
            self.endpoint.say(mavlink.MAV_SEVERITY_WARNING, note)
        self._have_prepared(prepared)
        if self.core.flight.mission.waiting:
            self._begin_mission()

    def _begin_mission(self) -> None:
        """Begin the mission that waited for its paths, or report why not."""
        verdict = self.core.ask(StartMission(None), self.now_us)
        self.endpoint.state_changed()
        if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
            self.core.change(off_mission(self.core.flight))
            text, about = verdict.text or "Mission denied", mavlink.MAV_CMD_MISSION_START
            self.endpoint.say(mavlink.MAV_SEVERITY_WARNING, text, about)

    def _have_prepared(self, prepared: Prepared) -> None:
        flight = self.core.flight
        plan = replace(flight.mission.plan, prepared=prepared)
        self.core.change(replace(flight, mission=replace(flight.mission, plan=plan)))

    def _snapshot(self) -> Moment:
        return Moment(self._moments, self.endpoint.mission, self.now_us)
