"""The forces of the rotors that a ROTOR_STATE tells, apart from what needs numba."""

from __future__ import annotations

from typing import Any


def rotor_forces(m: Any) -> tuple[float, ...]:
    """The forces of a ROTOR_STATE, N, one of each rotor that there is."""
    forces: tuple[float, ...] = (*m.force, *m.more_force)
    return forces[: m.rotors or 4]
