"""The law `plumbline` from estimate to mixer: prediction over the delay, cascade, rotor lag.

state, commands on their way -> state at the instant the command is in force -> law -> lag inverted -> command
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control import quad_position
from autopilot.control.actuators.disturbance_observer import Observed, loaded, lying, standing
from autopilot.control.actuators.lag_compensation import hasten
from autopilot.control.actuators.predictor import Ahead, predict, stay
from autopilot.control.actuators.rotor_model import Actuation, ActuationConstants
from autopilot.control.laws import plumbline, thesis
from autopilot.control.load_motion import Drag
from autopilot.control.records import Command, Reference, State, Vehicle
from autopilot.geometry.kernel import kernel


class PlumblineConstants(NamedTuple):
    """All that the parameters decide."""

    gains: plumbline.PlumblineGains
    drag: Drag
    actuation: ActuationConstants
    lag_gain: float
    period: float  # s
    vehicle: Vehicle


class SlackConstants(NamedTuple):
    """What the vehicle is flown with while the cable is slack."""

    position_gains: quad_position.QuadPositionGains
    gains: thesis.ThesisGains
    filters: thesis.ThesisFilters


@kernel
def ahead_of(
    state: State,
    taut: float,
    actuation: Actuation,
    observed: Observed,
    constants: PlumblineConstants,
) -> Ahead:
    """State and rotors at the instant at which the command of this tick comes into force."""
    if standing(observed, constants.vehicle):
        return stay(state, actuation, constants.actuation)
    return predict(
        state,
        taut,
        actuation,
        constants.actuation,
        constants.period,
        observed.push,
        constants.drag,
        loaded(constants.vehicle, observed.load_mass),
    )


@kernel
def hastened(wanted: Command, ahead: Ahead, constants: PlumblineConstants) -> Command:
    """The command that makes the rotors give what is wanted as fast as they shall."""
    c = wanted
    thrust, moment = hasten(ahead.thrust, ahead.moment, c.thrust, c.moment, constants.lag_gain)
    return Command(
        thrust, moment, c.e_x, c.e_v, c.e_q, c.e_q_dot, c.e_R, c.e_Omega, c.psi_R, c.psi_q, c.q_c, c.R_c
    )


@kernel
def quad_position_tick(
    memory: thesis.ThesisMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: Observed,
    constants: PlumblineConstants,
    slack: SlackConstants,
) -> tuple[thesis.ThesisMemory, Command]:
    """Vehicle position mode, for a slack cable. The reference is that of the instant of the command."""
    ahead = ahead_of(state, 0.0, actuation, observed, constants)
    memory, wanted = quad_position.quad_position(
        memory,
        ahead.state,
        reference,
        0.0,
        observed.push,
        slack.position_gains,
        slack.gains,
        slack.filters,
        constants.vehicle,
    )
    return memory, hastened(wanted, ahead, constants)


@kernel
def load_position_tick(
    memory: plumbline.PlumblineMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: Observed,
    constants: PlumblineConstants,
) -> tuple[plumbline.PlumblineMemory, Command]:
    """Load position mode. The reference is that of the instant at which the command comes into force."""
    ahead = ahead_of(state, 1.0, actuation, observed, constants)
    then, thrust = ahead.state, ahead.thrust
    if lying(observed, state):
        # the ground gives what the rotors do not yet
        vehicle = constants.vehicle
        thrust = max(thrust, (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity)
        memory = plumbline.PlumblineMemory(0.0, memory.integral)
        then = State(
            state.x_load,
            state.v_load,
            then.q_cable,
            then.q_cable_dot,
            then.x_quad,
            then.v_quad,
            then.R,
            then.omega_body,
            then.a_quad,
        )
    memory, wanted = plumbline.load_position(
        memory,
        then,
        reference,
        thrust,
        ahead.moment,
        constants.gains,
        constants.drag,
        observed.push,
        constants.period,
        loaded(constants.vehicle, observed.load_mass),
    )
    return memory, hastened(wanted, ahead, constants)
