"""One whole flight as a state machine: find the vehicle, upload, arm, fly, and report how it ended.

    stage     what happens                               then      if the vehicle refuses
    FIND      wait for its heartbeat                      STREAMS   -
    STREAMS   request the fast messages of the report     UPLOAD    UPLOAD
    UPLOAD    upload the mission                          READY     OVER refused
    READY     wait for its pre-arm health bit, a while    ARM       -
    ARM       rotors on                                   START     OVER refused
    START     start the mission                           FLY       DISARM
    FLY       until landed and disarmed, or lost          OVER      -
              disarmed since it was armed                 ARM
    DISARM    rotors off again                            OVER      OVER

Once the vehicle flies, time limits run on its clock, so that they hold at any speed of simulation.

From STREAMS until the vehicle flies, its parameters are also requested, for the record; no stage waits for
them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Literal

from autopilot.wire.codec import FieldReader, Received
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from gcs.clients import command
from gcs.clients.connection import LINK_TIMEOUT_US, Connection
from gcs.clients.missions import MissionUpload
from gcs.clients.operation import Operation, Result, Status
from gcs.clients.parameter_transfer import ParameterList
from gcs.clients.vehicle_view import VehicleView
from gcs.expected_flight import limit_text, time_limit_s
from gcs.failure_reason import AFTERMATH_US, TimedText, failure_reason
from gcs.mission_items import in_mission_terms
from missions.model import Mission

REPORT_INTERVAL_US = 8_000
REPORT_MESSAGES = (
    mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT,
    mavlink.MAVLINK_MSG_ID_CASCADE_ERRORS,
    mavlink.MAVLINK_MSG_ID_ROTOR_STATE,
    mavlink.MAVLINK_MSG_ID_LOAD_STATE,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
)
FIND_LIMIT_US = 30_000_000
READY_LIMIT_US = 20_000_000  # then arming is requested nevertheless, and the vehicle reports what is wrong

OutcomeName = Literal["completed", "diverged", "refused", "timeout", "lost", "interrupted"]


@dataclass(frozen=True)
class Outcome:
    """How the flight ended, and the reason if it did not complete."""

    name: OutcomeName
    reason: str = ""

    def with_reason(self, reason_before: str) -> Outcome:
        """The outcome with `reason_before`, if not empty, in front of its reason."""
        return (
            replace(self, reason="; ".join(filter(None, (reason_before, self.reason))))
            if reason_before
            else self
        )

    def in_mission_terms(self, mission: Mission) -> Outcome:
        """The outcome with its reason in the mission's terms; the vehicle counts the uploaded items."""
        return replace(self, reason=in_mission_terms(self.reason, mission))


class Stage(Enum):
    FIND = "looking for the vehicle"
    STREAMS = "asking for telemetry"
    UPLOAD = "uploading the mission"
    READY = "waiting for the vehicle to be ready"
    ARM = "arming"
    START = "starting the mission"
    FLY = "flying"
    DISARM = "disarming"
    OVER = "over"


@dataclass(frozen=True)
class Progress:
    """Progress of the flight. `phase` is the stage until the vehicle flies, then the phase it reports."""

    stage: Stage
    phase: str
    item: int  # mission item being flown
    items: int
    fraction: float  # of the whole, 0 ... 1
    load_error_m: float | None
    rotor_use: float | None  # 1.0: a rotor at its limit
    sim_time_s: float  # the vehicle's clock
    text: str  # the last status text of the vehicle


@dataclass(frozen=True)
class StageRow:
    """A stage of the table."""

    next_stage: Stage
    stage_if_refused: Stage = Stage.OVER
    operations: Callable[[FlightClient], Sequence[Operation]] | None = None
    is_done: Callable[[FlightClient], bool] | None = None  # awaited after the operations have ended
    obstacle: Callable[[FlightClient], str] | None = (
        None  # why the flight cannot continue from here, or empty
    )
    limit_us: int | None = None
    on_timeout: Callable[[FlightClient], Outcome] | None = None


class FlightClient:
    """Flies `items`, which begin with a take-off and end with a landing.

    `expected_s` is how long the flight should take and `limit_s` how long it may take, by the vehicle's
    clock; `link_timeout_us` is how long the vehicle may be silent, by the ground station's clock. `areas`:
    fence and rally points by their MAV_MISSION_TYPE, which replace those of the vehicle.
    """

    def __init__(
        self,
        items: Sequence[WireItem],
        expected_s: float,
        limit_s: float | None = None,
        link_timeout_us: int = LINK_TIMEOUT_US,
        areas: Mapping[int, Sequence[WireItem]] = MappingProxyType({}),
    ) -> None:
        self.outcome: Outcome | None = None
        self.fell_silent = False  # the vehicle fell silent, which ended the flight
        self.started = False  # the vehicle was armed
        self.stage = Stage.FIND
        self.view = VehicleView()
        self.connection = Connection(link_timeout_us)
        self.items = tuple(items)
        self.areas = areas
        self._expected_s = expected_s
        self._limit_s = time_limit_s(expected_s, limit_s)
        self._operations: list[Operation] = []
        self._parameters: ParameterList | None = None  # while they are being requested
        self._stage_start_us: int | None = None  # the ground station's clock
        self._flight_start_us: int | None = None  # the vehicle's clock
        self._texts: list[TimedText] = []  # those of the view, by the vehicle's clock
        self._texts_before = 0  # texts that came before this stage; while flying, before take-off
        self._texts_armed = 0  # texts that came before arming
        self._was_armed = False
        self._last_armed: bytes | None = None  # the last heartbeat by which `_was_armed` was decided
        self._disarmed_heartbeats = 0  # of a vehicle that has not been armed since it accepted the start
        self._rearms = 0
        self._was_airborne = False
        self._mission_over = False
        self._is_manual = False  # the user controls the flight through this client
        self._last_heartbeat: bytes | None = None  # the last heartbeat that was examined
        self._in_mission = False  # the vehicle has flown the mission
        self._mode_after_mission = ""  # the mode for which it has left the mission
        self._texts_in_mission = 0  # texts that came before the last heartbeat in mission mode
        self._item_flown = 0  # the last one in the air
        self._setpoint: tuple[int, int] | None = None  # phase and item of the last setpoint
        self._failure = ""  # why the autopilot has given up
        self._failed_us: int | None = None  # the vehicle's clock at the failure
        self._pending_outcome: Outcome | None = None  # the outcome, once the vehicle is disarmed again

    # ---- what differs between autopilots

    @property
    def watched_messages(self) -> frozenset[int]:
        """Messages from which the state of the flight is derived."""
        return _WATCHED

    def stage_row(self, stage: Stage) -> StageRow:
        """The row of the table above."""
        return _TABLE[stage]

    # ---- in and out

    def receive(self, datagram: bytes, now_us: int) -> None:
        """Process a datagram of the vehicle."""
        for one in self.connection.receive(datagram, now_us):
            if one.id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and (
                one.component != getattr(self.connection.target, "component", None)
            ):
                continue
            self.view.update(one, now_us)
            if len(self._texts) < len(self.view.texts):
                told = self.view.texts[-1]
                self._texts.append(TimedText(self.view.time_us or 0, told.severity, told.text))
            if self._operations:
                self._operations[0].receive(one.message, now_us)
            if self._parameters is not None and one.id == mavlink.MAVLINK_MSG_ID_PARAM_VALUE:
                self._parameters.receive(one.message, now_us)
            if self.stage is Stage.FLY and one.id in self.watched_messages and self._has_changed(one):
                self._update_facts()

    def poll(self, now_us: int) -> list[bytes]:
        """Advance to `now_us`; return the datagrams to send now."""
        if self.outcome is not None:
            return []
        datagrams = self.connection.poll(now_us)
        if self._stage_start_us is None:
            self._stage_start_us = now_us
        if self.connection.lost(now_us):
            self.fell_silent = True
            self._end(Outcome("lost", f"the vehicle fell silent while {self.stage.value}"))
        while self.outcome is None and self._advance(now_us):
            pass
        for operation in (*self._operations[:1], *filter(None, (self._parameters,))):
            datagrams += [self.connection.frame(message) for message in operation.poll(now_us)]
        return datagrams

    @property
    def silent_until_us(self) -> int:
        """Time on the ground station's clock until which `poll` sends nothing, whatever is received; 0: not
        known."""
        return self.connection.next_heartbeat_us if self.stage is Stage.FLY else 0

    def start_manual_control(self) -> None:
        """The user takes control of the flight: it has no time limit from now on."""
        self._limit_s = math.inf
        self._is_manual = True

    def interrupt(self, reason: str = "stopped by the user") -> None:
        """End the flight from outside, if it has not ended."""
        if self.outcome is None:
            self._end(self._failure_outcome() or Outcome("interrupted", reason))

    def end_as_lost(self, reason: str) -> None:
        """End the flight because a process or the link is gone."""
        if self.outcome is None:
            self._end((self._failure_outcome() or Outcome("lost")).with_reason(reason))

    def explain_silence(self, explanation: str) -> None:
        """Add to the outcome why the vehicle fell silent, if it did; `explanation` is empty if that is not
        known."""
        if self.fell_silent and self.outcome is not None:
            self.outcome = self.outcome.with_reason(explanation)

    # ---- the table at work

    def _advance(self, now_us: int) -> bool:
        """Finish the current operation or stage if it has ended; True if something changed."""
        if self.stage is Stage.FLY:
            return self._check_end(now_us)
        row = self.stage_row(self.stage)
        if self._operations:
            result = self._operations[0].result
            if result is None:
                return False
            if result.status is Status.REFUSED:
                self._refused(row, result, now_us)
                return True
            if result.status is Status.UNANSWERED:
                self._end(Outcome("lost", result.silence_text(self.connection.signatures.problem)))
                return True
            self._operations.pop(0)
            return True
        if row.is_done is None or row.is_done(self):
            reason = row.obstacle(self) if row.obstacle else ""
            if reason:
                self._end(Outcome("refused", reason))
            else:
                self._enter(row.next_stage, now_us)
            return True
        start_us = self._stage_start_us if self._stage_start_us is not None else now_us
        if row.limit_us is not None and now_us - start_us > row.limit_us:
            if row.on_timeout is None:
                self._enter(row.next_stage, now_us)
            else:
                self._end(row.on_timeout(self))
            return True
        return False

    def _refused(self, row: StageRow, result: Result, now_us: int) -> None:
        if row.stage_if_refused is row.next_stage:  # the flight continues without it
            self._operations.pop(0)
            return
        reasons = self.view.problems_since(self._texts_before)
        outcome = self._pending_outcome or Outcome("refused", result.refusal_text(reasons))
        if row.stage_if_refused is Stage.OVER:
            self._end(outcome)
        else:
            self._pending_outcome = outcome
            self._enter(row.stage_if_refused, now_us)

    def _enter(self, stage: Stage, now_us: int) -> None:
        if stage is Stage.START and self._rearms:
            stage = Stage.FLY  # it has accepted the start, and begins when it is armed
        if stage is Stage.OVER:
            self._end(self._pending_outcome or Outcome("completed"))
            return
        self.stage = stage
        self._stage_start_us = now_us
        self._texts_before = len(self.view.texts)
        self.started = self.started or stage is Stage.START
        if stage is Stage.ARM:
            self._texts_armed = len(self.view.texts)
        if stage is Stage.STREAMS and self.connection.target is not None:
            self._parameters = ParameterList(self.connection.target)
        if stage is Stage.FLY:
            self._flight_start_us = self.view.time_us
            # this one may be of before the start
            self._last_armed = self.view.latest.frame(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
            self._operations, self._parameters = [], None
            return
        operations = self.stage_row(stage).operations
        self._operations = list(operations(self)) if operations else []

    def _end(self, outcome: Outcome) -> None:
        self.outcome = outcome
        self.stage = Stage.OVER
        self._operations, self._parameters = [], None

    # ---- the flight itself

    def _has_changed(self, one: Received) -> bool:
        """Whether a watched message may contain something new compared with the last of its kind."""
        if one.id != mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT:
            return True
        before, self._setpoint = self._setpoint, (_PHASE.read(one.frame), _SEQ.read(one.frame))
        return self._setpoint != before

    def _update_facts(self) -> None:
        """Record facts from the latest messages, which the next messages may no longer contain."""
        view = self.view
        phase = view.phase
        self._update_mode()
        self._update_armed()
        if phase is not None and phase not in _GROUND_PHASES and not self._was_airborne:
            self._was_airborne = True
            self._texts_before = len(view.texts)
        if view.mission_state == "complete":
            self._mission_over = True
        reached = view.latest.get("MISSION_ITEM_REACHED")
        if reached is not None and self._was_airborne and reached.seq == len(self.items) - 1:
            self._mission_over = True
        setpoint = view.latest.get("LOAD_SETPOINT")
        if setpoint is not None and setpoint.phase not in _GROUND_PHASES:
            self._item_flown = setpoint.seq
        if setpoint is not None and setpoint.phase in _LANDING_PHASES:
            self._mission_over = self._mission_over or setpoint.seq == len(self.items) - 1
        self._failure = self._present_failure() or self._failure
        if self._failure and self._failed_us is None:
            self._failed_us = view.time_us or 0

    def _update_armed(self) -> None:
        """Record whether the vehicle was armed, or how often it has stated that it is not."""
        heartbeat = self.view.latest.frame(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        if self._was_armed or heartbeat == self._last_armed:
            return
        self._last_armed, self._was_armed = heartbeat, bool(self.view.armed)
        self._disarmed_heartbeats += not self._was_armed

    def _update_mode(self) -> None:
        """Record if the vehicle leaves the mission mode, which this client never requests, and for which
        mode."""
        view = self.view
        heartbeat = view.latest.frame(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        if heartbeat == self._last_heartbeat or not view.armed:
            return
        self._last_heartbeat = heartbeat
        if view.mode in _MISSION_MODES:
            self._in_mission, self._mode_after_mission, self._texts_in_mission = True, "", len(view.texts)
        elif self._in_mission:
            self._mode_after_mission = view.mode or ""

    def _why_mission_was_left(self) -> str:
        """Why the vehicle left the mission: its own reason if it reported one, else a command by another
        ground station."""
        if not self._mode_after_mission or self._is_manual:
            return ""
        reasons = self.view.problems_since(self._texts_in_mission)
        action = _ACTION_OF_MODE.get(self._mode_after_mission, f"mode {self._mode_after_mission}")
        return "; ".join(reasons) or f"{action} commanded by another ground station"

    def _present_failure(self) -> str:
        """Why the autopilot has given up; empty if it has not."""
        if self.view.phase == _FAILSAFE:
            return failure_reason(self._texts[self._texts_armed :]) or "the autopilot went into failsafe"
        return failure_reason(self._texts[self._texts_before :]) if self._was_airborne else ""

    def _failure_outcome(self) -> Outcome | None:
        """The outcome of a flight that has failed, or is being refused; None of any other."""
        return Outcome("diverged", self._failure) if self._failure else self._pending_outcome

    def _check_end(self, ground_us: int) -> bool:
        """End the flight if an end condition holds, or arm the vehicle again; True if one of both was done.
        `ground_us`: the ground station's clock."""
        view = self.view
        now_us = view.time_us
        if now_us is None:
            return False
        if self._flight_start_us is None:
            self._flight_start_us = now_us
        if self._failed_us is not None:
            if now_us - self._failed_us < AFTERMATH_US:
                return False
            self._end(Outcome("diverged", self._failure))
            return True
        if self._was_armed and view.armed is False:
            self._end(self._landed_outcome())
            return True
        if self._disarmed_heartbeats >= _DISARMED_HEARTBEATS and self._rearms < _REARMS:
            self._rearms += 1
            self._disarmed_heartbeats = 0
            self._enter(Stage.ARM, ground_us)
            return True
        if now_us - self._flight_start_us > self._limit_s * 1e6:
            where = f"still in phase {view.phase_name or 'unknown'}, item {self._item()}"
            limit = limit_text(self._limit_s)
            outcome = Outcome("timeout", f"not landed after {limit} of flight: {where}")
            self._end(outcome.with_reason(self._why_mission_was_left()))
            return True
        return False

    def _landed_outcome(self) -> Outcome:
        if self._mission_over:
            return Outcome("completed")
        if self._was_airborne:
            where = f"item {self._item_flown} of {len(self.items) - 1}"
            outcome = Outcome(
                "interrupted", f"the vehicle was disarmed before the end of the mission, at {where}"
            )
            return outcome.with_reason(self._why_mission_was_left())
        reasons = self.view.problems_since(self._texts_armed)
        return Outcome("refused", "; ".join(["the vehicle disarmed before take-off", *reasons]))

    # ---- progress for display

    @property
    def progress(self) -> Progress:
        view = self.view
        flying = self._flight_start_us is not None
        time_us = view.time_us or 0
        fraction = 0.0
        if self.outcome is not None and self.outcome.name == "completed":
            fraction = 1.0
        elif self._flight_start_us is not None and self._expected_s > 0.0:
            fraction = min(1.0, (time_us - self._flight_start_us) * 1e-6 / self._expected_s)
        return Progress(
            stage=self.stage,
            phase=(view.phase_name or self.stage.value) if flying else self.stage.value,
            item=self._item(),
            items=len(self.items),
            fraction=fraction,
            load_error_m=view.load_error_m if flying else None,
            rotor_use=view.rotor_use if flying else None,
            sim_time_s=time_us * 1e-6,
            text=view.texts[-1].text if view.texts else "",
        )

    def _item(self) -> int:
        if self._mission_over:  # then the vehicle counts from the beginning again
            return len(self.items) - 1
        setpoint = self.view.latest.get("LOAD_SETPOINT")
        return int(setpoint.seq) if setpoint is not None and self._flight_start_us is not None else 0


# On a busy machine, a simulation that is faster than the wall clock may disarm the vehicle again before the
# start arrives: it then waits to be armed. The first heartbeat may be older than the arming.
_DISARMED_HEARTBEATS, _REARMS = 2, 3
_FAILSAFE = mavlink.PLUMBLINE_PHASE_FAILSAFE
_MISSION_MODES = ("mission", "auto")  # of PX4 and of ArduPilot
_ACTION_OF_MODE = {"land": "landing", "return": "return", "rtl": "return", "hold": "hold", "guided": "hold"}
_GROUND_PHASES = {mavlink.PLUMBLINE_PHASE_DISARMED, mavlink.PLUMBLINE_PHASE_ARMED}
_WATCHED = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    }
)
_PHASE, _SEQ = (FieldReader(mavlink.MAVLink_load_setpoint_message, name) for name in ("phase", "seq"))
_LANDING_PHASES = {mavlink.PLUMBLINE_PHASE_LOWER, mavlink.PLUMBLINE_PHASE_SET_DOWN}


def _streams(client: FlightClient) -> list[Operation]:
    assert client.connection.target is not None
    return [
        command.message_interval(client.connection.target, message_id, REPORT_INTERVAL_US)
        for message_id in REPORT_MESSAGES
    ]


def _upload(client: FlightClient) -> list[Operation]:
    assert client.connection.target is not None
    # the mission last: the vehicle checks it against the fence
    return [
        *(MissionUpload(client.connection.target, items, kind) for kind, items in client.areas.items()),
        MissionUpload(client.connection.target, client.items),
    ]


def _arm(client: FlightClient) -> list[Operation]:
    target = client.connection.target
    assert target is not None
    # a take-off that somebody has requested before, and that would begin instead of the mission
    withdrawal = [command.disarm(target)] if client.view.mode == "takeoff" else []
    return [*withdrawal, command.arm(target)]


def _one_operation(make: Callable[..., Operation]) -> Callable[[FlightClient], list[Operation]]:
    return lambda client: [make(client.connection.target)]


def _is_found(client: FlightClient) -> bool:
    return client.connection.target is not None and client.view.armed is not None


def _already_armed(client: FlightClient) -> str:
    return "the vehicle is armed already; land and disarm it first" if client.view.armed else ""


def _is_ready(client: FlightClient) -> bool:
    return client.view.ready_to_arm is True


def _not_found(client: FlightClient) -> Outcome:
    return Outcome("lost", f"no vehicle was heard within {FIND_LIMIT_US / 1e6:.0f} s")


_TABLE = {
    Stage.FIND: StageRow(
        Stage.STREAMS,
        is_done=_is_found,
        obstacle=_already_armed,
        limit_us=FIND_LIMIT_US,
        on_timeout=_not_found,
    ),
    Stage.STREAMS: StageRow(Stage.UPLOAD, stage_if_refused=Stage.UPLOAD, operations=_streams),
    Stage.UPLOAD: StageRow(Stage.READY, operations=_upload),
    Stage.READY: StageRow(Stage.ARM, is_done=_is_ready, limit_us=READY_LIMIT_US),
    Stage.ARM: StageRow(Stage.START, operations=_arm),
    # repeated late, by the clock of a simulation that is faster than the wall clock, it begins nothing again
    Stage.START: StageRow(
        Stage.FLY, stage_if_refused=Stage.DISARM, operations=_one_operation(command.fly_mission)
    ),
    Stage.DISARM: StageRow(Stage.OVER, operations=_one_operation(command.disarm)),
}
