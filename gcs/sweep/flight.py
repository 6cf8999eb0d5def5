"""One whole flight without the wire: the flight that `gcs.closed_loop` flies, some twenty times as fast.

Python runs the ticks at which the supervisor has something to decide, with the functions that fly
(`autopilot.core.tick.control`, `autopilot.supervisor.requests.decide`); all others pass in
`gcs.sweep.kernel`. The ground station's part is known beforehand: the two instants at which it arms and
starts the mission.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import floor, inf, nan, sqrt

import numpy as np

from autopilot.control.actuators.disturbance_observer import nominal
from autopilot.core.scheduler import divider, is_due
from autopilot.core.tick import FlightState, Setup, control, initial_state, view_of
from autopilot.estimation.filter import control_state
from autopilot.estimation.records import ImuReading, new_history
from autopilot.estimation.release import parted, untied
from autopilot.geometry.linear import ZERO
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION, Catch, Creep, asked_jet
from autopilot.onboard.onboard import Onboard, build_setup, plan_of
from autopilot.services.mission_store import StoredMission
from autopilot.services.requests import Arm, StartMission
from autopilot.supervisor.advance import (
    LIFT_OFF_US,
    LOAD_SUNK,
    PULL_US,
    STILL_SPEED,
    STILL_US,
    TAUT_LATEST,
    VEHICLE_SUNK,
)
from autopilot.supervisor.phase_legs import CLEARANCE, TOUCH_SPEED
from autopilot.supervisor.requests import arming_complaints, decide, with_plan
from autopilot.supervisor.state import CARRYING as CARRYING_PHASES
from autopilot.supervisor.state import (
    IN_AIR,
    ON_GROUND,
    Flight,
    MissionPlan,
    Phase,
    View,
    carries,
    jet_ahead,
    leg_time_s,
)
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
from gcs.sweep import kernel as k
from gcs.sweep.legs import COLUMNS, jets, jets_ahead
from gcs.sweep.link import link_model
from gcs.sweep.pilot import FUSED_LAWS, Pilot, PilotModel
from gcs.sweep.plan import simulated
from gcs.sweep.world import Floats, new_world
from missions.model import Mission, Winch
from sitl.hil import HilSimulator
from sitl.plant.gripper import dropped, without_cable
from sitl.sensors.files import load_profile
from sitl.sensors.profile import Profile
from sitl.sim_core import settings_of
from sitl.vehicles.sim_parameters import apply as apply_parameters
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth

GROUND_WINDOW_US = 20_000  # between two turns of the ground station
LONGEST_STRETCH = 1000  # ticks
TRACE_COLUMNS = 14
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
    if any(isinstance(step, Winch) for step in mission.steps):
        raise ValueError(f"{mission.name} works the winch, which no sweep simulates; fly it by gcs fly")
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
        self.every = divider(1e6 / self.tick_us, table["CTL_RATE_HZ"], "CTL_RATE_HZ")
        self.setup: Setup = build_setup(table, self.every)
        plan = _plan(tuple(encode_mission(mission, home)), self.setup.settings.limits)
        self.state: FlightState = initial_state()
        self.state = self.state._replace(flight=with_plan(self.state.flight, plan))
        self.history = new_history()
        self.world, self.world_model, self.buffers = new_world(
            apply_parameters(truth, sim_table), profile, settings, conditions.seed
        )
        self.inertial = ImuReading(ZERO, ZERO)
        self.figures = k.NO_FIGURES
        self.model = k.AutopilotModel(
            link_model(profile, settings.noise_scale, home),
            self.setup.tuning,
            PilotModel(
                self.setup.law,
                self.setup.vehicle,
                self.setup.limited,
                self.setup.actuation,
                self.setup.observer,
                self.setup.drag,
                nominal(self.setup.vehicle),
            ),
            self.every,
            self.setup.settings.failsafe.sensor_age_limit_s,
            self.setup.settings.failsafe.tilt_limit_rad,
        )
        self.fused = type(self.setup.law) in FUSED_LAWS
        self.trace = np.zeros((0, TRACE_COLUMNS)) if trace is None else trace
        self.no_memory = self.setup.law.start(control_state(self.state.estimator), ZERO, ZERO)
        self.arm_us, self.start_us = boarding.arm_us, boarding.start_us
        self.limit_us = round(1e6 * (expected_duration_s(mission) * TIME_FACTOR + TIME_MARGIN_S))
        self.flown = Flown()
        self.airborne_us = -1
        self.mission_us = 0

    # ---- the loop

    def run(self) -> Flown:
        """Fly to the end."""
        stretch = self._on_ground(self._tick_at(self.arm_us))
        self._stretch(stretch, False)
        while not self.flown.outcome:
            self._decide()
            if not self.flown.outcome:
                self._stretch(self._next_stretch(), True)
        self._conclude()
        return self.flown

    def _tick_at(self, time_us: int) -> int:
        return -(-time_us // self.tick_us)

    def _stretch(self, stretch: k.Stretch, decided: bool) -> None:
        state, now_us = self.state, self.world.now_us
        targets = references = asked = _NO_ROWS
        flight = state.flight
        if stretch.flown != k.GROUND:
            n = stretch.stop_tick - self.world.tick + 1
            since_us = now_us - flight.leg_start_us
            times: Floats = np.asarray((since_us + self.tick_us * np.arange(n)) * 1e-6, np.float64)
            preview_s = self.setup.law.preview_s
            targets = references = jets_ahead(flight, times)
            if preview_s != 0.0:
                references = jets_ahead(flight, times + preview_s)
            if stretch.counts:
                asked = jets(flight.legs[0], times, asked=True)
        slack_before = self.world.plant.slack_events
        self.world, after, self.figures = k.fly_stretch(
            self.world,
            k.Autopilot(state.estimator, self.inertial, self._pilot()),
            self.figures,
            decided,
            stretch,
            targets,
            references,
            asked,
            self.world_model,
            self.buffers,
            self.history,
            self.model,
            self.trace,
        )
        self.inertial = after.inertial
        self.state = state._replace(
            estimator=after.estimator,
            memory=None if state.memory is None else after.pilot.memory,
            command=after.pilot.command,
            mixed=after.pilot.mixed,
            actuation=after.pilot.actuation,
            observed=after.pilot.observed,
        )
        if flight.phase in _LOAD_CARRIED:
            self.flown.slack_events += int(self.world.plant.slack_events - slack_before)
        if flight.phase == Phase.MISSION:
            self.mission_us += self.world.now_us - now_us

    def _pilot(self) -> Pilot:
        state = self.state
        return Pilot(
            self.no_memory if state.memory is None else state.memory,
            state.command,
            state.mixed,
            state.actuation,
            self.model.pilot.nominal if state.observed is None else state.observed,
        )

    def _decide(self) -> None:
        """The tick that is estimated but not controlled, by the functions that fly."""
        now_us = self.world.now_us
        if is_due(self.world.tick, self.every):
            phase = self.state.flight.phase
            self.state, report = control(self.state, self.setup, now_us)
            self._hear(report.texts, phase)
            if self.state.flight.cable.released:
                self._let_go()
            flight = self.state.flight
            if self._counts(flight):
                t = leg_time_s(flight, now_us)
                self.figures = k.counted(
                    self.figures,
                    self.world.plant,
                    self.state.estimator,
                    self._pilot(),
                    jet_ahead(flight, t)[0],
                    asked_jet(flight.legs[0], t)[0],
                )
        self._ground_turn(now_us)
        self._judge(now_us)

    def _let_go(self) -> None:
        """The gripper is open: in the world from this tick on, in the estimate from the next."""
        tuning = untied(self.setup.tuning)
        estimator = parted(self.state.estimator, self.history, tuning)
        self.state = self.state._replace(estimator=estimator)
        self.model = self.model._replace(tuning=tuning)
        if self.world_model.truth.cable_length != inf:
            self.world = self.world._replace(plant=dropped(self.world.plant))
            self.world_model = self.world_model._replace(truth=without_cable(self.world_model.truth))

    # ---- what the ground station does

    def _ground_turn(self, now_us: int) -> None:
        """Arm and start at their instants; as long as the vehicle has complaints both are put off."""
        flight = self.state.flight
        if now_us == self.arm_us and flight.phase == Phase.DISARMED:
            view = self._view(now_us)
            complaints = arming_complaints(flight, view, self.setup.settings)
            if complaints and now_us < READY_LIMIT_US:
                self.arm_us += GROUND_WINDOW_US
                self.start_us += GROUND_WINDOW_US
                return
            self._ask(Arm(arm=True, force=False), now_us)
        elif now_us == self.start_us and flight.phase == Phase.ARMED:
            self._ask(StartMission(0), now_us)
            self.airborne_us = now_us

    def _ask(self, request: Arm | StartMission, now_us: int) -> None:
        flight, verdict = decide(self.state.flight, request, self._view(now_us), self.setup.settings)
        self.state = self.state._replace(flight=flight)
        if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
            self.flown.outcome, self.flown.reason = "refused", verdict.text or ""

    def _view(self, now_us: int) -> View:
        state = self.state
        control = control_state(state.estimator)
        return view_of(state.estimator, control, self.setup.settings, now_us, carrying=carries(state.flight))

    # ---- how it ends

    def _hear(self, texts: tuple[tuple[int, str], ...], phase: Phase) -> None:
        for severity, text in texts:
            self.flown.texts.append(text)
            if severity <= mavlink.MAV_SEVERITY_CRITICAL and self.airborne_us >= 0:
                self.flown.outcome, self.flown.reason = "diverged", text
                self.flown.lost_phase = phase.name.lower()

    def _judge(self, now_us: int) -> None:
        flown, flight = self.flown, self.state.flight
        if flown.outcome:
            return
        if self.airborne_us >= 0 and flight.phase == Phase.DISARMED:
            flown.outcome = "completed" if flight.mission.done else "interrupted"
        elif self.airborne_us >= 0 and now_us - self.airborne_us > self.limit_us:
            where: str = flight.phase.name.lower()
            flown.outcome, flown.lost_phase = "timeout", where
            flown.reason = f"not landed after {self.limit_us * 1e-6:.0f} s of flight: still in phase {where}"

    def _conclude(self) -> None:
        flown, f = self.flown, self.figures
        if self.airborne_us >= 0:
            flown.flight_s = (self.world.now_us - self.airborne_us) * 1e-6
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

    # ---- how far the kernel may go

    def _on_ground(self, stop_tick: int) -> k.Stretch:
        return k.Stretch(k.GROUND, stop_tick, k.NOTHING, 0.0, 0.0, False, inf, False, 0.0, 1.0, False)

    def _counts(self, flight: Flight) -> bool:
        return (
            flight.phase == Phase.MISSION
            and bool(flight.legs)
            and flight.legs[0].control_mode == LOAD_POSITION
        )

    def _next_stretch(self) -> k.Stretch:
        """What is flown from here, and until when the supervisor has nothing to do but watch."""
        flight, here = self.state.flight, self.world.tick
        if flight.phase in ON_GROUND:
            due = [t for t in (self.arm_us, self.start_us) if t > self.world.now_us]
            ticks = [self._tick_at(t) for t in due]
            if self.state.flight.phase == Phase.ARMED and self.state.mixed.thrust_done == 0.0:
                ticks.append(here + 1)  # armed at this tick: the rotors begin to idle at the next
            return self._on_ground(min([*ticks, here + LONGEST_STRETCH]))
        leg = flight.legs[0] if flight.legs else None
        if (
            leg is None
            or not self.fused
            or leg.control_mode not in (LOAD_POSITION, QUAD_POSITION)
            or leg.control_mode != self.state.control_mode
            or isinstance(leg, Catch)
            or flight.cable.slack_since_us >= 0
            or flight.cable.released
        ):
            return self._on_ground(here + 1)
        carries = leg.control_mode == LOAD_POSITION
        ends = [here + LONGEST_STRETCH, self._leg_end(flight, here), self._tick_at(self._time_out_us())]
        watch, level = k.NOTHING, 0.0
        settings = self.setup.settings
        if flight.phase == Phase.TAUTEN and len(flight.legs) == 1:
            watch, level = k.TAUT, _taut_by(leg, settings.cable_length_m)
            if flight.still_since_us >= 0:
                ends.append(self._tick_at(flight.still_since_us + PULL_US))
        elif flight.phase in (Phase.LOWER, Phase.SET_DOWN) and isinstance(leg, Creep):
            watch = k.LOAD_DOWN if carries else k.VEHICLE_DOWN
            level = LOAD_SUNK + settings.ramp_lag_s * TOUCH_SPEED if carries else VEHICLE_SUNK
            if flight.still_since_us >= 0:
                ends.append(self._tick_at(flight.still_since_us + STILL_US))
        hangs = flight.phase in CARRYING_PHASES
        tracked = hangs and carries
        if flight.phase == Phase.LIFT:
            lifted_us = flight.phase_start_us + LIFT_OFF_US
            if self.world.now_us < lifted_us:
                hangs = False
                ends.append(self._tick_at(lifted_us))
        elif flight.phase == Phase.LOWER and isinstance(leg, Creep):
            hangs = False
        return k.Stretch(
            flown=k.CARRYING if carries else k.SLACK,
            stop_tick=max(min(ends), here + 1),
            watch=watch,
            level=level,
            still_speed=STILL_SPEED,
            still=flight.still_since_us >= 0,
            error_limit=settings.failsafe.load_error_limit_m if tracked else inf,
            hangs=hangs,
            taut_length=flight.cable.taut_length_m,
            load_weight=settings.load_weight_n,
            counts=self._counts(flight),
        )

    def _time_out_us(self) -> int:
        return self.airborne_us + self.limit_us + self.tick_us

    def _leg_end(self, flight: Flight, here: int) -> int:
        """The first tick at which the present leg is over, as `supervisor.advance` sees it."""
        duration_s = flight.legs[0].duration_s
        if duration_s == inf:
            return here + LONGEST_STRETCH
        end = max(floor((flight.leg_start_us + duration_s * 1e6) / self.tick_us) - 1, here)
        while leg_time_s(flight, end * self.tick_us) < duration_s:
            end += 1
        return end


_NO_ROWS = np.zeros((0, COLUMNS))


def _taut_by(leg: object, cable_length_m: float) -> float:
    assert isinstance(leg, Creep)
    return leg.begin[2] + (TAUT_LATEST - CLEARANCE) * cable_length_m


def fly(mission: Mission, conditions: Conditions, boarding: Boarding, trace: Floats | None = None) -> Flown:
    """Fly a mission from take-off to landing under these conditions.

    `trace` (ticks, TRACE_COLUMNS) receives the true state at each tick, for tests: x_load, x_quad, quat_wxyz,
    rotor_force.
    """
    return _Flight(mission, conditions, boarding, trace).run()
