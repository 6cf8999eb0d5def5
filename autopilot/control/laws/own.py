"""The custom law: it calls a function at an address for its command (`autopilot.control.law_exchange`).

The law `plumbline` flies the modes that the custom law does not define, and all modes after a command of the
custom law was not valid. If the custom law commands a force or an attitude, the innermost loop of
`plumbline` flies it and takes delay and lag of the rotors into account. Body rates become a moment by the
gain k_Omega of `plumbline`, without prediction and lag compensation.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control.actuators.disturbance_observer import (
    DisturbanceEstimate,
    load_on_ground,
    vehicle_on_ground,
)
from autopilot.control.actuators.rotor_model import Actuation
from autopilot.control.law_exchange import (
    FORCE,
    RATES,
    UNLINKED,
    WRENCH,
    Asked,
    Believed,
    Held,
    Link,
    Now,
    call_law,
    is_valid,
)
from autopilot.control.laws import plumbline
from autopilot.control.laws.interface import Kernels, Law
from autopilot.control.load_attitude import thrust_along
from autopilot.control.records import Cable, Command, Reference, State, Vehicle
from autopilot.control.thesis_cascade import attitude_towards, with_errors
from autopilot.geometry.addresses import call_at
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Mat3, Vec3, add, column, cross, sub, times
from autopilot.geometry.packed import Row
from autopilot.vehicle.law_files import law_files
from autopilot.wire.parameter_table import ParameterTable


class OwnLaw(NamedTuple):
    """The addresses of its functions, and the built-in law that replaces missing ones."""

    link: Link
    period: float  # s
    vehicle: Vehicle
    built_in: plumbline.PlumblineLaw


class OwnMemory(NamedTuple):
    """The memory of the built-in law, and the number of ticks that this mode has been flown; the custom law
    stores its own memory."""

    ticks: int
    built_in: plumbline.PlumblineMemory


class OwnRows(NamedTuple):
    """The law, packed."""

    constants: Row
    memory: Row


def build(table: ParameterTable, vehicle: Vehicle) -> OwnLaw:
    """The law without links; its functions are linked where it is flown."""
    return OwnLaw(UNLINKED, 1.0 / table["CTL_RATE_HZ"], vehicle, plumbline.build(table, vehicle))


@kernel
def start(law: OwnLaw, state: State, x_d: Vec3, v_d: Vec3) -> OwnMemory:
    """Memory of a mode that begins now."""
    return OwnMemory(0, plumbline.start(law.built_in, state, x_d, v_d))


@kernel
def _reference_at_rest(x: Vec3, b1_d: Vec3) -> Reference:
    """A reference at rest."""
    return Reference((x, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), b1_d, ZERO, ZERO)


@kernel
def _believed(law: OwnLaw, state: State, actuation: Actuation, observed: DisturbanceEstimate) -> Believed:
    vehicle = law.vehicle
    return Believed(
        vehicle.quad_mass,
        observed.load_mass,
        vehicle.inertia,
        vehicle.gravity,
        observed.push,
        actuation.thrust,
        actuation.moment,
        load_on_ground(observed, state),
        vehicle_on_ground(observed),
    )


@kernel
def _law_command(law: OwnLaw, function: int, now: Now) -> Asked:
    """The command of the function; if it is not valid, the alarm is raised."""
    law_command = call_law(function, law.link.row, now)
    if not is_valid(law_command):
        call_at(law.link.alarm, law.link.row)
    return law_command


@kernel
def _rotor_command(
    law: OwnLaw,
    memory: OwnMemory,
    now: Now,
    law_command: Asked,
    actuation: Actuation,
    observed: DisturbanceEstimate,
) -> tuple[OwnMemory, Command]:
    """The rotor command that carries out what the custom law commands."""
    state, built_in = now.state, memory.built_in
    thrust, moment = law_command.thrust, law_command.vector
    if law_command.kind in (WRENCH, RATES):
        if law_command.kind == RATES:
            inertia, gains = law.vehicle.inertia, law.built_in.other_modes.gains
            rate_feedback = times(gains.k_Omega, sub(law_command.vector, state.omega_body))
            moment = add(rate_feedback, cross(state.omega_body, times(inertia, state.omega_body)))
        command = Command(
            thrust, moment, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0.0, 0.0, state.q_cable, state.R
        )
    else:
        R_d = law_command.attitude
        if law_command.kind == FORCE:
            R_d = attitude_towards(law_command.vector, now.reference.b1_d, state.R)
            thrust = thrust_along(law_command.vector, state.R)
        built_in, command = plumbline.quad_attitude(
            law.built_in, built_in, state, R_d, thrust, actuation, observed, now.cable
        )
    return OwnMemory(memory.ticks + 1, built_in), command


@kernel
def _run_function(
    law: OwnLaw,
    function: int,
    memory: OwnMemory,
    state: State,
    reference: Reference,
    held: Held,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[bool, OwnMemory, Command]:
    """Whether the function's command is sound, and the memory and rotor command that follow from it."""
    now = Now(
        memory.ticks == 0,
        memory.ticks * law.period,
        law.period,
        state,
        reference,
        held,
        cable,
        _believed(law, state, actuation, observed),
    )
    law_command = _law_command(law, function, now)
    memory_after, command = _rotor_command(law, memory, now, law_command, actuation, observed)
    return is_valid(law_command), memory_after, command


@kernel
def load_position(
    law: OwnLaw,
    memory: OwnMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[OwnMemory, Command]:
    """The load follows a reference."""
    function, x_d, v_d = law.link.load_position, reference.jet[0], reference.jet[1]
    if function != 0:
        held = Held(state.q_cable, 0.0, state.R, 0.0)
        valid, memory_after, command = _run_function(
            law, function, memory, state, reference, held, actuation, observed, cable
        )
        if valid:
            e_x, e_v = sub(state.x_load, x_d), sub(state.v_load, v_d)
            return memory_after, with_errors(command, e_x, e_v, ZERO, ZERO, 0.0, state.q_cable)
        memory = start(law, state, x_d, v_d)
    built_in, command = plumbline.load_position(
        law.built_in, memory.built_in, state, reference, actuation, observed, cable
    )
    return OwnMemory(memory.ticks + 1, built_in), command


@kernel
def quad_position(
    law: OwnLaw,
    memory: OwnMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[OwnMemory, Command]:
    """The vehicle follows a reference, without a load."""
    function, x_d, v_d = law.link.quad_position, reference.jet[0], reference.jet[1]
    if function != 0:
        held = Held(state.q_cable, 0.0, state.R, 0.0)
        valid, memory_after, command = _run_function(
            law, function, memory, state, reference, held, actuation, observed, cable
        )
        if valid:
            e_x, e_v = sub(state.x_quad, x_d), sub(state.v_quad, v_d)
            return memory_after, with_errors(command, e_x, e_v, ZERO, ZERO, 0.0, state.q_cable)
        memory = start(law, state, x_d, v_d)
    built_in, command = plumbline.quad_position(
        law.built_in, memory.built_in, state, reference, actuation, observed, cable
    )
    return OwnMemory(memory.ticks + 1, built_in), command


@kernel
def load_attitude(
    law: OwnLaw,
    memory: OwnMemory,
    state: State,
    q_d: Vec3,
    b1_d: Vec3,
    pull: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[OwnMemory, Command]:
    """The cable's direction follows q_d under a given pull (N)."""
    function = law.link.load_attitude
    if function != 0:
        held = Held(q_d, pull, state.R, 0.0)
        valid, memory_after, command = _run_function(
            law,
            function,
            memory,
            state,
            _reference_at_rest(state.x_load, b1_d),
            held,
            actuation,
            observed,
            cable,
        )
        if valid:
            return memory_after, command
        memory = start(law, state, state.x_load, ZERO)
    built_in, command = plumbline.load_attitude(
        law.built_in, memory.built_in, state, q_d, b1_d, pull, actuation, observed, cable
    )
    return OwnMemory(memory.ticks + 1, built_in), command


@kernel
def quad_attitude(
    law: OwnLaw,
    memory: OwnMemory,
    state: State,
    R_d: Mat3,
    thrust: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[OwnMemory, Command]:
    """The vehicle's attitude follows R_d under a given thrust (N)."""
    function = law.link.quad_attitude
    if function != 0:
        held, reference = (
            Held(state.q_cable, 0.0, R_d, thrust),
            _reference_at_rest(state.x_quad, column(R_d, 0)),
        )
        valid, memory_after, command = _run_function(
            law, function, memory, state, reference, held, actuation, observed, cable
        )
        if valid:
            return memory_after, command
        memory = start(law, state, state.x_load, ZERO)
    built_in, command = plumbline.quad_attitude(
        law.built_in, memory.built_in, state, R_d, thrust, actuation, observed, cable
    )
    return OwnMemory(memory.ticks + 1, built_in), command


OWN = Law(
    name="own",
    number=len(law_files()),  # after the built-in laws: the value of CTL_LAW if a custom law is flown
    constants=OwnLaw,
    memory=OwnMemory,
    rows=OwnRows,
    build=build,
    kernels=Kernels(start, load_position, quad_position, load_attitude, quad_attitude),
)
