"""One whole flight without the wire: the flight that `gcs.closed_loop` flies, many times as fast.

The tick of the world and the tick of the autopilot run in turn in machine code (`gcs.sweep.kernel`), until
the supervisor may have something to decide; then `FlightCore.decide` lets it, as in the process. The ground
station's part is known beforehand: the two instants at which it arms and starts the mission.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import nan, sqrt

import numpy as np

from autopilot.core.flight_core import FlightCore, commanded_rate
from autopilot.core.scheduler import divider
from autopilot.estimation.inbox import new_inbox
from autopilot.geometry.packed import packed, unpack
from autopilot.guidance.layout import COLUMNS, jets
from autopilot.guidance.legs import LOAD_POSITION
from autopilot.onboard.onboard import Onboard, build_setup, plan_of
from autopilot.services.mission_store import StoredMission
from autopilot.services.requests import Arm, StartMission
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.quiescence import Stretch
from autopilot.supervisor.requests.arming import arming_complaints
from autopilot.supervisor.state import IN_AIR, MissionPlan, Phase
from autopilot.trajectory.prepare import Limits
from autopilot.trajectory.timeline import expected_duration_s
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import apply_settings, autopilot_parameters
from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, encode_mission
from gcs.clients.flight import READY_LIMIT_US, TIME_FACTOR, TIME_MARGIN_S
from gcs.closed_loop import Conditions
from gcs.closed_loop import fly as fly_with_wire
from gcs.sweep.kernel import NO_FIGURES, Figures, fly_stretch
from gcs.sweep.plan import simulated
from gcs.sweep.wire import most_readings, wire_of, wire_rate
from missions.model import Mission
from sitl.hil import HilSimulator
from sitl.sensors.files import load_profile
from sitl.sensors.profile import Profile
from sitl.settings import settings_of
from sitl.vehicles.sim_parameters import apply as apply_parameters
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth
from sitl.world import Floats, World, new_world

GROUND_WINDOW_US = 20_000  # between two turns of the ground station
LAID_OUT = 1000  # setpoints laid out at once
TRACE_COLUMNS = 14
_NO_ROWS = np.zeros((0, COLUMNS))
_LOAD_CARRIED = (Phase.HOLD, Phase.MISSION, Phase.RETURN)


@dataclass(frozen=True)
class Boarding:
    """When the ground station, in lockstep, arms the vehicle and starts the mission."""

    arm_us: int
    start_us: int


@dataclass
class Flown:
    """What became of a flight; NaN for a figure that nothing was measured of. Figures are of the mission."""

    outcome: str = ""  # as `gcs fly` names it
    reason: str = ""
    lost_phase: str = ""  # phase in which it was lost, empty if it was not
    flight_s: float = nan
    mission_s: float = nan
    load_error_max_m: float = nan
    load_error_rms_m: float = nan
    tracking_error_max_m: float = nan
    estimator_error_max_m: float = nan
    saturated_fraction: float = nan
    psi_R_max: float = nan
    psi_q_max: float = nan
    slack_events: int = 0
    tension_min_n: float = nan
    tension_max_n: float = nan
    rotor_force_min_n: float = nan
    rotor_force_max_n: float = nan
    texts: list[str] = field(default_factory=list)


class _NoLog:
    """Takes the frames of a flight of which only the beginning is of interest."""

    def write(self, *_: object) -> None:
        """Forget them."""


def boarding(mission: Mission, conditions: Conditions) -> Boarding:
    """When the real ground station would arm and start: from the real dialogue, flown until then."""
    times: dict[Phase, int] = {}

    def watch(onboard: Onboard, _: HilSimulator) -> bool:
        times.setdefault(onboard.phase, onboard.now_us)
        return onboard.phase not in IN_AIR

    outcome = fly_with_wire(mission, conditions, _NoLog(), watch)
    if Phase.TAUTEN not in times:
        raise ValueError(f"{mission.name} does not start under the conditions of the sweep: {outcome.reason}")
    return Boarding(times.get(Phase.ARMED, times[Phase.TAUTEN]), times[Phase.TAUTEN])


@lru_cache(maxsize=8)
def _profile(name: str) -> Profile:
    return load_profile(name)


@lru_cache(maxsize=64)
def _plan(items: tuple[WireItem, ...], limits: Limits) -> MissionPlan:
    """Shaping paths takes seconds; it depends on nothing else."""
    return plan_of(StoredMission(items), Home(), limits)


class _Flight:
    """A flight on its way."""

    def __init__(
        self, mission: Mission, conditions: Conditions, boarding: Boarding, trace: Floats | None
    ) -> None:
        home = Home()
        table = autopilot_parameters(load_vehicle(conditions.vehicle))
        apply_settings(table, conditions.settings.items())
        truth = load_truth(conditions.vehicle)
        sim_table = sim_parameters(truth)
        for name, value in simulated(conditions.settings).items():
            sim_table.set(name, value)
        settings = settings_of(sim_table)
        profile = _profile(conditions.sensors)
        self.tick_us = settings.tick_us
        every = divider(1e6 / self.tick_us, table["CTL_RATE_HZ"], "CTL_RATE_HZ")
        self.core = FlightCore(build_setup(table, every), LAID_OUT)
        items = tuple(encode_mission(mission, home))
        self.items = len(items)
        self.item = 0  # of the mission, last flown
        plan = _plan(items, self.core.setup.settings.limits)
        self.core.change(with_plan(self.core.flight, plan))
        self.world = new_world(apply_parameters(truth, sim_table), profile, settings, conditions.seed)
        self.core.take_inbox(new_inbox(most_readings(self.world)))
        self.wire = packed(wire_of(profile, settings.noise_scale, home))
        self.figures = packed(NO_FIGURES)
        self.asked: Floats = _NO_ROWS
        self.trace = np.zeros((0, TRACE_COLUMNS)) if trace is None else trace
        self.arm_us, self.start_us = boarding.arm_us, boarding.start_us
        self.limit_us = round(1e6 * (expected_duration_s(mission) * TIME_FACTOR + TIME_MARGIN_S))
        self.flown = Flown()
        self.airborne_us = -1
        self.mission_us = 0
        self.slack_events = 0  # of the plant, so far

    # ---- the loop

    def run(self) -> Flown:
        """Fly to the end."""
        begun = False
        while not self.flown.outcome:
            phase = self.core.flight.phase
            before = self._now()
            self.core.move_cable(before.now_us + (self.tick_us if begun else 0))
            flight = self.core.flight
            reel_rate = wire_rate(commanded_rate(flight, before.now_us, self.tick_us * 1e-6))
            undecided = self._fly(begun, False, flight.cable.released, reel_rate, self._stop_tick())
            begun = True
            now = self._now()
            self._note(phase, before, now)
            if undecided:
                self._decide(now.now_us)
                self._fly(True, True, False, 0.0, now.tick)
            self._ground_turn(now.now_us)
            self._judge(now.now_us)
        self._conclude()
        return self.flown

    def _fly(self, begun: bool, decided: bool, gripper_open: bool, reel_rate: float, stop_tick: int) -> bool:
        return fly_stretch(
            self.world,
            self.core.rows,
            self.core.law_rows,
            self.wire,
            self.figures,
            self.asked,
            self.trace,
            begun,
            decided,
            gripper_open,
            reel_rate,
            stop_tick,
        )

    def _now(self) -> World:
        return unpack(World, self.world.world, 0)

    def _stop_tick(self) -> int:
        """The tick after which the ground station has something to do, or the time is over."""
        now_us = self._now().now_us
        due = [time for time in (self.arm_us, self.start_us) if time > now_us]
        if self.airborne_us >= 0:
            due.append(self.airborne_us + self.limit_us + self.tick_us)
        return -(-min(due, default=now_us + self.limit_us) // self.tick_us)

    def _note(self, phase: Phase, before: World, now: World) -> None:
        """What passed in a stretch that was flown in this phase."""
        if phase in _LOAD_CARRIED:
            self.flown.slack_events += int(now.plant.slack_events - before.plant.slack_events)
        if phase == Phase.MISSION:
            self.mission_us += now.now_us - before.now_us
            mission = self.core.flight.mission
            self.item = mission.plan.sequence[mission.step]

    def _decide(self, now_us: int) -> None:
        """The supervisor's part of a tick; and where the mission asks the load to be."""
        phase = self.core.flight.phase
        self._hear(self.core.decide(now_us, self.tick_us).texts, phase)
        flight = self.core.flight
        self.asked = _NO_ROWS
        if flight.phase != Phase.MISSION or not flight.legs or flight.legs[0].control_mode != LOAD_POSITION:
            return
        leg = flight.legs[0]
        stretch = unpack(Stretch, self.core.rows.stretch, 0)
        since_us = now_us - flight.leg_start_us
        ticks = np.arange(len(self.core.rows.targets))
        times = np.asarray((since_us + stretch.period_us * ticks) * 1e-6, np.float64)
        self.asked = jets(leg, times, asked=True)

    # ---- what the ground station does

    def _ground_turn(self, now_us: int) -> None:
        """Arm and start at their instants; as long as the vehicle has complaints both are put off."""
        phase = self.core.flight.phase
        if now_us == self.arm_us and phase == Phase.DISARMED:
            complaints = arming_complaints(self.core.flight, self.core.view(now_us), self.core.settings)
            if complaints and now_us < READY_LIMIT_US:
                self.arm_us += GROUND_WINDOW_US
                self.start_us += GROUND_WINDOW_US
                return
            self._ask(Arm(arm=True, force=False), now_us)
        elif now_us == self.start_us and phase == Phase.ARMED:
            self._ask(StartMission(0), now_us)
            self.airborne_us = now_us

    def _ask(self, request: Arm | StartMission, now_us: int) -> None:
        verdict = self.core.ask(request, now_us)
        if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
            self.flown.outcome, self.flown.reason = "refused", verdict.text or ""

    # ---- how it ends

    def _hear(self, texts: tuple[tuple[int, str], ...], phase: Phase) -> None:
        for severity, text in texts:
            self.flown.texts.append(text)
            if severity <= mavlink.MAV_SEVERITY_CRITICAL and self.airborne_us >= 0:
                self.flown.outcome, self.flown.reason = "diverged", text
                self.flown.lost_phase = phase.name.lower()

    def _judge(self, now_us: int) -> None:
        flown, flight = self.flown, self.core.flight
        if flown.outcome:
            return
        if self.airborne_us >= 0 and flight.phase == Phase.DISARMED:
            self._landed()
        elif self.airborne_us >= 0 and now_us - self.airborne_us > self.limit_us:
            where: str = flight.phase.name.lower()
            flown.outcome, flown.lost_phase = "timeout", where
            flown.reason = f"not landed after {self.limit_us * 1e-6:.0f} s of flight: still in phase {where}"

    def _landed(self) -> None:
        """The vehicle is disarmed; said as `gcs fly` says it."""
        if self.core.flight.mission.done:
            self.flown.outcome = "completed"
            return
        where = f"item {self.item} of {self.items}"
        self.flown.outcome = "interrupted"
        self.flown.reason = f"the vehicle was disarmed before the end of the mission, at {where}"

    def _conclude(self) -> None:
        flown, f = self.flown, unpack(Figures, self.figures, 0)
        if self.airborne_us >= 0:
            flown.flight_s = (self._now().now_us - self.airborne_us) * 1e-6
        flown.mission_s = self.mission_us * 1e-6
        if f.samples > 0.0:
            flown.load_error_max_m = f.error_max
            flown.tracking_error_max_m = f.tracking_max
            flown.load_error_rms_m = sqrt(f.error_square / f.samples)
            flown.estimator_error_max_m = f.estimator_error_max
            flown.saturated_fraction = f.saturated / f.ticks
            flown.psi_R_max, flown.psi_q_max = f.psi_R_max, f.psi_q_max
            flown.tension_min_n, flown.tension_max_n = f.tension_min, f.tension_max
            flown.rotor_force_min_n, flown.rotor_force_max_n = f.rotor_min, f.rotor_max


def fly(mission: Mission, conditions: Conditions, boarding: Boarding, trace: Floats | None = None) -> Flown:
    """Fly a mission from take-off to landing under these conditions.

    `trace` (ticks, TRACE_COLUMNS) receives the true state at each tick, for tests: x_load, x_quad, quat_wxyz,
    rotor_force.
    """
    return _Flight(mission, conditions, boarding, trace).run()
