"""The control laws, one file each: whatever file of this folder has a `LAW` is found."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from autopilot.control.believed import believed_vehicle
from autopilot.control.laws.interface import Law, register
from autopilot.wire.parameter_table import ParameterTable


def _found() -> dict[int, Law]:
    modules = (import_module(f"{__name__}.{entry.name}") for entry in iter_modules(__path__))
    laws = [register(module.LAW) for module in modules if hasattr(module, "LAW")]
    found = {law.number: law for law in sorted(laws, key=lambda law: law.number)}
    if len(found) < len(laws):
        numbers = ", ".join(f"{law.name} {law.number}" for law in laws)
        raise ValueError(f"two laws have the same number of CTL_LAW: {numbers}")
    return found


LAWS = _found()  # by the number of CTL_LAW


def chosen_law(table: ParameterTable) -> Law:
    """The law that CTL_LAW selects."""
    return LAWS[int(table["CTL_LAW"])]


def build_law(table: ParameterTable) -> Any:
    """Constants of the law that CTL_LAW selects, for the vehicle that the parameters describe."""
    return chosen_law(table).build(table, believed_vehicle(table))
