"""The control laws, one file each: every file of this folder that defines a `LAW` is found."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from autopilot.control.believed import believed_vehicle
from autopilot.control.law_exchange import Link
from autopilot.control.laws.interface import Law, register
from autopilot.control.laws.own import OWN
from autopilot.geometry.packed import field_offset, pack
from autopilot.vehicle.law_files import law_files
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.wire.parameter_table import ParameterTable


def _load_laws() -> dict[int, Law]:
    modules = (import_module(f"{__name__}.{entry.name}") for entry in iter_modules(__path__))
    laws = [register(module.LAW) for module in modules if hasattr(module, "LAW")]
    declared_names = {law.number: law.name for law in law_files()}
    found = {law.number: law for law in laws}
    if {number: law.name for number, law in found.items()} != declared_names:
        defined = ", ".join(f"{law.name} {law.number}" for law in laws)
        declared = ", ".join(f"{name} {number}" for number, name in declared_names.items())
        raise ValueError(
            f'laws are {defined}, their files say {declared}; write LAW = Law(name="...", number=...,'
        )
    return {number: found[number] for number in declared_names}


LAWS = _load_laws()  # by the number of CTL_LAW
register(OWN)


def chosen_law(table: ParameterTable) -> Law:
    """The law that CTL_LAW selects."""
    number = int(table["CTL_LAW"])
    return OWN if number == OWN.number else LAWS[number]


def build_law(table: AutopilotParameters) -> Any:
    """Constants of the law that CTL_LAW selects, for the vehicle that the parameters describe."""
    return chosen_law(table).build(table, believed_vehicle(table))


def is_own(constants: Any) -> bool:
    """Whether these are the constants of a custom law."""
    return isinstance(constants, OWN.constants)


def link_own(rows: Any, link: Link) -> None:
    """Let the rows of a custom law call its functions."""
    pack(link, rows.constants, field_offset(OWN.constants, "link"))
