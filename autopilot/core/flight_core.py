"""The flight software around its compiled tick; the supervisor runs only where it may have to decide.

`FlightCore` is driven by the simulator link in the processes and by the loop of a sweep: `step` runs a tick,
`decide` is the supervisor's part of a tick that a sweep's loop flies. The tick receives the state of the
cable from the winch as `Winch`, and what is flown and until when as `Stretch`, with the setpoints computed in
advance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control.actuators.disturbance_observer import ObserverConstants, nominal_on_ground
from autopilot.control.actuators.lag_equalisation import with_lag_columns
from autopilot.control.actuators.mixer import FORCE, REPORTED_SPEED, new_rotors
from autopilot.control.actuators.rotor_model import ActuationConstants, queue_rows, steady_actuation
from autopilot.control.drag import Drag
from autopilot.control.laws.interface import law_of, new_rows
from autopilot.control.records import Cable, State, Vehicle
from autopilot.core.estimator_slot import EstimatorSlot
from autopilot.core.reeling import (
    ACCEL,
    GROWTH,
    LENGTH,
    NOT_REELING,
    RATE,
    TAUT_LENGTH,
    reeling_table,
)
from autopilot.core.start_problem import start_problem
from autopilot.core.tick import (
    NO_COMMAND,
    STOPPED,
    TO_DECIDE,
    ControlMemory,
    CoreConstants,
    CoreRows,
    EstimateSummary,
    Winch,
    compiled_law,
    fly_tick,
    placeholder_law,
)
from autopilot.estimation.filter import NO_LOAD, NO_POSE, estimate_loss, problem_texts
from autopilot.estimation.inbox import new_inbox
from autopilot.estimation.records import (
    Array,
    EstimatorState,
    EstimatorTuning,
    LoadEstimate,
    blank_state,
    new_history,
)
from autopilot.geometry.entry import entry_point_of, kernel_address_of
from autopilot.geometry.linear import IDENTITY, ZERO, Vec3, norm
from autopilot.geometry.packed import field_offset, pack, packed, unpack
from autopilot.guidance.jet_table import COLUMNS, jets_ahead
from autopilot.guidance.legs import Brake, CatchLoad, Leg, PathStop, Reel, winch_hold_height
from autopilot.own.estimator import load_estimator
from autopilot.own.host import Host
from autopilot.own.law import load_law
from autopilot.own.own_code import OwnSetup
from autopilot.services.records import Verdict
from autopilot.supervisor.advance import advance
from autopilot.supervisor.quiescence import UNCONTROLLED, Stretch, next_stretch, uncontrolled_stretch
from autopilot.supervisor.recovery import RestartState, abort_flight, resume_flight
from autopilot.supervisor.requests.decide import decide
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, Report, Text, View, leg_time_s, needs_load_estimate
from autopilot.trajectory.timeline import min_move_duration
from autopilot.vehicle.layout import PLUS, Layout
from autopilot.vehicle.rotors import mixer_table, thrust_and_moment_per_force

SETPOINTS_PER_CALL = 250  # setpoints computed in one call, a second of them: this must not delay a tick
SETPOINTS_LOCKSTEP = 4000  # where the clock waits, as in lockstep and in a sweep
SETPOINTS_ENDLESS = 1000  # of a leg without an end, of which most end soon: at a touch, at a pull
SETPOINTS_BRAKING = 50  # of a stop, which takes 20 us each: a commanded stop must not delay a tick
_NO_ROWS = np.zeros((1, COLUMNS))
_NOTHING = Report()


@dataclass(frozen=True)
class Setup:
    """Everything derived from parameters."""

    vehicle: Vehicle
    limited: float
    law: Any  # the chosen law's constants
    actuation: ActuationConstants
    observer: ObserverConstants
    drag: Drag
    tuning: EstimatorTuning
    settings: Settings
    control_every: int  # ticks
    layout: Layout = PLUS
    rotor_watch: float = 1.0  # as of `believed_rotor_watch`
    factor_share: float = 0.0  # as of `believed_factor_share`
    own: OwnSetup | None = None  # the custom law, if it is the one that flies
    estimator: OwnSetup | None = None  # the custom estimator
    planner: OwnSetup | None = None  # the custom planner of paths through waypoints

    @property
    def preview_s(self) -> float:
        """Time in s by which the law requires its reference in advance."""
        return law_of(self.law).preview_s(self.law)


class PlannedSetpoints(NamedTuple):
    """The setpoints in `CoreRows.targets`: those of the first of these legs, from a tick on."""

    legs: tuple[Leg, ...]
    following: tuple[Leg, ...]  # legs into which the law looks ahead
    leg_start_us: int
    first_us: int
    period_us: int
    times_s: NDArray[np.float64]  # into the leg, of each row

    def row_at(self, now_us: int) -> int:
        """The row of this instant, which may lie behind the last one; -1 before the first and between two."""
        at, off = divmod(now_us - self.first_us, self.period_us)
        return max(at, -1) if off == 0 else -1


class FlightCore:
    """One vehicle's flight software. `flight` is the supervisor's record; all else lies in `rows`."""

    def __init__(self, setup: Setup, setpoints_per_call: int = SETPOINTS_PER_CALL) -> None:
        self.setup = setup
        self.flight = Flight()
        self.settings = setup.settings  # with the present cable
        self._setpoints_per_call = setpoints_per_call
        self.lost_rotors = 0  # rotors that are known to be lost: bits
        self._cable_m: float | None = None  # length for which `settings` were made
        self._dirty = True  # the flight has changed since `rows.winch` was written
        self._reeling: tuple[tuple[Leg, ...], bool] = ((), False)  # legs, and whether the first of them reels
        self._host: Host | None = None
        self._estimator_slot: EstimatorSlot | None = None
        self._fly: Callable[..., int] | None = None  # the tick's machine code, once it was run
        self._law: Any = None  # `law`, once it was needed
        self.planned: PlannedSetpoints | None = None  # what `rows.targets` are the setpoints of
        self.reeling: Array = NOT_REELING  # the winch at the ticks of the stretch, if its leg reels
        control = ControlMemory(
            NO_COMMAND, STOPPED, 1.0, 0.0, ZERO, nominal_on_ground(setup.vehicle), UNCONTROLLED, 0, False
        )
        self.rows = CoreRows(
            estimator=packed(blank_state()),
            control=packed(control),
            summary=packed(_NO_ESTIMATE_YET),
            commands=np.zeros((queue_rows(setup.actuation), 4)),
            history=new_history(),
            inbox=new_inbox(),
            constants=packed(self._constants()),
            winch=packed(Winch(Cable(setup.vehicle.cable_length), 0.0, False)),
            stretch=packed(uncontrolled_stretch(0, 0, False)),
            targets=_NO_ROWS,
            references=_NO_ROWS,
            rotors=new_rotors(),
            table=self._table(),
        )

        self.law_rows = self._rows_of_law(setup)
        if setup.estimator is not None:
            self._estimator_slot = EstimatorSlot(
                load_estimator(setup.estimator.reference), self.rows, self._link_estimator
            )
            self._estimator_slot.configure(setup.estimator.values)
            self._link_estimator()

    # ---- the present state

    @property
    def estimator(self) -> EstimatorState:
        """The estimate."""
        return unpack(EstimatorState, self.rows.estimator, 0)

    @property
    def reported_rpm(self) -> tuple[float, ...]:
        """Speeds that the speed controllers reported last, rpm, one of each rotor."""
        return tuple(self.rows.rotors[REPORTED_SPEED, : len(self.setup.layout)].tolist())

    @property
    def control(self) -> ControlMemory:
        """Command, rotor forces, and what is observed."""
        return unpack(ControlMemory, self.rows.control, 0)

    @property
    def reported_estimator(self) -> Array:
        """`EstimatorState` as telemetry shows it: with the results of a custom estimator, if one is used."""
        return (
            self.rows.estimator
            if self._estimator_slot is None or self._estimator_slot.fault
            else self._estimator_slot.reported
        )

    @property
    def built_in(self) -> tuple[Vec3, Vec3, Vec3] | None:
        """Load (position, velocity) and vehicle (position) as the built-in filter estimates them beside a
        custom estimator; None if no custom estimator is used."""
        if self._estimator_slot is None or self._estimator_slot.fault:
            return None
        state = self._estimator_slot.built_in
        return state.x_load, state.v_load, state.x_quad

    @property
    def force_row(self) -> Array:
        """Commanded forces of the rotors, N; zeros for rotors that do not exist."""
        row: Array = self.rows.rotors[FORCE]
        return row

    @property
    def forces(self) -> tuple[float, ...]:
        """Commanded force of each rotor, N."""
        return tuple(self.force_row[: len(self.setup.layout)].tolist())

    @property
    def state(self) -> State:
        """State passed to the control laws."""
        return unpack(EstimateSummary, self.rows.summary, 0).state

    @property
    def is_reeling(self) -> bool:
        """Whether the present leg moves the winch."""
        legs = self.flight.legs
        if legs is not self._reeling[0]:
            self._reeling = (legs, bool(legs) and winch_hold_height(legs[0]) is not None)
        return self._reeling[1]

    def view(self, now_us: int, with_pull: bool = False) -> View:
        """What the supervisor sees; the cable's pull only during a tick (`with_pull`)."""
        summary = unpack(EstimateSummary, self.rows.summary, 0)
        carries_load = needs_load_estimate(self.flight)
        problems: tuple[str, ...] = ()
        loss_text = ""
        if summary.vehicle_problem or (carries_load and summary.load_problem):
            estimator = self.estimator
            load_problem = summary.load_problem if carries_load else 0
            problems = problem_texts(estimator, summary.vehicle_problem, load_problem)
            if summary.vehicle_problem == NO_POSE and (reason := start_problem(estimator)):
                problems = (reason,)
            loss_text = estimate_loss(estimator, summary.vehicle_problem)
        slot = self._estimator_slot
        if slot is not None and not slot.fault and not slot.host.has_estimate:
            problems += (f"no estimate of {slot.host.estimator.label}",)
        state = summary.state
        return View(
            now_us,
            state.x_quad,
            state.v_quad,
            state.x_load,
            state.v_load,
            summary.taut,
            summary.tilt_rad,
            problems,
            summary.pull_n if with_pull else nan,
            summary.height_std,
            state.R,
            loss_text,
            self._host.fault if self._host is not None else "",
            summary.rotors_lost,
            slot.fault if slot is not None else "",
            bool(self.rows.estimator[_LOAD_AGE] == inf),
            summary.load_tracked,
        )

    @property
    def known_speed(self) -> float:
        """Estimated speed of the vehicle, m/s; NaN if the estimate is not good enough for flight."""
        summary = unpack(EstimateSummary, self.rows.summary, 0)
        return nan if summary.vehicle_problem else norm(summary.state.v_quad)

    # ---- from tick to tick

    def use_inbox(self, inbox: Array) -> None:
        """Use a larger inbox."""
        self.rows = self.rows._replace(inbox=inbox)
        if self._estimator_slot is not None:
            self._estimator_slot.bind(self.rows)

    @property
    def law_rows(self) -> Any:
        """Constants and memory of the law that flies."""
        return self._law_rows

    @law_rows.setter
    def law_rows(self, rows: Any) -> None:
        self._law_rows, self._law = rows, None

    @property
    def law(self) -> Any:
        """The law's rows as a tick takes them, with its machine code."""
        if self._law is None:
            self._law = compiled_law(self.rows, self._law_rows)
        return self._law

    def compile(self) -> Callable[..., int]:
        """Prepare the machine code of a tick that is the same with all laws."""
        self._fly = entry_point_of(fly_tick, self.rows, placeholder_law(self.law_rows), 0, 0, 0, 0.0, False)
        return self._fly

    def step(self, count: int, now_us: int, tick: int, dt: float) -> Report:
        """One tick of `dt` seconds with the first `count` readings of the inbox."""
        self.move_cable(now_us)
        fly = self._fly or self.compile()
        report = _NOTHING
        if fly(self.rows, self.law, count, now_us, tick, dt, False) == TO_DECIDE:
            return self.complete(count, now_us, tick, dt)
        self.raise_interruption()
        return report

    def complete(self, count: int, now_us: int, tick: int, dt: float) -> Report:
        """The rest of a tick after its estimate: the supervisor decides, then the law flies."""
        report = self.decide(now_us, round(dt * 1e6))
        fly = self._fly or self.compile()
        fly(self.rows, self.law, count, now_us, tick, dt, True)
        self.raise_interruption()
        return report

    @property
    def can_run_compiled(self) -> bool:
        """Whether machine code can fly the next tick, apart from decisions of the supervisor; it also calls a
        custom law."""
        return self._estimator_slot is None and not self._dirty and not self.is_reeling

    def address_of_tick(self) -> int:
        """The address of `fly_tick`, compiled or loaded if necessary; 0 where nothing is compiled."""
        if not hasattr(fly_tick, "overloads"):
            return 0
        return kernel_address_of(fly_tick, self.rows, placeholder_law(self.law_rows), 0, 0, 0, 0.0, False)

    def raise_interruption(self) -> None:
        """Raise what interrupted law or estimator during the tick without being their fault, such as
        Ctrl-C."""
        if self._host is not None:
            self._host.guard.raise_interruption()
        if self._estimator_slot is not None:
            self._estimator_slot.host.guard.raise_interruption()

    def decide(self, now_us: int, period_us: int) -> Report:
        """The supervisor's part of a tick, after the estimate and before the law."""
        self.flight, report = advance(self.flight, self.view(now_us, with_pull=True), self.settings)
        self._dirty = True
        self._plan_setpoints(now_us, period_us)
        self._use_rotors()
        return report

    def _use_rotors(self) -> None:
        """Use the mixer's table for the rotors that are not lost, if these can fly the vehicle."""
        lost = self.flight.rotors_lost
        if lost != self.lost_rotors:
            self.lost_rotors = lost
            self.rows = self.rows._replace(table=self._table())
            pack(self._constants(), self.rows.constants, 0)

    def _table(self) -> Array:
        """The mixer's table, for the remaining rotors if these can fly the vehicle, otherwise for all."""
        can_fly = self.setup.settings.rotors.can_fly_without(self.lost_rotors)
        return _table_of(self.setup.layout, self.lost_rotors if can_fly else 0, self.setup.actuation)

    def _constants(self) -> CoreConstants:
        setup, rotors = self.setup, self.setup.settings.rotors
        thrust_per_force, moment_per_force = thrust_and_moment_per_force(self._table())
        return CoreConstants(
            setup.tuning,
            setup.vehicle._replace(thrust_per_force=thrust_per_force, moment_per_force=moment_per_force),
            setup.limited,
            setup.actuation,
            setup.observer,
            setup.drag,
            setup.control_every,
            setup.settings.failsafe.sensor_age_limit_s,
            setup.rotor_watch,
            setup.factor_share,
            rotors.can_fly_without(self.lost_rotors)
            and not rotors.can_hold_heading_without(self.lost_rotors),
            *(self._estimator_slot.link if self._estimator_slot is not None else (0, 0)),
        )

    def move_cable(self, now_us: int) -> None:
        """Set the cable to the winch's state at this instant."""
        flight = self.flight
        if not (self._dirty or self.is_reeling):
            return
        row = self._reeling_row(now_us)
        if row is None:
            before_m = flight.cable.length_m
            flight = with_cable_now(flight, now_us)
            winch = flight.cable
            length_change = 0.0 if before_m is None or winch.length_m is None else winch.length_m - before_m
        else:
            winch = replace(
                flight.cable,
                length_m=row[LENGTH],
                reel_rate=row[RATE],
                reel_accel=row[ACCEL],
                taut_length_m=row[TAUT_LENGTH],
            )
            flight, length_change = replace(flight, cable=winch), row[GROWTH]
            self.rows.stretch[_STRETCH_TAUT_LENGTH] = row[TAUT_LENGTH]
        self.flight = flight
        length = self.setup.vehicle.cable_length if winch.length_m is None else winch.length_m
        cable = Cable(length, winch.reel_rate, winch.reel_accel)
        pack(Winch(cable, length_change, winch.released), self.rows.winch, 0)
        # the growth is passed on once
        self._dirty = length_change != 0.0
        self._update_cable_length()

    def _reeling_row(self, now_us: int) -> list[float] | None:
        """The winch at this tick in `reeling`, as laid out for the leg that is flown; None: there is none."""
        planned = self._planned_for_leg()
        at = -1 if planned is None else planned.row_at(now_us)
        row: list[float] | None = self.reeling[at].tolist() if 1 <= at < len(self.reeling) else None
        return row

    def _update_cable_length(self) -> None:
        if self.flight.cable.length_m == self._cable_m:
            return
        self._cable_m = self.flight.cable.length_m
        length, settings = self._cable_m, self.setup.settings
        if length is not None:
            min_move_s = min_move_duration(length, settings.gravity_m_s2)
            settings = replace(settings, cable_length_m=length, min_move_s=min_move_s)
        self.settings = settings

    def _plan_setpoints(self, now_us: int, period_us: int) -> None:
        """Compute the stretch that begins with this tick, and its setpoints."""
        flight, preview_s = self.flight, self.setup.preview_s
        stretch = next_stretch(flight, self.settings, now_us, period_us, preview_s)
        before, self.planned, self.reeling = self._planned_for_leg(), None, NOT_REELING
        if stretch.mode == UNCONTROLLED:
            pack(stretch, self.rows.stretch, 0)
            return
        leg = flight.legs[0]
        if isinstance(leg, CatchLoad):
            state = self.state
            jet = leg.falling_motion(
                state.x_quad, state.v_quad, state.x_load, state.v_load, self.setup.vehicle.gravity
            )
            targets = references = np.ravel(jet).reshape(1, COLUMNS)
        elif (
            before is not None
            and isinstance(leg, Brake | PathStop)
            and flight.following is before.following
            and stretch.period_us == before.period_us
            and 0 <= (at := before.row_at(now_us)) < len(before.times_s)
        ):
            # the supervisor may decide at every tick of a stop, which is not laid out anew each time
            targets, references = (
                rows[at : len(before.times_s)] for rows in (self.rows.targets, self.rows.references)
            )
            self.planned = before._replace(first_us=now_us, times_s=before.times_s[at:])
        else:
            legs = (*flight.legs, *flight.following)
            max_ticks = self._setpoints_per_call
            if isinstance(leg, Brake | PathStop):
                max_ticks = SETPOINTS_BRAKING
            elif leg.duration_s == inf:
                max_ticks = min(max_ticks, SETPOINTS_ENDLESS)
            ticks = max(1, min(max_ticks, -(-(stretch.stop_us - now_us) // stretch.period_us)))
            since_us = now_us - flight.leg_start_us
            times = np.asarray((since_us + stretch.period_us * np.arange(ticks)) * 1e-6, np.float64)
            targets = references = jets_ahead(legs, times)
            if preview_s != 0.0:
                references = jets_ahead(legs, times + preview_s)
            if type(leg) is Reel:
                # to the tick at which the supervisor decides next
                until = np.asarray((since_us + stretch.period_us * np.arange(ticks + 1)) * 1e-6, np.float64)
                self.reeling = reeling_table(leg, until, flight.cable, stretch.period_us * 1e-6)
            # the remaining setpoints are those of legs that follow
            leg_rows = int(np.searchsorted(times, leg.duration_s, side="left")) if len(legs) > 1 else ticks
            self.planned = PlannedSetpoints(
                flight.legs,
                flight.following,
                flight.leg_start_us,
                now_us,
                stretch.period_us,
                times[:leg_rows],
            )
        stop_us = min(stretch.stop_us, now_us + stretch.period_us * len(targets))
        pack(stretch._replace(stop_us=stop_us), self.rows.stretch, 0)
        self.rows = self.rows._replace(targets=targets, references=references)

    def _planned_for_leg(self) -> PlannedSetpoints | None:
        """The setpoints in `rows.targets`, if they are those of the leg that is flown."""
        planned, flight = self.planned, self.flight
        if planned is None or flight.legs is not planned.legs or flight.leg_start_us != planned.leg_start_us:
            return None
        return planned

    def setpoints_until_us(self, period_us: int) -> int:
        """The time from which `setpoint_row` has no row for ticks of this period; 0: it has none now."""
        planned = self._planned_for_leg()
        if planned is None or planned.period_us != period_us:
            return 0
        return planned.first_us + period_us * len(planned.times_s)

    def setpoint_row(self, now_us: int) -> int:
        """The row of `rows.targets` with the setpoint of the present leg at this instant; -1: there is
        none."""
        planned = self._planned_for_leg()
        if planned is None:
            return -1
        at = planned.row_at(now_us)
        return at if at < len(planned.times_s) else -1

    # ---- between two ticks

    def handle_request(self, request: object, now_us: int) -> Verdict:
        """The supervisor's verdict on a request, which may change the flight."""
        flight, verdict = decide(self.flight, request, self.view(now_us), self.settings)
        self.replace_flight(flight)
        return verdict

    def replace_flight(self, flight: Flight) -> None:
        """Replace the flight; the supervisor runs at the next tick."""
        if flight is not self.flight:
            self.flight = flight
            self._dirty = True
            self.interrupt()

    def resume_flight(self, restart_state: RestartState, now_us: int) -> None:
        """Continue a flight that is under way."""
        rotors = steady_actuation(restart_state.thrust_n, len(self.rows.commands))
        self.rows.commands[:] = rotors.queue
        pack(self.control._replace(thrust=rotors.thrust), self.rows.control, 0)
        self.replace_flight(resume_flight(self.flight, restart_state, self.view(now_us), self.settings))

    def restart_estimate(self, why: str, now_us: int) -> tuple[Text, ...]:
        """Discard the estimate, and end a flight, which could not be controlled; the texts about it."""
        flight, texts = abort_flight(self.flight, why, self.view(now_us), self.settings)
        self.replace_flight(flight)
        pack(blank_state(), self.rows.estimator, 0)
        if self._estimator_slot is not None:
            self._estimator_slot.host.reset()
        for row, blank in zip(self.rows.history, new_history(), strict=True):
            row[:] = blank
        return texts

    def _rows_of_law(self, setup: Setup) -> Any:
        """Rows of the law; a custom law is called from them."""
        rows = new_rows(setup.law)
        if setup.own is not None:
            if self._host is None:
                self._host = Host(load_law(setup.own.reference), self.interrupt)
            self._host.bind(rows, setup.own.values)
        return rows

    def _link_estimator(self) -> None:
        """Let the tick call the custom estimator, as long as it has not failed."""
        pack(self._constants(), self.rows.constants, 0)
        self.interrupt()

    def interrupt(self) -> None:
        """Let the supervisor run at the next tick."""
        stretch = unpack(Stretch, self.rows.stretch, 0)
        pack(stretch._replace(stop_us=0), self.rows.stretch, 0)

    def use_setup(self, setup: Setup) -> None:
        """Use other parameters from the next tick on."""
        before, self.setup = self.setup, setup
        self._cable_m, self.settings = None, setup.settings
        self._dirty = True
        mission = self.flight.mission
        usual_m_s, new_m_s = before.settings.motion.speed_m_s, setup.settings.motion.speed_m_s
        if mission.requested_speed_m_s == usual_m_s != new_m_s:  # no other speed was requested
            self.flight = replace(self.flight, mission=mission.at_speed(new_m_s))
        if self._estimator_slot is not None and setup.estimator is not None:
            self._estimator_slot.configure(setup.estimator.values)
        pack(self._constants(), self.rows.constants, 0)
        commands = np.zeros((queue_rows(setup.actuation), 4))
        kept = min(len(commands), len(self.rows.commands))
        commands[:kept] = self.rows.commands[:kept]
        # a longer delay requires older commands than are stored: the oldest stored command replaces them
        commands[kept:] = self.rows.commands[-1]
        self.rows = self.rows._replace(commands=commands, table=self._table())
        rows = self._rows_of_law(setup)
        if law_of(setup.law) is law_of(before.law):
            rows.memory[:] = self.law_rows.memory
        else:
            # another law has no memory yet
            control = self.control._replace(control_mode=UNCONTROLLED)
            pack(control, self.rows.control, 0)
        self.law_rows = rows
        self._update_cable_length()
        self.interrupt()


@lru_cache(maxsize=8)
def _table_of(layout: Layout, lost: int, actuation: ActuationConstants) -> Array:
    """The table of a mixer for these rotors without those in `lost`. It is not written to: cores share it."""
    return with_lag_columns(mixer_table(layout, lost), layout, actuation)


def with_cable_now(flight: Flight, now_us: int) -> Flight:
    """The flight with its cable as reeled at this instant: L, L' and L'' of the leg that reels."""
    top = winch_hold_height(flight.legs[0]) if flight.legs else None
    if top is None:
        if flight.cable.reel_rate == 0.0 and flight.cable.reel_accel == 0.0:
            return flight
        return replace(flight, cable=replace(flight.cable, reel_rate=0.0, reel_accel=0.0))
    jet = flight.legs[0].jet(leg_time_s(flight, now_us))
    length = top - jet[0][2]
    length_change = 0.0 if flight.cable.length_m is None else length - flight.cable.length_m
    cable = replace(
        flight.cable,
        length_m=length,
        reel_rate=-jet[1][2],
        reel_accel=-jet[2][2],
        taut_length_m=flight.cable.taut_length_m + length_change,
    )
    return replace(flight, cable=cable)


def commanded_rate(flight: Flight, now_us: int, period_s: float) -> float:
    """Rate in m/s that the winch is to reach by the end of a period."""
    if not flight.legs or winch_hold_height(flight.legs[0]) is None:
        return 0.0
    return -flight.legs[0].jet(leg_time_s(flight, now_us) + period_s)[1][2]


_STRETCH_TAUT_LENGTH = field_offset(Stretch, "taut_length")
_LOAD_AGE = field_offset(EstimatorState, "load") + field_offset(LoadEstimate, "age_s")
_REST = State(ZERO, ZERO, (0.0, 0.0, -1.0), ZERO, ZERO, ZERO, IDENTITY, ZERO)
# before the first reading
_NO_ESTIMATE_YET = EstimateSummary(_REST, False, False, 0.0, 0.0, 0.0, NO_POSE, NO_LOAD, 0.0, 0)
