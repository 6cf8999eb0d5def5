"""The rotor forces of a ROTOR_STATE, in a module that does not need numba."""

from __future__ import annotations

from typing import Any


def rotor_forces(m: Any) -> tuple[float, ...]:
    """The forces of a ROTOR_STATE, N, one for each rotor of the vehicle."""
    forces: tuple[float, ...] = (*m.force, *m.more_force)
    return forces[: m.rotors or 4]
