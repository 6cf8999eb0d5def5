"""The control half of a tick in machine code: law and mixer, as `autopilot.flight_core.control` runs them.

`load_position` and `quad_position` are the laws' methods of those names; which law it is, the compiler sees by
the type of its record. A law that is not among them flies through `flight_core.control` tick by tick.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import overload

from autopilot.control import lqr, plumbline, quad_position, thesis
from autopilot.control.records import Command, Reference, State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.laws import Law, LqrLaw, Memory, PlumblineLaw, PlumblineMemory, ThesisLaw
from autopilot.mixer import MixerResult, mix
from autopilot.rotor_lag import hasten

FUSED_LAWS = (ThesisLaw, LqrLaw, PlumblineLaw)


class PilotModel(NamedTuple):
    """What is constant over a flight."""

    law: Any
    vehicle: Vehicle
    limited: float


class Pilot(NamedTuple):
    """What law and mixer carry from tick to tick, of `flight_core.FlightState`."""

    memory: Any
    command: Command
    mixed: MixerResult


def law_load_position(law: Law, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
    """`law.load_position`."""
    return law.load_position(memory, state, reference)


def law_quad_position(law: Law, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
    """`law.quad_position`."""
    return law.quad_position(memory, state, reference)


@kernel
def thesis_quad_position(
    law: ThesisLaw, memory: Any, state: State, reference: Reference
) -> tuple[Any, Command]:
    """`ThesisLaw.quad_position`."""
    return quad_position.quad_position(
        memory, state, reference, 0.0, law.position_gains, law.gains, law.filters, law.vehicle
    )


def _is(law: Any, kind: type) -> bool:
    return getattr(law, "instance_class", None) is kind


@overload(law_load_position)
def _compiled_load_position(law: Any, memory: Any, state: Any, reference: Any) -> Any:
    if _is(law, ThesisLaw):

        def of_thesis(law: Any, memory: Any, state: Any, reference: Any) -> Any:
            return thesis.load_position(memory, state, reference, law.gains, law.filters, law.vehicle)

        return of_thesis
    if _is(law, LqrLaw):

        def of_lqr(law: Any, memory: Any, state: Any, reference: Any) -> Any:
            return memory, lqr.load_position(state, reference, law.regulator)

        return of_lqr
    if _is(law, PlumblineLaw):

        def of_plumbline(law: Any, memory: Any, state: Any, reference: Any) -> Any:
            position, wanted = plumbline.load_position(
                memory.position,
                state,
                reference,
                memory.rotors.thrust,
                law.gains,
                law.force_filter,
                law.drag,
                law.vehicle,
            )
            rotors, thrust, moment = hasten(
                memory.rotors, wanted.thrust, wanted.moment, law.lag, law.vehicle, law.limited
            )
            return PlumblineMemory(position, memory.other_modes, rotors), with_demand(wanted, thrust, moment)

        return of_plumbline
    return None


@overload(law_quad_position)
def _compiled_quad_position(law: Any, memory: Any, state: Any, reference: Any) -> Any:
    if _is(law, ThesisLaw):

        def of_thesis(law: Any, memory: Any, state: Any, reference: Any) -> Any:
            return thesis_quad_position(law, memory, state, reference)

        return of_thesis
    if _is(law, LqrLaw):

        def of_lqr(law: Any, memory: Any, state: Any, reference: Any) -> Any:
            return thesis_quad_position(law.other_modes, memory, state, reference)

        return of_lqr
    if _is(law, PlumblineLaw):

        def of_plumbline(law: Any, memory: Any, state: Any, reference: Any) -> Any:
            other, command = thesis_quad_position(law.other_modes, memory.other_modes, state, reference)
            return PlumblineMemory(memory.position, other, memory.rotors), command

        return of_plumbline
    return None


@kernel
def with_demand(c: Command, thrust: float, moment: tuple[float, float, float]) -> Command:
    """The command with another demand on the rotors."""
    return Command(
        thrust, moment, c.e_x, c.e_v, c.e_q, c.e_q_dot, c.e_R, c.e_Omega, c.psi_R, c.psi_q, c.q_c, c.R_c
    )


@kernel
def pilot_tick(
    pilot: Pilot, state: State, reference: Reference, carries: bool, model: PilotModel
) -> Pilot:
    """One tick of law and mixer; `carries`: the load's position is tracked, else the vehicle's."""
    if carries:
        memory, command = law_load_position(model.law, pilot.memory, state, reference)
    else:
        memory, command = law_quad_position(model.law, pilot.memory, state, reference)
    return Pilot(memory, command, mix(command.thrust, command.moment, model.vehicle, model.limited))
