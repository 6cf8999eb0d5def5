"""A custom control law as the rest of the autopilot sees it.

It is a class with at least one of the four modes as a method:

    class MyLaw:
        parameters = {"MY_KX": Parameter(6.0, 0.0, 50.0, "N/m", "Gain of the position error")}

        def __init__(self, parameters): ...          # all parameters of the autopilot by name
        def start(self, now): ...                    # memory of a mode that begins; without it None
        def load_position(self, memory, now): ...    # (memory, command)

`now` is `autopilot.control.law_exchange.Now`; the command is made by `wrench`, `force`, `attitude` or `rates`
of `autopilot.own.law_commands`. A law whose class is a NamedTuple of numbers, and whose methods are compiled
by `kernel`, is called as machine code.
"""

from __future__ import annotations

from dataclasses import dataclass

from autopilot.own.loaded_class import LoadedClass, checked_fields
from autopilot.own.source import OwnError, find_class
from autopilot.vehicle.parameters import LAWS, OWN_LAW
from missions.nearest import did_you_mean

GROUP = "plumbline.laws"  # of entry points
MODES = ("load_position", "quad_position", "load_attitude", "quad_attitude")


@dataclass(frozen=True)
class OwnLaw(LoadedClass):
    """A loaded law."""

    role = "Law"

    modes: tuple[str, ...]  # that it flies; the law `plumbline` flies the others


def load_law(reference: str) -> OwnLaw:
    """The law that a reference, as in `autopilot.own.source`, names. OwnError if it is none."""
    return law_from_class(find_class(reference, GROUP, _is_law, "control law", LAWS), reference)


def law_from_class(kind: type, reference: str) -> OwnLaw:
    """The law of a class. OwnError if the class is none."""
    modes = tuple(mode for mode in MODES if callable(getattr(kind, mode, None)))
    if not modes:
        label = f"{reference}: {kind.__name__}"
        hints = (did_you_mean(name, MODES) for name in dir(kind) if not name.startswith("_"))
        hint = next(filter(None, hints), "")
        raise OwnError(f"{label} has no method that flies; {hint}must have one of {', '.join(MODES)}")
    return OwnLaw(*checked_fields(kind, reference, LAWS), modes)


def law_number(law: str) -> int:
    """CTL_LAW of a law: that of a shipped law by its name, otherwise that of the custom law."""
    return LAWS.index(law) if law in LAWS else OWN_LAW


def own_law_reference(law: str) -> str:
    """The reference of a custom law; empty for a shipped law."""
    return "" if law in LAWS else law


def law_name(law: str) -> str:
    """A law's name in tables and reports. OwnError if there is no such law."""
    return law if law in LAWS else load_law(law).name


def _is_law(kind: type) -> bool:
    return any(callable(getattr(kind, mode, None)) for mode in MODES)
