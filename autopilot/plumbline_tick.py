"""The law `plumbline` from estimate to mixer: prediction over the delay, cascade, rotor lag.

state, commands on their way -> state at the instant the command is in force -> law -> lag inverted -> command
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.actuation import Actuation, ActuationConstants
from autopilot.control import plumbline
from autopilot.control.load_motion import Drag
from autopilot.control.records import Command, Reference, State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.observer import Observed, loaded, standing
from autopilot.prediction import Ahead, predict, stay
from autopilot.rotor_lag import hasten


class PlumblineConstants(NamedTuple):
    """All that the parameters decide."""

    gains: plumbline.PlumblineGains
    drag: Drag
    actuation: ActuationConstants
    lag_gain: float
    period: float  # s
    vehicle: Vehicle


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
    memory, wanted = plumbline.load_position(
        memory,
        ahead.state,
        reference,
        ahead.thrust,
        ahead.moment,
        constants.gains,
        constants.drag,
        observed.push,
        constants.period,
        loaded(constants.vehicle, observed.load_mass),
    )
    return memory, hastened(wanted, ahead, constants)
