"""The law `plumbline`: every mode at the state at which its command will find the vehicle, with rotors
hastened by their lag.

state, commands on their way -> state at the instant the command is in force -> law -> lag inverted -> command

Load position is flown with exact derivatives (`autopilot.control.plumbline_cascade`). The other modes,
which are flown for moments only, are the loops of the thesis's cascade with its filters and the gains of
the design.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control import plumbline_cascade as cascade
from autopilot.control import quad_position as position_law
from autopilot.control.actuators.disturbance_observer import Observed, loaded, lying, standing
from autopilot.control.actuators.lag_compensation import hasten, lag_gain
from autopilot.control.actuators.predictor import Ahead, predict, stay
from autopilot.control.actuators.rotor_model import Actuation, ActuationConstants
from autopilot.control.believed import believed_actuation, believed_design, believed_drag
from autopilot.control.laws import thesis
from autopilot.control.laws.interface import Kernels, Law
from autopilot.control.load_motion import Drag
from autopilot.control.records import Cable, Command, Reference, State, Vehicle, with_length
from autopilot.control.thesis_cascade import ThesisMemory
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3
from autopilot.geometry.packed import Row, with_field
from autopilot.wire.parameter_table import ParameterTable


class PlumblineConstants(NamedTuple):
    """Everything derived from parameters that load position uses."""

    gains: cascade.PlumblineGains
    drag: Drag
    actuation: ActuationConstants
    lag_gain: float
    period: float  # s
    vehicle: Vehicle


class PlumblineLaw(NamedTuple):
    """The law for one length of the cable."""

    constants: PlumblineConstants
    other_modes: thesis.ThesisLaw
    preview_s: float


class PlumblineMemory(NamedTuple):
    """What the law remembers: of load position, and of the other modes."""

    position: cascade.PlumblineMemory
    other_modes: ThesisMemory


class PlumblineRows(NamedTuple):
    """The law, packed."""

    constants: Row
    memory: Row


def build(table: ParameterTable, vehicle: Vehicle) -> PlumblineLaw:
    """From the PLB_ and VEH_ parameters; the other modes from NGC_ and QP_."""
    period = 1.0 / table["CTL_RATE_HZ"]
    lag, shown = 1e-3 * table["VEH_ROTOR_TAU"], 1e-3 * table["PLB_LAG_TO_MS"]
    gains = believed_design(table, vehicle).gains
    constants = PlumblineConstants(
        gains,
        believed_drag(table),
        believed_actuation(table),
        lag_gain(lag, shown, period),
        period,
        vehicle,
    )
    others = thesis.build(table, vehicle)
    others = others._replace(
        gains=others.gains._replace(
            k_R=gains.k_R, k_Omega=gains.k_Omega, k_q=gains.k_q, k_omega=gains.k_omega, epsilon=1.0
        )
    )
    return PlumblineLaw(constants, others, 1e-3 * table["VEH_ACT_DELAY"])


@kernel
def with_cable(law: PlumblineLaw, cable: Cable) -> PlumblineLaw:
    """The law for the present cable: the loops about it as fast as they were."""
    c = law.constants
    longer = cable.length / c.vehicle.cable_length
    gains = with_field(c.gains, "k_q", longer * c.gains.k_q)
    gains = with_field(gains, "k_omega", longer * c.gains.k_omega)
    constants = with_field(with_field(c, "gains", gains), "vehicle", with_length(c.vehicle, cable.length))
    return PlumblineLaw(constants, thesis.with_cable(law.other_modes, cable), law.preview_s)


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
    thrust, moment = hasten(ahead.thrust, ahead.moment, wanted.thrust, wanted.moment, constants.lag_gain)
    return with_field(with_field(wanted, "thrust", thrust), "moment", moment)


@kernel
def start(law: PlumblineLaw, state: State, x_d: Vec3, v_d: Vec3) -> PlumblineMemory:
    """Memory of a law that begins now: the thrust is taken for steady."""
    return PlumblineMemory(cascade.start(), thesis.start(law.other_modes, state, x_d, v_d))


@kernel
def load_position(
    law: PlumblineLaw,
    memory: PlumblineMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: Observed,
    cable: Cable,
) -> tuple[PlumblineMemory, Command]:
    """The load follows a reference, which is that of the instant at which the command comes into force."""
    constants = with_cable(law, cable).constants
    position = memory.position
    ahead = ahead_of(state, 1.0, actuation, observed, constants)
    then, thrust = ahead.state, ahead.thrust
    if lying(observed, state):
        # the ground gives what the rotors do not yet
        vehicle = constants.vehicle
        thrust = max(thrust, (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity)
        position = cascade.PlumblineMemory(0.0, position.integral)
        then = with_field(with_field(then, "x_load", state.x_load), "v_load", state.v_load)
    position, wanted = cascade.load_position(
        position,
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
    return PlumblineMemory(position, memory.other_modes), hastened(wanted, ahead, constants)


@kernel
def quad_position(
    law: PlumblineLaw,
    memory: PlumblineMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: Observed,
    cable: Cable,
) -> tuple[PlumblineMemory, Command]:
    """The vehicle follows a reference, nothing hanging on it."""
    now = with_cable(law, cable)
    constants, others = now.constants, now.other_modes
    ahead = ahead_of(state, 0.0, actuation, observed, constants)
    other, wanted = position_law.quad_position(
        memory.other_modes,
        ahead.state,
        reference,
        0.0,
        observed.push,
        others.position_gains,
        others.gains,
        others.filters,
        constants.vehicle,
    )
    return PlumblineMemory(memory.position, other), hastened(wanted, ahead, constants)


@kernel
def load_attitude(
    law: PlumblineLaw,
    memory: PlumblineMemory,
    state: State,
    q_d: Vec3,
    b1_d: Vec3,
    pull: float,
    actuation: Actuation,
    observed: Observed,
    cable: Cable,
) -> tuple[PlumblineMemory, Command]:
    """The cable's direction follows q_d under a given pull (N)."""
    constants = with_cable(law, cable).constants
    ahead = ahead_of(state, 1.0, actuation, observed, constants)
    other, wanted = thesis.load_attitude(
        law.other_modes, memory.other_modes, ahead.state, q_d, b1_d, pull, actuation, observed, cable
    )
    return PlumblineMemory(memory.position, other), hastened(wanted, ahead, constants)


@kernel
def quad_attitude(
    law: PlumblineLaw,
    memory: PlumblineMemory,
    state: State,
    R_d: Mat3,
    thrust: float,
    actuation: Actuation,
    observed: Observed,
    cable: Cable,
) -> tuple[PlumblineMemory, Command]:
    """The vehicle's attitude follows R_d under a given thrust (N)."""
    constants = with_cable(law, cable).constants
    ahead = ahead_of(state, 1.0, actuation, observed, constants)
    other, wanted = thesis.quad_attitude(
        law.other_modes, memory.other_modes, ahead.state, R_d, thrust, actuation, observed, cable
    )
    return PlumblineMemory(memory.position, other), hastened(wanted, ahead, constants)


LAW = Law(
    name="plumbline",
    number=2,
    constants=PlumblineLaw,
    memory=PlumblineMemory,
    rows=PlumblineRows,
    build=build,
    kernels=Kernels(start, load_position, quad_position, load_attitude, quad_attitude),
    preview_s=lambda law: law.preview_s,
    follows_shaped=True,
)
