"""One tick of the flight software: the one function that flies, in the processes and in a sweep.

readings -> estimate -> (may the supervisor have to decide?) -> law -> mixer -> rotors

The data carried from tick to tick lies in `CoreRows`, flat arrays that `fly_tick` reads and writes. The law's
half of the tick, `control_tick`, is compiled for each law, which the compiler distinguishes by the type of
the law's rows, and is called by its address, so that the part common to all laws is compiled once. Where the
supervisor may have to decide, the tick stops after the estimate and returns TO_DECIDE:
`autopilot.core.flight_core` then lets the supervisor decide, in Python, and calls again for the rest of the
tick. No clock, no socket, no hidden state.
"""

from __future__ import annotations

from math import isnan
from typing import Any, NamedTuple

from numba.extending import overload

from autopilot.control.actuators.disturbance_observer import (
    DisturbanceEstimate,
    ObserverConstants,
    nominal_on_ground,
    observe,
    part_along_cable,
    slowed_by_noise,
    with_extra_load,
    with_extra_weight,
    with_wind_on_load,
)
from autopilot.control.actuators.lag_equalisation import equalise_lags
from autopilot.control.actuators.mixer import (
    EXPECTED_FORCE,
    FORCE,
    LOST_COUNT,
    MISSED_COUNT,
    REPORTED_SPEED,
    MixerResult,
    equal_forces,
)
from autopilot.control.actuators.rotor_model import Actuation, ActuationConstants
from autopilot.control.actuators.rotor_model import advance as actuate
from autopilot.control.actuators.thrust_factor import (
    applied_factor,
    full_speed_force,
    learned_factor,
    mix_with_factor,
)
from autopilot.control.drag import Drag, drag_force
from autopilot.control.height import cable_pull, tilted_thrust, vertical_force
from autopilot.control.laws.interface import constants_of, kernels_of, memory_of
from autopilot.control.records import (
    Cable,
    Command,
    HeadingReference,
    Jet,
    Reference,
    State,
    Vehicle,
    with_cable_length,
)
from autopilot.control.thesis_cascade import attitude_towards
from autopilot.core.attachment import cable_moment, off_centre, shift_to_attachment
from autopilot.estimation.filter import (
    control_state,
    estimate,
    inertial_problem,
    load_problem,
    vehicle_problem,
)
from autopilot.estimation.inbox import IMU, KIND, READING, ROTOR_SPEEDS, SAMPLE_TIME_US, is_valid_imu
from autopilot.estimation.records import (
    RECEIVER,
    TRACKER,
    Array,
    EstimatorState,
    EstimatorTuning,
    History,
    ImuReading,
)
from autopilot.estimation.tautness import with_learned_mass
from autopilot.estimation.vibration import measured_accel_noise
from autopilot.geometry.addresses import call_at, call_kernel_at, numbers_at
from autopilot.geometry.compiler import INNER_OPTIONS
from autopilot.geometry.entry import kernel_address_of
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above, row_count, table_value
from autopilot.geometry.linear import E3, IDENTITY, ZERO, Vec3, add, axpy, column, neg, norm, scale, sub
from autopilot.geometry.packed import IntPerLane, Row, pack, unpack, with_field
from autopilot.geometry.so3 import tilt_angle
from autopilot.guidance.legs import LOAD_ATTITUDE, LOAD_POSITION, QUAD_POSITION
from autopilot.supervisor.quiescence import UNCONTROLLED, Stretch, may_need_decision
from autopilot.vehicle.rotors import STRENGTH
from autopilot.wire.convert.simulator import force_at

HEIGHT_GAIN, CLIMB_GAIN = 12.0, 5.5  # 1/s^2, 1/s: k_x and k_v of Table 4-3 over the mass of Table 4-1
IDLE_FORCE_N = 0.05  # of each rotor while armed on the ground
NO_COMMAND = Command(0.0, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0.0, 0.0, neg(E3), IDENTITY)
STOPPED = MixerResult(0, 0.0, ZERO)
# a rotor is lost if LOST_COUNT of its reported speeds in a row show that it gives less than LOST_SHARE of
# the force that has long been commanded, reduced by SPEED_TOLERANCE of its greatest force
LOST_SHARE, SPEED_TOLERANCE = 0.3, 0.03

_control_addresses: dict[type, int] = {}  # of `control_tick`, by the type of the law's rows

# results of a tick
ESTIMATED, FLOWN, TO_DECIDE = 0, 1, 2


class CoreConstants(NamedTuple):
    """Everything derived from parameters, except for the law's constants."""

    tuning: EstimatorTuning
    vehicle: Vehicle
    limited: float  # 1.0: the rotors have limits
    actuation: ActuationConstants
    observer: ObserverConstants
    drag: Drag
    control_every: int  # ticks
    sensor_age_s: float  # greatest age of a reading that is good enough for flight
    rotor_watch: float  # period over the time after which a rotor must give the force commanded of it
    factor_share: float  # period over the time constant of the thrust factor
    yaw_free: bool  # yaw is not controlled: any heading is accepted
    estimator: int  # address of the function that runs a custom estimator; 0: there is none
    slot_address: int  # address of its argument (`autopilot.core.estimator_slot`)


class Winch(NamedTuple):
    """The cable at this tick."""

    cable: Cable
    length_change: float  # m, since the last tick
    released: bool  # nothing ties the load to the vehicle


class ControlMemory(NamedTuple):
    """What the control half carries from tick to tick, beside the law's memory."""

    command: Command
    mixed: MixerResult
    thrust_factor: float  # force that the rotors give over the commanded force
    thrust: float  # N, assumed of the rotors
    moment: Vec3  # N m
    observed: DisturbanceEstimate
    control_mode: int  # for which the law's memory was made; UNCONTROLLED: there is no memory
    slack_events: IntPerLane
    was_taut: bool


class EstimateSummary(NamedTuple):
    """What the supervisor uses of the estimate."""

    state: State
    taut: bool
    load_tracked: bool  # a sensor measures the load's position; else its distance is the assumed length
    tilt_rad: float
    pull_n: float  # of the cable on the vehicle, as measured by the accelerometer
    height_std: float  # m, of heights above home, where a receiver measures them
    vehicle_problem: int
    load_problem: int
    inertial_age: float  # s, since the last new sample of the inertial unit
    rotors_lost: int  # bit i: rotor i+1 does not follow its commands


class CoreRows(NamedTuple):
    """The memory of the flight software, written in place."""

    estimator: Row  # EstimatorState
    control: Row  # ControlMemory
    summary: Row  # EstimateSummary, of the last tick
    commands: Array  # (rows, 4) commands on their way to the rotors, as in `Actuation.queue`
    history: History
    inbox: Array  # readings of this tick, as in `autopilot.estimation.inbox`
    constants: Row  # CoreConstants
    winch: Row  # Winch
    stretch: Row  # Stretch
    targets: Array  # (ticks, 21) setpoints of load or vehicle, from the stretch's first tick on
    references: Array  # the same for the law: later by its preview
    rotors: Array  # (7, MAX_ROTORS) forces of the rotors and the data that watch them, rows as in the mixer
    table: Array  # (rotors + 1, 10) of the mixer, and what makes the rotors alike


class CompiledLaw(NamedTuple):
    """The rows of any law, and the address of the machine code of `control_tick` for it."""

    constants: Row
    memory: Row
    control: int


@kernel
def row_at(stretch: Stretch, now_us: int) -> int:
    """The row of the stretch's setpoints for this tick."""
    return (now_us - stretch.first_us) // stretch.period_us


@kernel
def vector_at(table: Array, at: int, first: int) -> Vec3:
    """Three numbers of a row of setpoints."""
    return (
        table_value(table, at, first),
        table_value(table, at, first + 1),
        table_value(table, at, first + 2),
    )


@kernel
def _jet(table: Array, at: int) -> Jet:
    return (
        vector_at(table, at, 0),
        vector_at(table, at, 3),
        vector_at(table, at, 6),
        vector_at(table, at, 9),
        vector_at(table, at, 12),
        vector_at(table, at, 15),
        vector_at(table, at, 18),
    )


@kernel
def observed_pull(control: ControlMemory, state: State, extra_mass: float, constants: CoreConstants) -> float:
    """Pull of the cable on the vehicle (N): the force on it besides weight, rotors, drag and wind.
    `extra_mass` (kg) is the mass of the vehicle beyond the assumed one."""
    vehicle, a = constants.vehicle, state.a_quad
    specific_force = (a[0], a[1], a[2] + vehicle.gravity)
    known = axpy(control.thrust, column(state.R, 2), drag_force(state.v_quad, constants.drag))
    known = add(known, with_extra_weight(control.observed, extra_mass, vehicle).push)
    return part_along_cable(
        sub(scale(vehicle.quad_mass, specific_force), known), state.q_cable, column(state.R, 2)
    )


@kernel
def learned_extra_mass(estimator: EstimatorState, constants: CoreConstants) -> float:
    """The mass (kg) of the vehicle beyond the assumed one, as far as the estimator has learned it."""
    tuning = constants.tuning
    return with_learned_mass(tuning, estimator.slack_pull).quad_mass - tuning.quad_mass


@kernel
def rotors_lost(rows: CoreRows, count: int, vehicle: Vehicle, limited: float) -> int:
    """The rotors (as bits) whose reported speeds, in the inbox, show repeatedly that they do not follow their
    commands, and those that are known to be lost."""
    table, rotors = rows.table, rows.rotors
    for i in range(count):
        if rows.inbox[i, KIND] != ROTOR_SPEEDS:
            continue
        first = int(rows.inbox[i, READING])
        for j in range(first, min(first + 4, table.shape[0] - 1)):
            full = full_speed_force(table[j, STRENGTH], vehicle, limited)
            reported_force = force_at(rows.inbox[i, READING + 1 + j - first], full)
            required_force = LOST_SHARE * rotors[EXPECTED_FORCE, j] - SPEED_TOLERANCE * full
            rotors[REPORTED_SPEED, j] = rows.inbox[i, READING + 1 + j - first]
            rotors[MISSED_COUNT, j] = if_above(
                required_force, max(reported_force, 0.0), rotors[MISSED_COUNT, j] + 1.0, 0.0
            )
    lost = unpack(Stretch, rows.stretch, 0).rotors_lost
    for j in range(table.shape[0] - 1):
        if rotors[MISSED_COUNT, j] >= LOST_COUNT:
            lost |= 1 << j
    return lost


@kernel
def update_expected_forces(rows: CoreRows, share: float) -> None:
    """Update the least force commanded of each rotor for so long that the rotor must give it."""
    rotors = rows.rotors
    for j in range(rows.table.shape[0] - 1):
        commanded, before = rotors[FORCE, j], rotors[EXPECTED_FORCE, j]
        rotors[EXPECTED_FORCE, j] = if_above(
            before, commanded, commanded, before + share * (commanded - before)
        )


@kernel
def update_estimate(rows: CoreRows, count: int, now_us: int, dt: float) -> None:
    """Advance the estimate by `dt` seconds and the first `count` readings of the inbox, and update
    `EstimateSummary`."""
    constants = unpack(CoreConstants, rows.constants, 0)
    winch, control = unpack(Winch, rows.winch, 0), unpack(ControlMemory, rows.control, 0)
    if off_centre(constants.vehicle):
        known = unpack(EstimatorState, rows.estimator, 0)
        shift_to_attachment(rows.inbox, count, known, constants.vehicle.attachment)
    tied = winch.cable
    if winch.released:
        tied = Cable(float("inf"), winch.cable.rate, winch.cable.accel)
    estimator = estimate(
        unpack(EstimatorState, rows.estimator, 0),
        rows.history,
        rows.inbox,
        count,
        now_us,
        constants.tuning,
        tied,
        winch.length_change,
        dt,
        control.thrust,
        control.moment,
    )
    pack(estimator, rows.estimator, 0)
    state = control_state(estimator, winch.cable)
    silent_s = unpack(EstimateSummary, rows.summary, 0).inertial_age + dt
    for i in range(count):
        new = rows.inbox[i, KIND] == IMU and rows.inbox[i, SAMPLE_TIME_US] == now_us
        if new and is_valid_imu(unpack(ImuReading, rows.inbox[i], READING)):
            silent_s = 0.0
    lost = rotors_lost(rows, count, constants.vehicle, constants.limited)
    problem = inertial_problem(silent_s)
    if problem == 0:
        problem = vehicle_problem(estimator, constants.sensor_age_s)
    summary = EstimateSummary(
        state,
        estimator.load.taut > 0.0,
        estimator.load.source == TRACKER,
        tilt_angle(state.R),
        observed_pull(control, state, learned_extra_mass(estimator, constants), constants),
        estimator.uncertainty.vertical if estimator.vehicle.source == RECEIVER else 0.0,
        problem,
        load_problem(estimator, constants.sensor_age_s),
        silent_s,
        lost,
    )
    pack(summary, rows.summary, 0)


@kernel
def height_hold_force(state: State, anchor_height: float, vehicle: Vehicle) -> float:
    """Upward force (N) that keeps the load at a height (m) while an attitude is tracked."""
    mass = vehicle.quad_mass + vehicle.load_mass
    return vertical_force(
        state.x_load[2] - anchor_height,
        state.v_load[2],
        mass * HEIGHT_GAIN,
        mass * CLIMB_GAIN,
        mass * vehicle.gravity,
    )


@kernel
def with_reel_force(
    observed: DisturbanceEstimate, state: State, accel: float, quad_mass: float
) -> DisturbanceEstimate:
    """The observed push on the vehicle, plus the force to which the winch's acceleration is equivalent.

    In the motion of load and cable, L'' has the same effect as a force m_Q L'' q on the vehicle, because
    T = mu (q . (F_L / m_L - F_Q / m_Q) + L |q'|^2 - L''). The term 2 L' / L q' in q'' is left out: with L' up
    to 1 m/s it is small beside the damping of the cable's loop.
    """
    if accel == 0.0:
        return observed
    return with_field(observed, "push", axpy(quad_mass * accel, state.q_cable, observed.push))


@kernel
def run_law(
    law: Any,
    memory: Any,
    state: State,
    jet: Jet,
    stretch: Stretch,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
    vehicle: Vehicle,
) -> Any:
    """Run the law in the mode that the stretch requests; returns its memory and its command."""
    kernels = kernels_of(law)
    heading = stretch.heading
    reference = Reference(jet, heading.b1_d, heading.b1_d_dot, heading.b1_d_ddot)
    if stretch.mode == LOAD_POSITION:
        return kernels.load_position(law, memory, state, reference, actuation, observed, cable)
    if stretch.mode == QUAD_POSITION:
        return kernels.quad_position(law, memory, state, reference, actuation, observed, cable)
    lift = height_hold_force(state, stretch.anchor_height, vehicle)
    if stretch.mode == LOAD_ATTITUDE:
        pull = cable_pull(lift, state.q_cable)
        return kernels.load_attitude(
            law, memory, state, neg(stretch.upward), heading.b1_d, pull, actuation, observed, cable
        )
    R_d = attitude_towards(stretch.upward, heading.b1_d, state.R)
    thrust = tilted_thrust(lift, state.R) if isnan(stretch.thrust) else stretch.thrust
    return kernels.quad_attitude(law, memory, state, R_d, thrust, actuation, observed, cable)


@kernel
def control_tick(rows: CoreRows, law_rows: Any, now_us: int) -> None:
    """Observer, law and mixer for the estimate of this tick."""
    constants = unpack(CoreConstants, rows.constants, 0)
    control, summary = unpack(ControlMemory, rows.control, 0), unpack(EstimateSummary, rows.summary, 0)
    stretch, cable = unpack(Stretch, rows.stretch, 0), unpack(Winch, rows.winch, 0).cable
    state, vehicle = summary.state, constants.vehicle
    cable_torque = ZERO  # N m, by the cable
    slack_events = control.slack_events
    if control.was_taut and not summary.taut and not stretch.released:
        slack_events += 1
    factor = learned_factor(
        control.thrust_factor,
        control.thrust,
        vehicle,
        constants.limited,
        rows.table,
        rows.rotors,
        constants.factor_share,
    )
    estimator = unpack(EstimatorState, rows.estimator, 0)
    extra_mass = learned_extra_mass(estimator, constants)
    before, observed_vehicle = control.observed, with_cable_length(vehicle, cable.length)
    if not summary.taut:
        observed_vehicle = with_field(observed_vehicle, "quad_mass", vehicle.quad_mass + extra_mass)
    elif not control.was_taut and extra_mass != 0.0:
        before = with_extra_load(before, extra_mass, vehicle)
    observed = observe(
        before,
        state,
        1.0 if summary.taut else 0.0,
        control.thrust,
        control.moment,
        slowed_by_noise(constants.observer, control.observed, measured_accel_noise(estimator.vibration)),
        constants.drag,
        observed_vehicle,
        estimator.frame_share,
    )
    air = estimator.air
    load_accel = axpy(air.load_drag, state.v_load, (air.load_accel[0], air.load_accel[1], 0.0))
    observed = with_wind_on_load(
        observed, (load_accel[0], load_accel[1], 0.0), air.load_drag, constants.observer
    )
    actuation = Actuation(rows.commands, control.thrust, control.moment)
    if stretch.mode == UNCONTROLLED:
        command = NO_COMMAND
        mixed = equal_forces(IDLE_FORCE_N if stretch.idle else 0.0, rows.table, rows.rotors)
        reset = nominal_on_ground(vehicle)
        reset = with_field(reset, "ground_force", observed.ground_force)
        reset = with_field(reset, "vehicle_ground_height", observed.vehicle_ground_height)
        reset = with_field(reset, "stands", observed.stands)
        observed = with_field(reset, "load_ground_height", observed.load_ground_height)
    else:
        if constants.yaw_free:
            forward = column(state.R, 0)
            level = (forward[0], forward[1], 0.0)
            stretch = with_field(
                stretch, "heading", HeadingReference(scale(1.0 / norm(level), level), ZERO, ZERO)
            )
        law = constants_of(law_rows)
        jet = _jet(rows.references, row_at(stretch, now_us))
        if stretch.mode == control.control_mode:
            memory = memory_of(law_rows)
        else:
            memory = kernels_of(law).start(law, state, jet[0], jet[1])
        known = observed if summary.taut else with_extra_weight(observed, extra_mass, vehicle)
        with_reel = with_reel_force(known, state, cable.accel, vehicle.quad_mass)
        memory, command = run_law(law, memory, state, jet, stretch, actuation, with_reel, cable, vehicle)
        pack(memory, law_rows.memory, 0)
        moment = command.moment
        if off_centre(vehicle) and summary.taut:
            cable_torque = cable_moment(state, control.thrust, observed.load_mass, cable.length, vehicle)
            moment = sub(moment, cable_torque)
        mixed = mix_with_factor(
            applied_factor(factor),
            command.thrust,
            moment,
            vehicle,
            constants.limited,
            rows.table,
            rows.rotors,
        )
    equalise_lags(rows.rotors, rows.table, vehicle, constants.limited)
    update_expected_forces(rows, constants.rotor_watch)
    # rotors and cable together turn the vehicle
    achieved_moment = (
        add(mixed.achieved_moment, cable_torque) if off_centre(vehicle) else mixed.achieved_moment
    )
    actuation = actuate(actuation, mixed.achieved_thrust, achieved_moment, constants.actuation)
    control = ControlMemory(
        command,
        mixed,
        factor,
        actuation.thrust,
        actuation.moment,
        observed,
        stretch.mode,
        slack_events,
        summary.taut,
    )
    pack(control, rows.control, 0)


def compiled_law(rows: CoreRows, law_rows: Any) -> Any:
    """A law's rows as `fly_tick` takes them: with its machine code, compiled or loaded if necessary. Where
    nothing is compiled, the rows themselves."""
    if not hasattr(control_tick, "overloads"):
        return law_rows
    law = type(law_rows)
    if law not in _control_addresses:
        _control_addresses[law] = kernel_address_of(control_tick, rows, law_rows, 0)
    return CompiledLaw(law_rows.constants, law_rows.memory, _control_addresses[law])


def placeholder_law(law_rows: Any) -> Any:
    """The same for no particular law, to compile `fly_tick` for; it cannot be flown."""
    if not hasattr(control_tick, "overloads"):
        return law_rows
    return CompiledLaw(law_rows.constants, law_rows.memory, 0)


def call_control(rows: CoreRows, law_rows: Any, now_us: int) -> None:
    """`control_tick` of the law with these rows."""
    control_tick(rows, law_rows, now_us)


@overload(call_control, jit_options=INNER_OPTIONS)
def _control_by(rows: Any, law_rows: Any, now_us: Any) -> Any:
    def called(rows: Any, law_rows: Any, now_us: Any) -> None:
        call_kernel_at(law_rows.control, (rows, law_rows.constants, law_rows.memory, now_us))

    def linked(rows: Any, law_rows: Any, now_us: Any) -> None:
        control_tick(rows, law_rows, now_us)

    return called if getattr(law_rows, "instance_class", None) is CompiledLaw else linked


@kernel
def _must_decide(rows: CoreRows, now_us: int) -> bool:
    stretch, summary = unpack(Stretch, rows.stretch, 0), unpack(EstimateSummary, rows.summary, 0)
    if summary.rotors_lost != stretch.rotors_lost:
        return True
    at = row_at(stretch, now_us)
    target = ZERO
    if stretch.mode != UNCONTROLLED and 0 <= at < row_count(rows.targets):
        target = vector_at(rows.targets, at, 0)
    known = summary.vehicle_problem == 0 and (not stretch.load_required or summary.load_problem == 0)
    return may_need_decision(
        stretch,
        now_us,
        summary.state,
        known,
        summary.taut,
        summary.load_tracked,
        summary.tilt_rad,
        summary.pull_n,
        target,
    )


@kernel
def run_custom_estimator(constants: CoreConstants, count: int, now_us: int, dt: float) -> None:
    """Let a custom estimator, if there is one, write its estimate into `EstimateSummary`."""
    if constants.estimator != 0:
        slot = numbers_at(constants.slot_address, 3)
        slot[0], slot[1], slot[2] = count, now_us, dt
        call_at(constants.estimator, constants.slot_address)


@kernel
def fly_tick(
    rows: CoreRows, law_rows: Any, count: int, now_us: int, tick: int, dt: float, decided: bool
) -> int:
    """One tick, `dt` seconds after the last: ESTIMATED, FLOWN, or TO_DECIDE before the law is run.

    `decided`: run the rest of a tick for which TO_DECIDE was returned.
    """
    if not decided:
        update_estimate(rows, count, now_us, dt)
        constants = unpack(CoreConstants, rows.constants, 0)
        run_custom_estimator(constants, count, now_us, dt)
        if tick % constants.control_every != 0:
            return ESTIMATED
        if _must_decide(rows, now_us):
            return TO_DECIDE
    call_control(rows, law_rows, now_us)
    return FLOWN
