"""The law `plumbline`: every mode is evaluated at the state at which its command will take effect, and the
rotors' lag is compensated.

state, commands on their way -> state when the command takes effect -> law -> lag inverted -> command

Load position and load attitude are flown with exact derivatives (`autopilot.control.plumbline_cascade`). The
other two modes are the loops of the thesis's cascade with its filters and the gains of the design.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from autopilot.control import plumbline_cascade as cascade
from autopilot.control import quad_position as position_law
from autopilot.control.actuators.disturbance_observer import (
    DisturbanceEstimate,
    load_on_ground,
    vehicle_on_ground,
    with_load_mass,
)
from autopilot.control.actuators.lag_compensation import compensate_lag, lag_gain
from autopilot.control.actuators.predictor import Prediction, predict, predict_on_ground
from autopilot.control.actuators.rotor_model import Actuation, ActuationConstants
from autopilot.control.believed import believed_actuation, believed_design, believed_drag
from autopilot.control.command_filter import filter_constants
from autopilot.control.design import MAX_SWING_RATIO, swing_stiffness
from autopilot.control.drag import Drag, drag_force
from autopilot.control.laws import thesis
from autopilot.control.laws.interface import Kernels, Law
from autopilot.control.records import Cable, Command, Jet, Reference, State, Vehicle, with_cable_length
from autopilot.control.thesis_cascade import ThesisMemory, filtered_direction
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import ZERO, Mat3, Vec3, add, axpy, norm, scale, sub
from autopilot.geometry.packed import Row, with_field
from autopilot.wire.parameter_table import ParameterTable

# pace at which load and cable are followed when the load leaves the ground; height (m) of the full pace
LIFTOFF_PACE, FULL_PACE_HEIGHT = 0.5, 0.7
# pace while the rotors cannot give the moment that is asked for; s, in which it falls to this, and in which
# it recovers afterwards (docs/control-log.md)
SATURATED_PACE = 0.5
SATURATION_TIME, RECOVERY_TIME = 0.5, 10.0
# of the greatest moment about a level axis: the rotors give as much less than is asked for
_MISSING_SHARE = 0.02
# of omega_R: the greatest natural frequency of the filter that gives the derivatives of R_c in the modes
# other than load position; a faster one passes noise that the attitude loop cannot follow
ATTITUDE_FILTER_RATIO = 1.5
# m, of the longest cable for which the modes without a load turn the vehicle as the load asks for. The load
# on a longer one asks for less, with which the vehicle would oscillate while its cable is slack.
MAX_SLACK_CABLE = 8.0
# rad/s^3: a commanded direction whose acceleration changes faster has jumped, and has no derivative
MAX_DIRECTION_JERK = 300.0


class PlumblineConstants(NamedTuple):
    """Everything that load position uses and that is derived from parameters."""

    gains: cascade.PlumblineGains
    drag: Drag
    actuation: ActuationConstants
    lag_gain: float
    period: float  # s
    vehicle: Vehicle
    full_pace_length: float  # m, of the longest cable on which the load is followed at the bandwidth designed


class PlumblineLaw(NamedTuple):
    """The law for one length of the cable."""

    constants: PlumblineConstants
    other_modes: thesis.ThesisLaw
    preview_s: float


class PlumblineMemory(NamedTuple):
    """The memory of load position and that of the other modes."""

    position: cascade.PlumblineMemory
    moment: Vec3  # N m, that load position asked for at its last tick
    saturation: float  # 0 ... 1, of the rotors in the last time
    q_c_ddot: Vec3  # 1/s^2, of load attitude at its last tick
    other_modes: ThesisMemory


class PlumblineRows(NamedTuple):
    """The law, packed."""

    constants: Row
    memory: Row


def build(table: ParameterTable, vehicle: Vehicle) -> PlumblineLaw:
    """From PLB_ and VEH_ parameters; filters and position gains of the other modes from NGC_ and QP_."""
    period = 1.0 / table["CTL_RATE_HZ"]
    lag, target_lag = 1e-3 * table["VEH_ROTOR_TAU"], 1e-3 * table["PLB_LAG_TO_MS"]
    found = believed_design(table, vehicle)
    gains = found.gains
    constants = PlumblineConstants(
        gains,
        believed_drag(table),
        believed_actuation(table),
        lag_gain(lag, target_lag, period),
        period,
        vehicle,
        (MAX_SWING_RATIO / found.omega_x) ** 2 * swing_stiffness(vehicle) * vehicle.cable_length,
    )
    other_modes = thesis.build(table, vehicle)
    slack = believed_design(table, with_cable_length(vehicle, min(vehicle.cable_length, MAX_SLACK_CABLE)))
    other_modes = other_modes._replace(
        filters=other_modes.filters._replace(
            attitude=filter_constants(
                min(table["NGC_WN_R"], ATTITUDE_FILTER_RATIO * slack.omega_R), table["NGC_ZETA"], period
            )
        ),
        gains=other_modes.gains._replace(
            k_R=slack.gains.k_R,
            k_Omega=slack.gains.k_Omega,
            k_q=gains.k_q,
            k_omega=gains.k_omega,
            epsilon=1.0,
        ),
    )
    return PlumblineLaw(constants, other_modes, 1e-3 * table["VEH_ACT_DELAY"])


@kernel
def with_cable(law: PlumblineLaw, cable: Cable) -> PlumblineLaw:
    """The law for the present cable; gains scaled so that the cable's loop keeps its bandwidth, but for a
    long cable on which the load swings too slowly for it (`autopilot.control.design`)."""
    c = law.constants
    length_ratio = cable.length / c.vehicle.cable_length
    gains = with_field(c.gains, "k_q", length_ratio * c.gains.k_q)
    gains = with_field(gains, "k_omega", length_ratio * c.gains.k_omega)
    gains = cascade.with_pace(gains, min(1.0, sqrt(c.full_pace_length / cable.length)))
    constants = with_field(
        with_field(c, "gains", gains), "vehicle", with_cable_length(c.vehicle, cable.length)
    )
    return PlumblineLaw(constants, thesis.with_cable(law.other_modes, cable), law.preview_s)


@kernel
def drag_and_push(
    state: State, taut: float, observed: DisturbanceEstimate, constants: PlumblineConstants
) -> tuple[Drag, Vec3]:
    """Drag of the vehicle, including the learned part, and the push (N) besides.

    While the cable is taut, the law works in a frame that falls with the load's acceleration by the air: in
    this frame nothing but the cable holds the load, and the push on the vehicle is reduced by the vehicle's
    mass times this acceleration.
    """
    linear = constants.drag.linear + observed.drag.linear
    push = sub(observed.push, drag_force(state.v_quad, observed.drag))
    if taut > 0.0:
        mass, c = constants.vehicle.quad_mass, observed.load_drag
        linear -= mass * c
        relative_velocity = scale(c, sub(state.v_load, state.v_quad))
        push = axpy(
            -mass, sub(observed.load_air_accel, (relative_velocity[0], relative_velocity[1], 0.0)), push
        )
    return Drag(linear, constants.drag.quadratic + observed.drag.quadratic), push


@kernel
def jet_in_falling_frame(jet: Jet, observed: DisturbanceEstimate) -> Jet:
    """The reference in the falling frame of `drag_and_push`, with the load's drag in all derivatives."""
    x, v, a, j, s, p, o = jet
    c = observed.load_drag
    drift = axpy(c, v, scale(-1.0, observed.load_air_accel))
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
def state_at_effect(
    state: State,
    taut: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    constants: PlumblineConstants,
) -> Prediction:
    """State and rotors at the instant at which the command of this tick takes effect."""
    if vehicle_on_ground(observed):
        return predict_on_ground(state, actuation, constants.actuation)
    drag, push = drag_and_push(state, taut, observed, constants)
    return predict(
        state,
        taut,
        actuation,
        constants.actuation,
        constants.period,
        push,
        observed.torque.total,
        drag,
        with_load_mass(constants.vehicle, observed.load_mass),
    )


@kernel
def compensated_command(
    demand: Command, prediction: Prediction, observed: DisturbanceEstimate, constants: PlumblineConstants
) -> Command:
    """The command that makes the rotors give, with the configured lag, what is wanted, less the torque of the
    air. A vehicle that stands gets no moment: the ground holds its attitude, and a delayed reaction to it
    would only rock the vehicle.
    """
    if vehicle_on_ground(observed):
        return with_field(demand, "moment", ZERO)
    moment = sub(demand.moment, observed.torque.total)
    thrust, moment = compensate_lag(
        prediction.thrust, prediction.moment, demand.thrust, moment, constants.lag_gain
    )
    return with_field(with_field(demand, "thrust", thrust), "moment", moment)


@kernel
def start(law: PlumblineLaw, state: State, x_d: Vec3, v_d: Vec3) -> PlumblineMemory:
    """Memory of a law that begins now: the thrust is assumed to be steady."""
    return PlumblineMemory(cascade.start(), ZERO, 0.0, ZERO, thesis.start(law.other_modes, state, x_d, v_d))


@kernel
def max_pace(state: State, reference: Reference, observed: DisturbanceEstimate) -> float:
    """The greatest pace at which a load is followed while it is lifted: how it lay, the wind on it and its
    mass become apparent only gradually."""
    height = max(0.0, state.x_load[2] - observed.load_ground_height)
    pace = LIFTOFF_PACE + (1.0 - LIFTOFF_PACE) * height / FULL_PACE_HEIGHT
    return if_above(reference.jet[1][2], 0.0, min(1.0, pace), 1.0)


@kernel
def later_saturation(memory: PlumblineMemory, actuation: Actuation, constants: PlumblineConstants) -> float:
    """How much of the last time the rotors could not give the moment that load position asked for about the
    level axes: towards 1 while they cannot, and more slowly towards 0 while they can."""
    queue, limit = actuation.queue, _MISSING_SHARE * cascade.max_level_moment(constants.vehicle)
    asked = memory.moment
    missing = max(abs(asked[0]) - abs(queue[0, 1]), abs(asked[1]) - abs(queue[0, 2]))
    change = if_above(
        missing, limit, (1.0 - memory.saturation) / SATURATION_TIME, -memory.saturation / RECOVERY_TIME
    )
    return memory.saturation + constants.period * change


@kernel
def load_position(
    law: PlumblineLaw,
    memory: PlumblineMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[PlumblineMemory, Command]:
    """The load follows a reference, given for the instant at which the command takes effect."""
    constants = with_cable(law, cable).constants
    position = memory.position
    prediction = state_at_effect(state, 1.0, actuation, observed, constants)
    predicted, thrust = prediction.state, prediction.thrust
    if load_on_ground(observed, state):
        # the ground carries what the rotors do not yet; how the load hangs shows only after it is lifted
        vehicle = constants.vehicle
        thrust = max(thrust, (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity)
        position = cascade.PlumblineMemory(0.0, position.integral, position.pace)
        predicted = with_field(with_field(predicted, "x_load", state.x_load), "v_load", state.v_load)
    saturation = later_saturation(memory, actuation, constants)
    pace = min(max_pace(state, reference, observed), 1.0 - (1.0 - SATURATED_PACE) * saturation)
    position = with_field(position, "pace", min(position.pace, pace))
    drag, push = drag_and_push(state, 1.0, observed, constants)
    position, demand = cascade.load_position(
        position,
        predicted,
        with_field(reference, "jet", jet_in_falling_frame(reference.jet, observed)),
        thrust,
        add(prediction.moment, observed.torque.total),
        constants.gains,
        drag,
        push,
        constants.period,
        with_load_mass(constants.vehicle, observed.load_mass),
    )
    command = compensated_command(demand, prediction, observed, constants)
    return PlumblineMemory(position, command.moment, saturation, memory.q_c_ddot, memory.other_modes), command


@kernel
def quad_position(
    law: PlumblineLaw,
    memory: PlumblineMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[PlumblineMemory, Command]:
    """The vehicle follows a reference, without a load."""
    adapted = with_cable(law, cable)
    constants, others = adapted.constants, adapted.other_modes
    prediction = state_at_effect(state, 0.0, actuation, observed, constants)
    other, demand = position_law.quad_position(
        memory.other_modes,
        prediction.state,
        reference,
        0.0,
        observed.push,
        others.position_gains,
        others.gains,
        others.filters,
        constants.vehicle,
    )
    return with_field(memory, "other_modes", other), compensated_command(
        demand, prediction, observed, constants
    )


@kernel
def load_attitude(
    law: PlumblineLaw,
    memory: PlumblineMemory,
    state: State,
    q_d: Vec3,
    b1_d: Vec3,
    pull: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[PlumblineMemory, Command]:
    """The cable's direction follows q_d, passed through the filter of the thesis, under a given pull (N)."""
    constants = with_cable(law, cable).constants
    prediction = state_at_effect(state, 1.0, actuation, observed, constants)
    other = memory.other_modes
    direction, q_c = filtered_direction(other.direction, q_d, law.other_modes.filters.direction)
    q_c_dddot = scale(1.0 / constants.period, sub(q_c.q_c_ddot, memory.q_c_ddot))
    if norm(q_c_dddot) > MAX_DIRECTION_JERK:
        q_c_dddot = ZERO
    drag, push = drag_and_push(state, 1.0, observed, constants)
    position, demand = cascade.load_attitude(
        memory.position,
        prediction.state,
        q_c,
        q_c_dddot,
        b1_d,
        pull,
        prediction.thrust,
        add(prediction.moment, observed.torque.total),
        constants.gains,
        drag,
        push,
        with_load_mass(constants.vehicle, observed.load_mass),
    )
    other = with_field(other, "direction", direction)
    memory = PlumblineMemory(position, ZERO, 0.0, q_c.q_c_ddot, other)
    return memory, compensated_command(demand, prediction, observed, constants)


@kernel
def quad_attitude(
    law: PlumblineLaw,
    memory: PlumblineMemory,
    state: State,
    R_d: Mat3,
    thrust: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[PlumblineMemory, Command]:
    """The vehicle's attitude follows R_d under a given thrust (N)."""
    constants = with_cable(law, cable).constants
    prediction = state_at_effect(state, 1.0, actuation, observed, constants)
    other, demand = thesis.quad_attitude(
        law.other_modes, memory.other_modes, prediction.state, R_d, thrust, actuation, observed, cable
    )
    return with_field(memory, "other_modes", other), compensated_command(
        demand, prediction, observed, constants
    )


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
