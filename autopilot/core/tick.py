"""One tick of the flight software: readings in, rotor forces out. No clock, no socket, no hidden state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan
from typing import NamedTuple

from autopilot.control.actuators.disturbance_observer import Observed, ObserverConstants, nominal, observe
from autopilot.control.actuators.mixer import MixerResult, mix
from autopilot.control.actuators.rotor_model import Actuation, ActuationConstants, resting
from autopilot.control.actuators.rotor_model import advance as actuate
from autopilot.control.height import cable_pull, tilted_thrust, vertical_force
from autopilot.control.laws.interface import Law, Memory
from autopilot.control.laws.thesis import attitude_towards
from autopilot.control.load_motion import Drag, air_force
from autopilot.control.records import Command, Jet, Reference, State, Vehicle
from autopilot.core.scheduler import is_due
from autopilot.core.winch import as_if_firm, as_reeled, cable_now, lengthened, with_reel
from autopilot.estimation.filter import Readings, complaints, control_state, estimate
from autopilot.estimation.records import RECEIVER, EstimatorState, EstimatorTuning, History, blank_state
from autopilot.estimation.release import parted, untied
from autopilot.geometry.linear import E1, E3, IDENTITY, ZERO, Vec3, add, axpy, column, dot, neg, scale, sub
from autopilot.geometry.so3 import tilt_angle
from autopilot.guidance.legs import (
    LOAD_ATTITUDE,
    LOAD_POSITION,
    QUAD_ATTITUDE,
    QUAD_POSITION,
    Calm,
    Catch,
    Leg,
    Swing,
    least_move_s,
)
from autopilot.guidance.setpoint_follower import Posture
from autopilot.supervisor.advance import advance
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    IN_AIR,
    Flight,
    Phase,
    Report,
    View,
    carries,
    jet_ahead,
    leg_time_s,
)

HEIGHT_GAIN, CLIMB_GAIN = 12.0, 5.5  # 1/s^2, 1/s: k_x and k_v of Table 4-3 by the mass of Table 4-1
IDLE_FORCE_N = 0.05  # of each rotor while armed on the ground
NO_COMMAND = Command(0.0, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0.0, 0.0, neg(E3), IDENTITY)
STOPPED = MixerResult((0.0, 0.0, 0.0, 0.0), 0, 0.0, ZERO)
IDLE = MixerResult((IDLE_FORCE_N, IDLE_FORCE_N, IDLE_FORCE_N, IDLE_FORCE_N), 0, 4.0 * IDLE_FORCE_N, ZERO)


@dataclass(frozen=True)
class Setup:
    """All that parameters decide."""

    vehicle: Vehicle
    limited: float
    law: Law
    actuation: ActuationConstants
    observer: ObserverConstants
    drag: Drag
    tuning: EstimatorTuning
    settings: Settings
    control_every: int  # ticks


class FlightState(NamedTuple):
    """All that is carried from tick to tick, but for the estimator's history, too large for a record."""

    estimator: EstimatorState
    flight: Flight
    memory: Memory  # of the law; None while no rotor is controlled
    control_mode: int  # that the memory was made for
    command: Command
    mixed: MixerResult
    slack_events: int
    was_taut: bool
    actuation: Actuation
    observed: Observed | None  # of load and wind; None before the first tick


def with_cable(setup: Setup, flight: Flight) -> Setup:
    """The setup of a vehicle whose cable is as the winch has it; the same where that never worked."""
    length = flight.cable.length_m
    if length is None:
        return setup
    settings = setup.settings
    return replace(
        setup,
        vehicle=setup.vehicle._replace(cable_length=length),
        law=setup.law.with_cable(length),
        tuning=setup.tuning._replace(cable_length=length),
        settings=replace(
            settings, cable_length_m=length, least_move_s=least_move_s(length, settings.gravity_m_s2)
        ),
    )


def initial_state() -> FlightState:
    """A disarmed vehicle that knows nothing."""
    return FlightState(blank_state(), Flight(), None, 0, NO_COMMAND, STOPPED, 0, False, resting(), None)


def view_of(
    estimator: EstimatorState,
    state: State,
    settings: Settings,
    now_us: int,
    pull_n: float = nan,
    carrying: bool = True,
) -> View:
    """What the supervisor sees."""
    return View(
        now_us,
        state.x_quad,
        state.v_quad,
        state.x_load,
        state.v_load,
        estimator.load.taut > 0.0,
        tilt_angle(state.R),
        complaints(estimator, settings.failsafe.sensor_age_limit_s, carries=carrying),
        pull_n,
        estimator.doubt.vertical if estimator.vehicle.source == RECEIVER else 0.0,
    )


def felt_pull(before: FlightState, state: State, setup: Setup) -> float:
    """Pull of the cable on the vehicle (N): what moves it besides weight, rotors, drag and wind."""
    vehicle, a = setup.vehicle, state.a_quad
    felt = (a[0], a[1], a[2] + vehicle.gravity)
    known = axpy(before.actuation.thrust, column(state.R, 2), air_force(state.v_quad, setup.drag))
    if before.observed is not None:
        known = add(known, before.observed.push)
    return dot(sub(scale(vehicle.quad_mass, felt), known), state.q_cable)


def step(
    before: FlightState, history: History, readings: Readings, setup: Setup, now_us: int, tick: int, dt: float
) -> tuple[FlightState, Report]:
    """The state after one tick of `dt` seconds; its `mixed.forces` are what the rotors are to give."""
    flight = cable_now(before.flight, now_us)
    setup = with_cable(setup, flight)
    estimator, tuning = before.estimator, setup.tuning
    if flight.cable.length_m is not None:
        was = before.flight.cable.length_m
        estimator = lengthened(estimator, 0.0 if was is None else flight.cable.length_m - was)
        readings = as_if_firm(readings, estimator, flight.cable.reel_rate)
    before = before._replace(flight=flight)
    if before.flight.cable.released:
        tuning = untied(tuning)
        estimator = parted(estimator, history, tuning)
    estimator = estimate(estimator, history, readings, tuning, dt, before.actuation.thrust)
    before = before._replace(estimator=estimator)
    if not is_due(tick, setup.control_every):
        return before, Report()
    return control(before, setup, now_us)


def control(before: FlightState, setup: Setup, now_us: int) -> tuple[FlightState, Report]:
    """The supervisor's, the law's and the mixer's part of a tick: `before` holds the estimate already."""
    estimator, reel = before.estimator, before.flight
    state = as_reeled(control_state(estimator), estimator, reel.cable.reel_rate)
    pull_n = felt_pull(before, state, setup)
    view = view_of(estimator, state, setup.settings, now_us, pull_n, carries(before.flight))
    flight, report = advance(before.flight, view, setup.settings)

    taut = view.taut
    slack_events = before.slack_events + (before.was_taut and not taut and not flight.cable.released)
    observed = before.observed if before.observed is not None else nominal(setup.vehicle)
    observed = observe(
        observed,
        state,
        1.0 if taut else 0.0,
        before.actuation.thrust,
        setup.observer,
        setup.drag,
        setup.vehicle,
    )
    after = before._replace(flight=flight, slack_events=slack_events, was_taut=taut, observed=observed)
    if flight.phase not in IN_AIR:
        idle = IDLE if flight.phase == Phase.ARMED else STOPPED
        actuation = actuate(after.actuation, idle.thrust_done, idle.moment_done, setup.actuation)
        return after._replace(
            memory=None,
            control_mode=0,
            command=NO_COMMAND,
            mixed=idle,
            actuation=actuation,
            observed=nominal(setup.vehicle)._replace(
                support=observed.support, load_ground=observed.load_ground
            ),
        ), report

    leg = flight.legs[0]
    t = leg_time_s(flight, now_us) + setup.law.preview_s
    if isinstance(leg, Catch):
        jet = leg.meeting(state.x_quad, state.v_quad, state.x_load, state.v_load, setup.vehicle.gravity)
    else:
        jet = jet_ahead(flight, t)
    memory = after.memory
    if memory is None or leg.control_mode != after.control_mode:
        memory = setup.law.start(state, jet[0], jet[1])
    pushed = with_reel(observed, state, reel.cable.reel_accel, setup.vehicle.quad_mass)
    memory, command = track(setup, memory, state, leg, jet, t, after.actuation, pushed)
    mixed = mix(command.thrust, command.moment, setup.vehicle, setup.limited)
    return after._replace(
        memory=memory,
        control_mode=leg.control_mode,
        command=command,
        mixed=mixed,
        actuation=actuate(after.actuation, mixed.thrust_done, mixed.moment_done, setup.actuation),
    ), report


def track(
    setup: Setup,
    memory: Memory,
    state: State,
    leg: Leg,
    jet: Jet,
    t: float,
    actuation: Actuation,
    observed: Observed,
) -> tuple[Memory, Command]:
    """The cascade in the mode that the leg asks for."""
    law, heading = setup.law, E1
    if leg.control_mode == LOAD_POSITION:
        return law.load_position(memory, state, Reference(jet, heading), actuation, observed)
    if leg.control_mode == QUAD_POSITION:
        return law.quad_position(memory, state, Reference(jet, heading), actuation, observed)
    assert isinstance(leg, Swing | Calm | Posture)
    lift = held_height(setup, state, leg.anchor)
    upward = leg.upward(t)
    if leg.control_mode == LOAD_ATTITUDE:
        pull = cable_pull(lift, state.q_cable)
        return law.load_attitude(memory, state, neg(upward), heading, pull, actuation, observed)
    assert leg.control_mode == QUAD_ATTITUDE
    R_d, thrust = attitude_towards(upward, heading, state.R), tilted_thrust(lift, state.R)
    if isinstance(leg, Posture) and leg.lean.thrust_n is not None:
        thrust = leg.lean.thrust_n
    return law.quad_attitude(memory, state, R_d, thrust, actuation, observed)


def held_height(setup: Setup, state: State, anchor: Vec3) -> float:
    """Upward force (N) that keeps the load at the anchor's height while an attitude is tracked."""
    vehicle = setup.vehicle
    mass = vehicle.quad_mass + vehicle.load_mass
    return vertical_force(
        state.x_load[2] - anchor[2],
        state.v_load[2],
        mass * HEIGHT_GAIN,
        mass * CLIMB_GAIN,
        mass * vehicle.gravity,
    )
