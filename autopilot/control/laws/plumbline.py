"""The law `plumbline`: every mode is evaluated at the state at which its command will take effect, and the
rotors' lag is compensated.

state, commands on their way -> state when the command takes effect -> law -> lag inverted -> command

Load position is flown with exact derivatives (`autopilot.control.plumbline_cascade`). The other modes,
which are flown only briefly, are the loops of the thesis's cascade with its filters and the gains of the
design.
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
from autopilot.control.drag import Drag, air_force
from autopilot.control.laws import thesis
from autopilot.control.laws.interface import Kernels, Law
from autopilot.control.records import Cable, Command, Jet, Reference, State, Vehicle, with_length
from autopilot.control.thesis_cascade import ThesisMemory
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import ZERO, Mat3, Vec3, add, axpy, scale, sub
from autopilot.geometry.packed import Row, with_field
from autopilot.wire.parameter_table import ParameterTable

# pace at which load and cable are followed when the load leaves the ground; height (m) of the full pace
LIFTING_PACE, LIFTED = 0.5, 0.7


class PlumblineConstants(NamedTuple):
    """Everything that load position uses and that is derived from parameters."""

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
    """The memory of load position and that of the other modes."""

    position: cascade.PlumblineMemory
    other_modes: ThesisMemory


class PlumblineRows(NamedTuple):
    """The law, packed."""

    constants: Row
    memory: Row


def build(table: ParameterTable, vehicle: Vehicle) -> PlumblineLaw:
    """From PLB_ and VEH_ parameters; filters and position gains of the other modes from NGC_ and QP_."""
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
    """The law for the present cable; gains scaled so that the cable's loop keeps its bandwidth."""
    c = law.constants
    longer = cable.length / c.vehicle.cable_length
    gains = with_field(c.gains, "k_q", longer * c.gains.k_q)
    gains = with_field(gains, "k_omega", longer * c.gains.k_omega)
    constants = with_field(with_field(c, "gains", gains), "vehicle", with_length(c.vehicle, cable.length))
    return PlumblineLaw(constants, thesis.with_cable(law.other_modes, cable), law.preview_s)


@kernel
def air_of(state: State, taut: float, observed: Observed, constants: PlumblineConstants) -> tuple[Drag, Vec3]:
    """Drag of the vehicle, including the learned part, and the push (N) besides.

    While the cable is taut, the law works in a frame that falls with the load's acceleration by the air: in
    this frame nothing but the cable holds the load, and the push on the vehicle is reduced by the vehicle's
    mass times this acceleration.
    """
    linear = constants.drag.linear + observed.drag.linear
    push = sub(observed.push, air_force(state.v_quad, observed.drag))
    if taut > 0.0:
        mass, c = constants.vehicle.quad_mass, observed.load_drag
        linear -= mass * c
        apart = scale(c, sub(state.v_load, state.v_quad))
        push = axpy(-mass, sub(observed.load_air, (apart[0], apart[1], 0.0)), push)
    return Drag(linear, constants.drag.quadratic + observed.drag.quadratic), push


@kernel
def falling(jet: Jet, observed: Observed) -> Jet:
    """The reference in the falling frame of `air_of`, with the load's drag added in all derivatives."""
    x, v, a, j, s, p, o = jet
    c = observed.load_drag
    drift = axpy(c, v, scale(-1.0, observed.load_air))
    return (
        x,
        v,
        add(a, (drift[0], drift[1], 0.0)),
        add(j, (c * a[0], c * a[1], 0.0)),
        add(s, (c * j[0], c * j[1], 0.0)),
        add(p, (c * s[0], c * s[1], 0.0)),
        add(o, (c * p[0], c * p[1], 0.0)),
    )


@kernel
def ahead_of(
    state: State,
    taut: float,
    actuation: Actuation,
    observed: Observed,
    constants: PlumblineConstants,
) -> Ahead:
    """State and rotors at the instant at which the command of this tick takes effect."""
    if standing(observed, constants.vehicle):
        return stay(state, actuation, constants.actuation)
    drag, push = air_of(state, taut, observed, constants)
    return predict(
        state,
        taut,
        actuation,
        constants.actuation,
        constants.period,
        push,
        observed.torque.now,
        drag,
        loaded(constants.vehicle, observed.load_mass),
    )


@kernel
def hastened(wanted: Command, ahead: Ahead, observed: Observed, constants: PlumblineConstants) -> Command:
    """The command that makes the rotors give, with the configured lag, what is wanted, less the torque of the
    air. A vehicle that stands gets no moment: the ground holds its attitude, and a delayed reaction to it
    would only rock the vehicle.
    """
    if standing(observed, constants.vehicle):
        return with_field(wanted, "moment", ZERO)
    moment = sub(wanted.moment, observed.torque.now)
    thrust, moment = hasten(ahead.thrust, ahead.moment, wanted.thrust, moment, constants.lag_gain)
    return with_field(with_field(wanted, "thrust", thrust), "moment", moment)


@kernel
def start(law: PlumblineLaw, state: State, x_d: Vec3, v_d: Vec3) -> PlumblineMemory:
    """Memory of a law that begins now: the thrust is assumed to be steady."""
    return PlumblineMemory(cascade.start(), thesis.start(law.other_modes, state, x_d, v_d))


@kernel
def greatest_pace(state: State, reference: Reference, observed: Observed) -> float:
    """The greatest pace at which a load is followed while it is lifted: how it lay, the wind on it and its
    mass become apparent only gradually."""
    height = max(0.0, state.x_load[2] - observed.load_ground)
    rising = LIFTING_PACE + (1.0 - LIFTING_PACE) * height / LIFTED
    return if_above(reference.jet[1][2], 0.0, min(1.0, rising), 1.0)


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
    """The load follows a reference, given for the instant at which the command takes effect."""
    constants = with_cable(law, cable).constants
    position = memory.position
    ahead = ahead_of(state, 1.0, actuation, observed, constants)
    then, thrust = ahead.state, ahead.thrust
    if lying(observed, state):
        # the ground carries what the rotors do not yet; how the load hangs shows only after it is lifted
        vehicle = constants.vehicle
        thrust = max(thrust, (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity)
        position = cascade.PlumblineMemory(0.0, position.integral, position.pace)
        then = with_field(with_field(then, "x_load", state.x_load), "v_load", state.v_load)
    position = with_field(position, "pace", min(position.pace, greatest_pace(state, reference, observed)))
    drag, push = air_of(state, 1.0, observed, constants)
    position, wanted = cascade.load_position(
        position,
        then,
        with_field(reference, "jet", falling(reference.jet, observed)),
        thrust,
        add(ahead.moment, observed.torque.now),
        constants.gains,
        drag,
        push,
        constants.period,
        loaded(constants.vehicle, observed.load_mass),
    )
    return PlumblineMemory(position, memory.other_modes), hastened(wanted, ahead, observed, constants)


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
    """The vehicle follows a reference, without a load."""
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
    return PlumblineMemory(memory.position, other), hastened(wanted, ahead, observed, constants)


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
    return PlumblineMemory(memory.position, other), hastened(wanted, ahead, observed, constants)


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
    return PlumblineMemory(memory.position, other), hastened(wanted, ahead, observed, constants)


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
