"""The control half of a tick in machine code: observer, law and mixer, as `flight_core.control` runs them.

`law_load_position` and `law_quad_position` are the laws' methods; which law it is, the compiler sees by the
type of its record. A law that is not among them flies through `flight_core.control` tick by tick.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import overload

from autopilot.control import lqr, quad_position
from autopilot.control import thesis_cascade as thesis
from autopilot.control.actuators.disturbance_observer import Observed, ObserverConstants, observe
from autopilot.control.actuators.mixer import MixerResult, mix
from autopilot.control.actuators.rotor_model import Actuation, ActuationConstants
from autopilot.control.actuators.rotor_model import advance as actuate
from autopilot.control.laws.interface import Law, LqrLaw, Memory, PlumblineLaw, PlumblineMemory, ThesisLaw
from autopilot.control.laws.plumbline import SlackConstants, load_position_tick, quad_position_tick
from autopilot.control.load_motion import Drag
from autopilot.control.records import Command, Reference, State, Vehicle
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO

FUSED_LAWS = (ThesisLaw, LqrLaw, PlumblineLaw)


class PilotModel(NamedTuple):
    """What is constant over a flight."""

    law: Any
    vehicle: Vehicle
    limited: float
    actuation: ActuationConstants
    observer: ObserverConstants
    drag: Drag
    nominal: Observed  # nothing observed yet


class Pilot(NamedTuple):
    """What the control half carries from tick to tick, of `flight_core.FlightState`."""

    memory: Any
    command: Command
    mixed: MixerResult
    actuation: Actuation
    observed: Observed


def law_load_position(
    law: Law, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
) -> tuple[Memory, Command]:
    """`law.load_position`."""
    return law.load_position(memory, state, reference, actuation, observed)


def law_quad_position(
    law: Law, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
) -> tuple[Memory, Command]:
    """`law.quad_position`."""
    return law.quad_position(memory, state, reference, actuation, observed)


@kernel
def thesis_quad_position(
    law: ThesisLaw, memory: Any, state: State, reference: Reference
) -> tuple[Any, Command]:
    """`ThesisLaw.quad_position`."""
    return quad_position.quad_position(
        memory, state, reference, 0.0, ZERO, law.position_gains, law.gains, law.filters, law.vehicle
    )


def _is(law: Any, kind: type) -> bool:
    return getattr(law, "instance_class", None) is kind


@overload(law_load_position)
def _load_position(law: Any, memory: Any, state: Any, reference: Any, actuation: Any, observed: Any) -> Any:
    if _is(law, ThesisLaw):

        def of_thesis(
            law: Any, memory: Any, state: Any, reference: Any, actuation: Any, observed: Any
        ) -> Any:
            return thesis.load_position(memory, state, reference, law.gains, law.filters, law.vehicle)

        return of_thesis
    if _is(law, LqrLaw):

        def of_lqr(law: Any, memory: Any, state: Any, reference: Any, actuation: Any, observed: Any) -> Any:
            return memory, lqr.load_position(state, reference, law.regulator)

        return of_lqr
    if _is(law, PlumblineLaw):

        def of_plumbline(
            law: Any, memory: Any, state: Any, reference: Any, actuation: Any, observed: Any
        ) -> Any:
            position, command = load_position_tick(
                memory.position, state, reference, actuation, observed, law.constants
            )
            return PlumblineMemory(position, memory.other_modes), command

        return of_plumbline
    return None


@overload(law_quad_position)
def _quad_position(law: Any, memory: Any, state: Any, reference: Any, actuation: Any, observed: Any) -> Any:
    if _is(law, ThesisLaw):

        def of_thesis(
            law: Any, memory: Any, state: Any, reference: Any, actuation: Any, observed: Any
        ) -> Any:
            return thesis_quad_position(law, memory, state, reference)

        return of_thesis
    if _is(law, LqrLaw):

        def of_lqr(law: Any, memory: Any, state: Any, reference: Any, actuation: Any, observed: Any) -> Any:
            return thesis_quad_position(law.other_modes, memory, state, reference)

        return of_lqr
    if _is(law, PlumblineLaw):

        def of_plumbline(
            law: Any, memory: Any, state: Any, reference: Any, actuation: Any, observed: Any
        ) -> Any:
            others = law.other_modes
            slack = SlackConstants(others.position_gains, others.gains, others.filters)
            other, command = quad_position_tick(
                memory.other_modes, state, reference, actuation, observed, law.constants, slack
            )
            return PlumblineMemory(memory.position, other), command

        return of_plumbline
    return None


@kernel
def look(pilot: Pilot, state: State, taut: float, model: PilotModel) -> Observed:
    """What is observed at this tick."""
    return observe(
        pilot.observed, state, taut, pilot.actuation.thrust, model.observer, model.drag, model.vehicle
    )


@kernel
def ground_tick(pilot: Pilot, state: State, taut: float, model: PilotModel) -> Pilot:
    """One tick on the ground: the rotors go on as they are; of what is observed only the ground is kept."""
    seen, mixed, n = look(pilot, state, taut, model), pilot.mixed, model.nominal
    return Pilot(
        pilot.memory,
        pilot.command,
        mixed,
        actuate(pilot.actuation, mixed.thrust_done, mixed.moment_done, model.actuation),
        Observed(n.load_mass, n.push, n.correlation, n.square, seen.support, seen.load_ground),
    )


@kernel
def air_tick(
    pilot: Pilot, state: State, taut: float, reference: Reference, carries: bool, model: PilotModel
) -> Pilot:
    """One tick of law and mixer; `carries`: the load's position is tracked, else the vehicle's."""
    seen = look(pilot, state, taut, model)
    if carries:
        memory, command = law_load_position(model.law, pilot.memory, state, reference, pilot.actuation, seen)
    else:
        memory, command = law_quad_position(model.law, pilot.memory, state, reference, pilot.actuation, seen)
    mixed = mix(command.thrust, command.moment, model.vehicle, model.limited)
    actuation = actuate(pilot.actuation, mixed.thrust_done, mixed.moment_done, model.actuation)
    return Pilot(memory, command, mixed, actuation, seen)
