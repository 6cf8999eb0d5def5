"""Packages of a user that have the names of Plumbline's; imports only what no package of a user can hide."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

_NAMES = ("autopilot", "gcs", "missions", "sitl")


def shadowing_problem() -> str:
    """Which package of Plumbline is hidden by another of the same name, and what to do; empty if none is."""
    root = Path(__file__).resolve().parents[1]
    for name in _NAMES:
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            continue
        file = Path(spec.origin).resolve()
        found = file.parent if file.name == "__init__.py" else file
        if found.parent != root:
            return (
                f"{found} hides the package {name} of Plumbline, which is in {root}; rename it, or start "
                "Python in another folder or with -P, so that it does not search the current folder"
            )
    return ""
