"""What the thesis leaves open in its cascade, and which choice gives its printed figures.

The command filters (4-2) give the derivatives of x_d, q_c and R_c. The thesis does not say whether the errors
are computed from the commands themselves (raw) or from the filtered ones, x_1, nor how long the step of Case
A lasts. Here all eight choices are flown, from rest in the air, with an exactly known state and the gains of
Table 4-3:

* x: e_x from the raw or the filtered x_d; velocity and acceleration are those of the filter.
* q: e_q from the raw or the filtered q_c; q_c', q_c'' are those of the filtered vector, normalised.
* R raw: R_c of (3-27) as it is, Omega_c of (3-28), Omega_c' of (3-18) from the filtered elements' x_2, x_2'.
  R filtered: the rotation rebuilt from the filtered elements, Omega_c and Omega_c' its exact derivatives.

Case A, without limits or lag, from the beginning of the step; the thesis prints 0.61 s, 15 % and 1.26 s:

* rise to 90 %, overshoot and settling within 5 %; `*` if all three are met (0.08 s, 6 %, 0.25 s).

Case B, B extended and C, without limits or lag (thesis) and with those of the vehicle (bebop), at 250 Hz:

* largest load error, share of the time with a rotor command beyond its limits, or when the flight was lost.

The row marked `flies` is what autopilot/control/thesis_cascade.py does; the script flies that too and
compares.

    python benchmarks/thesis_assumptions.py [--step 0.79 ...] [--hz 250 1000]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import thesis_cascade as thesis
from autopilot.control.actuators.mixer import FORCE, mix, new_rotors
from autopilot.control.command_filter import filter_acceleration, filter_step
from autopilot.control.load_attitude import (
    DirectionCommand,
    load_attitude_force,
    normal_force_tracking,
    thrust_along,
)
from autopilot.control.load_position import computed_direction, load_position_force
from autopilot.control.quad_attitude import attitude_from_axes, attitude_from_rates, attitude_moment
from autopilot.control.records import Reference, State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3, add, column, from_columns, norm, sub
from autopilot.geometry.s2 import unit_derivatives
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.trajectory.signals import Jet, SignalTable, evaluate, signal_table
from autopilot.vehicle.layout import PLUS
from autopilot.vehicle.rotors import mixer_table
from gcs.analysis.step import Step, StepResponse, step_response
from missions.fileformat import load_mission
from missions.model import Signals, Term
from sitl.plant.records import PlantState, Truth
from sitl.plant.rotors import COMMAND, RotorRows, rotor_table, rotors_at_rest
from sitl.plant.rotors import FORCE as ROTOR_FORCE
from sitl.plant.step import advance, initial_state
from sitl.vehicles.truth import load_truth

PRINTED = (0.61, 15.0, 1.26)  # s, %, s: 4-4
TOLERANCE = (0.08, 6.0, 0.25)
STEPS_S = (0.75, 0.78, 0.79, 0.80)
RATES_HZ = (250.0, 1000.0)
CASES = ("case-b", "case-b-extended", "case-c")
HEIGHT_M, DURATION_S = 0.25, 7.0  # of Case A
ALTITUDE_M = 3.0
# a flight is lost when the load is this far from its path, or the cosine of the tilt is below this
LOST_M, LOST_COSINE = 5.0, -0.5
TIME, LOAD, ERROR, TILT, SATURATED = 0, slice(1, 4), 4, 5, 6
COLUMNS = 7
HEADING = (1.0, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)


class ErrorSources(NamedTuple):
    """1.0: the error is taken from the raw command, 0.0: from the filtered one."""

    x: float
    q: float
    R: float


AS_IMPLEMENTED = ErrorSources(x=0.0, q=0.0, R=1.0)
THESIS_CASCADE = ErrorSources(x=-1.0, q=-1.0, R=-1.0)  # not composed here: thesis.load_position itself


class Flight(NamedTuple):
    """A row for each tick (time, load position, its error, cosine of the tilt, saturation), and its end."""

    rows: NDArray[np.float64]
    completed: bool


@kernel
def cascade(
    memory: thesis.ThesisMemory,
    state: State,
    x_raw: Vec3,
    sources: ErrorSources,
    gains: thesis.ThesisGains,
    filters: thesis.ThesisFilters,
    vehicle: Vehicle,
) -> tuple[thesis.ThesisMemory, float, Vec3]:
    """The load position mode, composed of the functions that fly, with a choice of the commands from which
    the errors are computed."""
    x = filter_step(memory.reference, x_raw, filters.reference)
    position = load_position_force(
        state.x_load,
        state.v_load,
        state.q_cable,
        state.q_cable_dot,
        x_raw if sources.x > 0.0 else x.x1,
        x.x2,
        filter_acceleration(x, filters.reference),
        gains.k_x,
        gains.k_v,
        vehicle.quad_mass,
        vehicle.load_mass,
        vehicle.cable_length,
        vehicle.gravity,
    )
    q_raw = computed_direction(position.A)
    q = filter_step(memory.direction, q_raw, filters.direction)
    q_c, q_c_dot, q_c_ddot = unit_derivatives(q.x1, q.x2, filter_acceleration(q, filters.direction))
    direction = load_attitude_force(
        state.q_cable,
        state.q_cable_dot,
        DirectionCommand(q_raw if sources.q > 0.0 else q_c, q_c_dot, q_c_ddot),
        normal_force_tracking(state.q_cable, position.A),
        gains.k_q,
        gains.k_omega,
        vehicle.quad_mass,
        vehicle.cable_length,
    )
    R_raw = thesis.attitude_towards(direction.F, HEADING, state.R)
    b1 = filter_step(memory.b1, column(R_raw, 0), filters.attitude)
    b2 = filter_step(memory.b2, column(R_raw, 1), filters.attitude)
    b3 = filter_step(memory.b3, column(R_raw, 2), filters.attitude)
    b1_ddot = filter_acceleration(b1, filters.attitude)
    b2_ddot = filter_acceleration(b2, filters.attitude)
    b3_ddot = filter_acceleration(b3, filters.attitude)
    attitude = attitude_from_axes(b3.x1, b3.x2, b3_ddot, b1.x1, b1.x2, b1_ddot)
    if sources.R > 0.0:
        R_dot = from_columns(b1.x2, b2.x2, b3.x2)
        attitude = attitude_from_rates(R_raw, R_dot, from_columns(b1_ddot, b2_ddot, b3_ddot))
    result = attitude_moment(
        state.R, state.omega_body, attitude, gains.k_R, gains.k_Omega, gains.epsilon, vehicle.inertia
    )
    return thesis.ThesisMemory(x, q, b1, b2, b3), thrust_along(direction.F, state.R), result.moment


@kernel
def state_of(plant: PlantState, R: Mat3) -> State:
    """The state given to the laws: the true one."""
    return State(
        plant.x_load,
        plant.v_load,
        plant.q_cable,
        plant.q_cable_dot,
        plant.x_quad,
        plant.v_quad,
        R,
        plant.omega_body,
    )


@kernel
def run(
    plant: PlantState,
    truth: Truth,
    table: SignalTable,
    sources: ErrorSources,
    gains: thesis.ThesisGains,
    filters: thesis.ThesisFilters,
    vehicle: Vehicle,
    limited: float,
    table_of_mixer: NDArray[np.float64],
    commanded: NDArray[np.float64],
    rotors: RotorRows,
    dt: float,
    out: NDArray[np.float64],
) -> int:
    """Flies the signals about the initial position of the load and fills a row of `out` at each tick; returns
    the number of rows before the flight was lost, or of all rows."""
    anchor = plant.x_load
    memory = thesis.start(state_of(plant, rotation_from_quat(plant.quat_wxyz)), anchor, ZERO)
    for k in range(out.shape[0]):
        jet: Jet = evaluate(table, k * dt)
        x_d = add(anchor, jet[0])
        R = rotation_from_quat(plant.quat_wxyz)
        state = state_of(plant, R)
        if sources.x < 0.0:
            reference = Reference((x_d, jet[1], jet[2], jet[3], jet[4], jet[5], jet[6]), HEADING)
            memory, command = thesis.load_position(memory, state, reference, gains, filters, vehicle)
            thrust, moment = command.thrust, command.moment
        else:
            memory, thrust, moment = cascade(memory, state, x_d, sources, gains, filters, vehicle)
        mixed = mix(thrust, moment, vehicle, limited, table_of_mixer, commanded)
        error = norm(sub(plant.x_load, x_d))
        out[k, 0] = k * dt
        out[k, 1], out[k, 2], out[k, 3] = plant.x_load
        out[k, 4] = error
        out[k, 5] = R[2][2]
        out[k, 6] = 1.0 if mixed.saturated != 0 else 0.0
        if not error < LOST_M or R[2][2] < LOST_COSINE or plant.diverged > 0.0:
            return k
        for i in range(4):
            rotors.rows[COMMAND, i] = commanded[FORCE, i]
        plant = advance(plant, truth, rotors, ZERO, dt)
    return len(out)


def suspended(truth: Truth) -> PlantState:
    """At rest in the air."""
    return initial_state(truth)._replace(
        x_load=(0.0, 0.0, ALTITUDE_M),
        x_quad=(0.0, 0.0, ALTITUDE_M + truth.cable_length),
        q_cable=(0.0, 0.0, -1.0),
        taut=1.0,
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
    )


def fly(truth: Truth, terms: Sequence[Term], duration_s: float, sources: ErrorSources, hz: float) -> Flight:
    """One flight of one choice."""
    vehicle = Vehicle(
        truth.quad_mass,
        truth.load_mass,
        truth.cable_length,
        truth.inertia,
        truth.gravity,
        truth.arm,
        truth.torque_ratio,
        truth.rotor_min,
        truth.rotor_max,
    )
    rows = np.zeros((round(duration_s * hz), COLUMNS))
    rotors = RotorRows(rotor_table(PLUS), rotors_at_rest())
    rotors.rows[ROTOR_FORCE, :4] = 0.25 * (truth.quad_mass + truth.load_mass) * truth.gravity
    count = run(
        suspended(truth),
        truth,
        signal_table(terms),
        sources,
        thesis.THESIS_GAINS,
        thesis.thesis_filters(1.0 / hz),
        vehicle,
        1.0 if np.isfinite(truth.rotor_max) else 0.0,
        mixer_table(PLUS),
        new_rotors(),
        rotors,
        1.0 / hz,
        rows,
    )
    return Flight(rows[: count + 1], count == len(rows))


def case_a(truth: Truth, sources: ErrorSources, step_s: float, hz: float) -> StepResponse | None:
    """The step response, or None if the flight was lost."""
    flight = fly(truth, [Term("y", HEIGHT_M, 0.0, step_s, None, 0.0)], DURATION_S, sources, hz)
    step = Step(0.0, HEIGHT_M, np.array([0.0, 0.0, ALTITUDE_M]), np.array([0.0, 1.0, 0.0]))
    return step_response(step, flight.rows[:, TIME], flight.rows[:, LOAD]) if flight.completed else None


def signals_of(case: str) -> Signals:
    """The signals of a shipped mission."""
    return next(step for step in load_mission(case).steps if isinstance(step, Signals))


def is_met(response: StepResponse) -> bool:
    """All three printed figures, each within its tolerance."""
    found = (response.rise_90_s, response.overshoot_pct, response.settling_5_s)
    return all(
        value is not None and abs(value - printed) <= tolerance
        for value, printed, tolerance in zip(found, PRINTED, TOLERANCE, strict=True)
    )


def step_cell(response: StepResponse | None) -> str:
    if response is None or response.rise_90_s is None or response.settling_5_s is None:
        return f"{'lost':>17s} "
    figures = f"{response.rise_90_s:.2f} {response.overshoot_pct:4.1f} % {response.settling_5_s:.2f}"
    return f"{figures:>17s}{'*' if is_met(response) else ' '}"


def case_cell(flight: Flight) -> str:
    if not flight.completed:
        return f"{f'lost, {flight.rows[-1, TIME]:.1f} s':>14s}"
    return f"{flight.rows[:, ERROR].max():7.3f} m {100.0 * flight.rows[:, SATURATED].mean():3.0f} %"


def label(sources: ErrorSources) -> str:
    words = " ".join("raw     " if value > 0.0 else "filtered" for value in sources)
    return f"{words} {'flies' if sources == AS_IMPLEMENTED else '     '}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--step", type=float, nargs="+", default=STEPS_S, metavar="S", help="durations")
    parser.add_argument("--hz", type=float, nargs="+", default=RATES_HZ, help="control rates, 100 ... 1000")
    arguments = parser.parse_args()
    unlimited, bebop = load_truth("thesis"), load_truth("bebop")
    choices = [ErrorSources(*values) for values in product((0.0, 1.0), repeat=3)]

    for hz in arguments.hz:
        print(f"\nCase A at {hz:.0f} Hz: rise s, overshoot, settling s, by duration of the step")
        print(f"{'x        q        R':33s}" + "".join(f"{step:16.2f} s " for step in arguments.step))
        for sources in choices:
            cells = (step_cell(case_a(unlimited, sources, step, hz)) for step in arguments.step)
            print(label(sources), "".join(cells))
    print("\nlargest load error, saturation; 250 Hz; without limits and lag, then with those of the bebop")
    print(f"{'x        q        R':33s}" + "".join(f"{case:>17s}" for case in CASES * 2))
    for sources in choices:
        flights = (
            fly(truth, signals.terms, signals.duration_s, sources, 250.0)
            for truth in (unlimited, bebop)
            for signals in map(signals_of, CASES)
        )
        print(label(sources), "".join(f"{case_cell(flight):>17s}" for flight in flights))
    signals = signals_of("case-c")
    composed, direct = (
        fly(bebop, signals.terms, signals.duration_s, sources, 250.0).rows
        for sources in (AS_IMPLEMENTED, THESIS_CASCADE)
    )
    print(f"\nthe law that flies, against its row, Case C: {np.abs(composed - direct).max():.1e} m")


if __name__ == "__main__":
    main()
