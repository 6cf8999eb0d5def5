"""One whole flight without the wire: the flight that `gcs.closed_loop` flies, many times as fast.

The tick of the world and the tick of the autopilot run in turn in machine code (`gcs.sweep.kernel`), until
the supervisor may have something to decide; then `FlightCore.decide` runs it, as in the process. The actions
of the ground station are known beforehand: the two instants at which it arms and starts the mission.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf, nan, sqrt
from typing import Any

import numpy as np

from autopilot.core.flight_core import SETPOINTS_LOCKSTEP, FlightCore, commanded_rate
from autopilot.core.tick import placeholder_law
from autopilot.estimation.inbox import new_inbox
from autopilot.geometry.entry import entry_point_of
from autopilot.geometry.packed import field_offset, pack, packed, unpack
from autopilot.guidance.jet_table import COLUMNS, flies_requested_path, jets
from autopilot.guidance.legs import LOAD_POSITION
from autopilot.onboard.onboard import GROUND_WINDOW_US, Onboard
from autopilot.onboard.path_work import path_work, use_paths
from autopilot.services.requests import Arm, StartMission
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.requests.arming import arming_problems
from autopilot.supervisor.state import IN_AIR, Phase, with_battery
from autopilot.wire.convert.battery import (
    BatteryReading,
    battery_status_message,
    percent_by_used,
    read_battery_status,
)
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.flight import READY_LIMIT_US
from gcs.closed_loop import Conditions
from gcs.closed_loop import fly as fly_with_wire
from gcs.expected_flight import limit_text
from gcs.failure_reason import AFTERMATH_US, TimedText, failure_reason
from gcs.mission_items import in_mission_terms
from gcs.sweep.cell import Cell, cell_of
from gcs.sweep.kernel import NO_FIGURES, Code, Figures, code_of_autopilot, code_of_world, fly_stretch
from gcs.sweep.step import RequestedMotions, figures_of, response_to
from gcs.sweep.wire import max_readings, rounded_reel_rate
from missions.model import Mission
from sitl.hil import HilSimulator
from sitl.plant.chain.records import new_chain
from sitl.plant.drive import share_left
from sitl.plant.records import PlantState
from sitl.world import Floats, World, new_world

TRACE_COLUMNS = 14
_NO_ROWS = np.zeros((0, COLUMNS))
_NO_PATH = np.zeros((1, COLUMNS))  # requested path of a mission step in which the load follows none
_NEVER = 2**62
_TICK, _NOW = field_offset(World, "tick"), field_offset(World, "now_us")
_RESPONSE = field_offset(Figures, "response")
_SLACK_EVENTS = field_offset(World, "plant") + field_offset(PlantState, "slack_events")
# machine code of `fly_stretch` and of the ticks that it calls, by the type of the cable's rows
_ENTRIES: dict[type, tuple[Callable[..., bool], Code]] = {}
_LOAD_CARRIED = (Phase.HOLD, Phase.MISSION, Phase.RETURN)


@dataclass(frozen=True)
class StartTimes:
    """The times at which the ground station, in lockstep, arms the vehicle and starts the mission."""

    arm_us: int
    start_us: int


@dataclass
class FlightResult:
    """The result of a flight; NaN for a figure that was not measured. Figures are those of the mission."""

    outcome: str = ""  # as `gcs fly` names it
    reason: str = ""
    lost_phase: str = ""  # phase in which it was lost, empty if it was not
    flight_s: float = nan
    mission_s: float = nan
    load_error_max_m: float = nan
    load_error_rms_m: float = nan
    tracking_error_max_m: float = nan
    rise_time_90_s: float = nan
    overshoot_pct: float = nan
    settling_time_5pct_s: float = nan
    estimator_error_max_m: float = nan
    saturated_fraction: float = nan
    psi_R_max: float = nan
    psi_q_max: float = nan
    slack_events: int = 0
    tension_min_n: float = nan
    tension_max_n: float = nan
    rotor_force_min_n: float = nan
    rotor_force_max_n: float = nan
    battery_left_pct: float = nan
    texts: list[str] = field(default_factory=list)


class _NoLog:
    """Discards the frames of a flight of which only the beginning is of interest."""

    def write(self, *_: object) -> None:
        """Discard a frame."""


def start_times(mission: Mission, conditions: Conditions) -> StartTimes:
    """The times at which the real ground station arms and starts: from a flight over the wire to then."""
    times: dict[Phase, int] = {}
    path_problem = ""

    def watch(onboard: Onboard, _: HilSimulator) -> bool:
        nonlocal path_problem
        path_problem = onboard.core.flight.mission.plan.prepared.refusal.partition(": ")[2]
        times.setdefault(onboard.phase, onboard.now_us)
        return onboard.phase not in IN_AIR

    outcome = fly_with_wire(mission, conditions, _NoLog(), watch)
    if Phase.TAUTEN not in times:
        hint = ""
        if path_problem and path_problem in outcome.reason:
            hint = " (MIS_INFEASIBLE says what becomes of a path that cannot be flown: 0 as asked, 1 slower)"
        raise ValueError(
            f"{mission.name} does not start under the conditions of the sweep: {outcome.reason}{hint}"
        )
    return StartTimes(times.get(Phase.ARMED, times[Phase.TAUTEN]), times[Phase.TAUTEN])


class SweepFlight:
    """A flight in progress."""

    def __init__(self, cell: Cell, seed: int, start_times: StartTimes, trace: Floats | None = None) -> None:
        self.cell = cell
        self.tick_us = cell.settings.tick_us
        self.core = FlightCore(cell.setup, SETPOINTS_LOCKSTEP)
        self.item = 0  # mission item that was flown last
        self.core.replace_flight(replace(with_plan(self.core.flight, cell.plan), area=cell.area))
        self.world = new_world(cell.truth, cell.profile, cell.settings, seed, cell.layout)
        self.chain = new_chain(cell.truth, unpack(World, self.world.world, 0).plant)
        self.core.use_inbox(new_inbox(max_readings(self.world)))
        self.figures = packed(NO_FIGURES)
        self.requested_path: Floats = _NO_ROWS
        self.trace = np.zeros((0, TRACE_COLUMNS)) if trace is None else trace
        self.arm_us, self.start_us = map(self._tick_from, (start_times.arm_us, start_times.start_us))
        self.result = FlightResult()
        self._warnings: list[str] = []  # the vehicle's warnings since its last decision in phase MISSION
        self._texts_in_air: list[TimedText] = []
        self.airborne_us = -1
        self.failed_us = -1  # when the vehicle reported that the flight has failed, -1: it did not
        self.mission_us = 0
        self.mission_until_us = 0
        self.motions = RequestedMotions()
        self.started = False  # the first tick has been flown

    # ---- the loop

    def run(self) -> FlightResult:
        """Fly to the end."""
        while not self.result.outcome:
            self.advance(_NEVER)
        return self.conclude()

    def advance(self, last_tick: int) -> None:
        """Fly until the supervisor or the ground station acts, at most to the end of this tick."""
        before_us, slack_before = self.now_us, self.slack_events
        self.core.move_cable(before_us + (self.tick_us if self.started else 0))
        flight = self.core.flight
        reel_rate = rounded_reel_rate(commanded_rate(flight, before_us, self.tick_us * 1e-6))
        stop_tick = min(self.stop_tick(before_us), last_tick)
        needs_decision = self._fly(self.started, False, flight.cable.released, reel_rate, stop_tick)
        self.started = True
        now_us = self.now_us
        self._account(flight.phase, now_us - before_us, self.slack_events - slack_before)
        if needs_decision:
            self._decide(now_us)
            self._fly(True, True, False, 0.0, self.tick)
        self.core.raise_interruption()
        self._ground_turn(now_us)
        self._check_end(now_us)

    def account_lane_ticks(self, ticks: int, slack_before: int) -> None:
        """Account for ticks that were flown in lanes: times and slack events, the ground station, the end."""
        now_us = self.now_us
        self._account(self.core.flight.phase, ticks * self.tick_us, self.slack_events - slack_before)
        self._ground_turn(now_us)
        self._check_end(now_us)

    def _fly(
        self, started: bool, decided: bool, gripper_open: bool, reel_rate: float, stop_tick: int
    ) -> bool:
        fly, code = self._entry()
        arguments = (started, decided, gripper_open, reel_rate, self.core.reeling, stop_tick, self.chain)
        return fly(code, self.world, self.core.rows, self.core.law, *self._flight_rows, *arguments)

    @property
    def _flight_rows(self) -> tuple[Any, ...]:
        return self.cell.wire, self.figures, self.requested_path, self.trace

    def _entry(self) -> tuple[Callable[..., bool], Code]:
        cable_type = type(self.chain)
        if cable_type not in _ENTRIES:
            world, core, law = self.world, self.core.rows, placeholder_law(self.core.law_rows)
            code = Code(code_of_world(world, self.chain), code_of_autopilot(core, law))
            arguments = (False, False, False, 0.0, self.core.reeling, 0, self.chain)
            _ENTRIES[cable_type] = (
                entry_point_of(fly_stretch, code, world, core, law, *self._flight_rows, *arguments),
                code,
            )
        return _ENTRIES[cable_type]

    def compile(self) -> None:
        """Compile or load the machine code that is the same for all laws."""
        self._entry()

    @property
    def tick(self) -> int:
        """The present tick."""
        return int(self.world.world[_TICK])

    @property
    def now_us(self) -> int:
        """The time of the present tick."""
        return int(self.world.world[_NOW])

    @property
    def slack_events(self) -> int:
        """How often the cable has gone slack so far."""
        return int(self.world.world[_SLACK_EVENTS])

    def stop_tick(self, now_us: int) -> int:
        """The tick after which the ground station has something to do, or the time limit has passed."""
        until_us = now_us + self.cell.limit_us
        if self.airborne_us >= 0:
            until_us = self.airborne_us + self.cell.limit_us + self.tick_us
        failure_ends_us = self.failed_us + AFTERMATH_US if self.failed_us >= 0 else -1
        for time_us in (self.arm_us, self.start_us, failure_ends_us):
            if now_us < time_us < until_us:
                until_us = time_us
        return -(-until_us // self.tick_us)

    def _account(self, phase: Phase, elapsed_us: int, slack_events: int) -> None:
        """Add time and slack events of a stretch that was flown in this phase, before the flight failed."""
        if self.failed_us >= 0:
            return
        if phase in _LOAD_CARRIED:
            self.result.slack_events += slack_events
        if phase == Phase.MISSION:
            self.mission_us += elapsed_us
            self.mission_until_us = self.now_us
            mission = self.core.flight.mission
            self.item = mission.plan.sequence[mission.step]

    def _decide(self, now_us: int) -> None:
        """The supervisor's part of a tick; in the mission also the requested path of the next stretch."""
        if self.core.is_reeling:  # the loop has moved the cable since the last decision
            self.core.move_cable(now_us)
        self._measure_battery()
        phase = self.core.flight.phase
        self._on_texts(self.core.decide(now_us, self.tick_us).texts, phase, now_us)
        flight = self.core.flight
        self.requested_path = _NO_ROWS
        if flight.phase != Phase.MISSION or not flight.legs or self.failed_us >= 0:
            return
        if flight.legs[0].control_mode != LOAD_POSITION:
            self.requested_path = _NO_PATH
            return
        leg, planned = flight.legs[0], self.core.planned
        assert planned is not None, "positions of the load are planned"
        self.requested_path = (
            self.core.rows.targets
            if flies_requested_path(leg)
            else jets(leg, planned.times_s, requested=True)
        )
        step = self.motions.add(leg, flight.leg_start_us, planned.period_us)
        if step is not None:
            pack(response_to(step), self.figures, _RESPONSE)

    @property
    def _share_left(self) -> float:
        """The share of its charge that the simulated battery has left."""
        return share_left(unpack(World, self.world.world, 0).supply, self.cell.truth.drive)

    @property
    def _percent_left(self) -> float:
        """The same in per cent, as the record of a flight has it: by the charge used as it is reported."""
        drive, used_as = self.cell.truth.drive, unpack(World, self.world.world, 0).supply.used_as
        sent = battery_status_message(BatteryReading(used_mah=used_as / 3.6, remaining=self._share_left))
        return percent_by_used(read_battery_status(sent), 100.0 * drive.charge, drive.capacity_as / 3.6)

    def _measure_battery(self) -> None:
        """What the autopilot learns of the battery, which the simulator sends it over the wire."""
        if self.cell.truth.drive.battery > 0.0:
            reading = BatteryReading(remaining=self._share_left)
            levels = self.core.settings.battery.levels
            self.core.replace_flight(with_battery(self.core.flight, reading, levels))

    # ---- what the ground station does

    def _tick_from(self, time_us: int) -> int:
        """The time of the first tick that is not before this time, at any rate of the simulator."""
        return -(-time_us // self.tick_us) * self.tick_us

    def _ground_turn(self, now_us: int) -> None:
        """Arm and start at their instants; as long as the vehicle is not ready to be armed, postpone both."""
        if now_us not in (self.arm_us, self.start_us):
            return
        self._measure_battery()
        phase = self.core.flight.phase
        if now_us == self.arm_us and phase == Phase.DISARMED:
            problems = arming_problems(self.core.flight, self.core.view(now_us), self.core.settings)
            if problems and now_us < READY_LIMIT_US:
                self.arm_us = self._tick_from(self.arm_us + GROUND_WINDOW_US)
                self.start_us = self._tick_from(self.start_us + GROUND_WINDOW_US)
                return
            self._request(Arm(arm=True, force=False), now_us)
        elif now_us == self.start_us and phase == Phase.ARMED:
            self._request(StartMission(0), now_us)
            self.airborne_us = now_us

    def _request(self, request: Arm | StartMission, now_us: int) -> None:
        verdict = self.core.handle_request(request, now_us)
        if self.core.flight.mission.waiting:  # for paths from where the vehicle believes it stands
            use_paths(self.core, path_work(self.core, now_us).run())
            verdict = self.core.handle_request(StartMission(None), now_us)
        if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
            self._end("refused", verdict.text or "")

    # ---- how it ends

    def _end(self, outcome: str, reason: str, lost_phase: str = "") -> None:
        """End the flight; the reason is stated with the item numbers of the mission file."""
        result = self.result
        result.outcome, result.reason = outcome, in_mission_terms(reason, self.cell.mission)
        result.lost_phase = lost_phase

    def _on_texts(self, texts: tuple[tuple[int, str], ...], phase: Phase, now_us: int) -> None:
        if phase == Phase.MISSION:
            self._warnings.clear()
        for severity, text in texts:
            self.result.texts.append(text)
            if severity <= mavlink.MAV_SEVERITY_WARNING:
                self._warnings.append(text)
            if self.airborne_us >= 0:
                self._texts_in_air.append(TimedText(now_us, severity, text))
        if texts and self.failed_us < 0 and failure_reason(self._texts_in_air):
            self.failed_us = now_us
            self.result.lost_phase = phase.name.lower()

    def _check_end(self, now_us: int) -> None:
        flight = self.core.flight
        if self.result.outcome:
            return
        if self.failed_us >= 0:
            if now_us - self.failed_us >= AFTERMATH_US:
                self._end("diverged", failure_reason(self._texts_in_air), self.result.lost_phase)
            return
        if self.airborne_us >= 0 and flight.phase == Phase.DISARMED:
            self._end_landed()
        elif self.airborne_us >= 0 and now_us - self.airborne_us > self.cell.limit_us:
            where: str = flight.phase.name.lower()
            limit = limit_text(self.cell.limit_us * 1e-6)
            late = f"not landed after {limit} of flight: still in phase {where}"
            warnings = dict.fromkeys(self._warnings) if flight.phase != Phase.MISSION else ()
            self._end("timeout", "; ".join([*warnings, late]), where)
        elif self.airborne_us < 0 and now_us > self.start_us + self.cell.limit_us:
            where = flight.phase.name.lower()
            self._end("timeout", f"not started after {limit_text(now_us * 1e-6)}: still {where}", where)

    def _end_landed(self) -> None:
        """End the flight of a vehicle that was disarmed, with outcome and reason as in `gcs fly`."""
        if self.core.flight.mission.done:
            self._end("completed", "")
            return
        where = f"item {self.item} of {self.cell.item_count - 1}"
        ended = f"the vehicle was disarmed before the end of the mission, at {where}"
        self._end("interrupted", "; ".join([*dict.fromkeys(self._warnings), ended]))

    def conclude(self) -> FlightResult:
        """Compute the figures of the flight and return its result."""
        result, f = self.result, unpack(Figures, self.figures, 0)
        if self.airborne_us >= 0:
            end_us = self.failed_us if self.failed_us >= 0 else self.now_us
            result.flight_s = (end_us - self.airborne_us) * 1e-6
        result.mission_s = self.mission_us * 1e-6
        if f.samples > 0.0:
            result.load_error_max_m = f.error_max
            result.tracking_error_max_m = f.tracking_max
            result.load_error_rms_m = sqrt(f.error_square / f.samples)
        if self.motions.are_one_step(self.mission_until_us * 1e-6):
            result.rise_time_90_s, result.overshoot_pct, result.settling_time_5pct_s = figures_of(f.response)
        if f.tension_min < inf:
            result.estimator_error_max_m = f.estimator_error_max
            result.tension_min_n, result.tension_max_n = f.tension_min, f.tension_max
        if f.ticks > 0.0:
            result.saturated_fraction = f.saturated / f.ticks
            result.psi_R_max, result.psi_q_max = f.psi_R_max or nan, f.psi_q_max or nan  # 0: not defined
            result.rotor_force_min_n, result.rotor_force_max_n = f.rotor_min, f.rotor_max
        if self.cell.truth.drive.battery > 0.0:
            result.battery_left_pct = self._percent_left
        return result


def fly(
    mission: Mission, conditions: Conditions, start_times: StartTimes, trace: Floats | None = None
) -> FlightResult:
    """Fly a mission from take-off to landing under these conditions.

    `trace` (ticks, TRACE_COLUMNS) receives the true state at each tick, for tests: x_load, x_quad, quat_wxyz,
    rotor_force.
    """
    return SweepFlight(cell_of(mission, conditions), conditions.seed, start_times, trace).run()
