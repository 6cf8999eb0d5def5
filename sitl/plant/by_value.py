"""The plant with the forces of its rotors as part of its state: state in, state out, for the tests."""

from __future__ import annotations

from collections import namedtuple
from typing import Any, TypeAlias

from autopilot.geometry.linear import Vec3
from autopilot.vehicle.layout import PLUS, Layout
from sitl.plant import step
from sitl.plant.records import PlantState, Truth
from sitl.plant.rotors import COMMAND, FORCE, RotorRows, rotor_table, rotors_at_rest

Forces = tuple[float, ...]
StateWithRotors: TypeAlias = Any  # the fields of a PlantState, and `rotor_force` (N), one per rotor
_record: Any = namedtuple
_FLOWN = _record("_FLOWN", [*PlantState._fields, "rotor_force"])


def initial_state(truth: Truth, rotors: int = 4) -> StateWithRotors:
    """The state at rest on the ground."""
    return _FLOWN(*step.initial_state(truth), rotor_force=(0.0,) * rotors)


def rotors_of(force: Forces, command: Forces, layout: Layout = PLUS) -> RotorRows:
    """Rotors with these forces and commands, N."""
    rows = rotors_at_rest()
    rows[FORCE, : len(force)] = force
    rows[COMMAND, : len(command)] = command
    return RotorRows(rotor_table(layout), rows)


def advance(state: Any, truth: Truth, command: Forces, wind: Vec3, h: float, layout: Layout = PLUS) -> Any:
    """The state h seconds later, see `sitl.plant.step.advance`."""
    return advance_many(state, truth, command, wind, h, 1, layout)


def advance_many(
    state: Any, truth: Truth, command: Forces, wind: Vec3, h: float, n: int, layout: Layout = PLUS
) -> Any:
    """n steps of h seconds under the same commands and wind."""
    rotors = rotors_of(state.rotor_force, command, layout)
    after = step.advance_many(PlantState(*state[:-1]), truth, rotors, wind, h, n)
    return _FLOWN(*after, rotor_force=tuple(rotors.rows[FORCE, : len(layout)].tolist()))
