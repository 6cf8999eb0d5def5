"""A control law that somebody has brought, as the rest of the autopilot knows it.

It is a class with at least one of the four modes as a method:

    class MyLaw:
        parameters = {"MY_KX": Parameter(6.0, 0.0, 50.0, "N/m", "Gain of the position error")}

        def __init__(self, parameters): ...          # all parameters of the autopilot by name
        def start(self, now): ...                    # memory of a mode that begins; without it None
        def load_position(self, memory, now): ...    # (memory, what is asked for)

`now` is `autopilot.control.law_desk.Now`; what is asked for is made by `wrench`, `force`, `attitude` or
`rates` of `autopilot.own.asking`. A law whose class is a NamedTuple of numbers, and whose methods are
compiled by `kernel`, is called as machine code.
"""

from __future__ import annotations

from dataclasses import dataclass

from autopilot.own.brought import Brought, named
from autopilot.own.source import OwnError, found_class
from autopilot.vehicle.parameters import LAWS, OWN_LAW
from missions.nearest import did_you_mean

GROUP = "plumbline.laws"  # of entry points
MODES = ("load_position", "quad_position", "load_attitude", "quad_attitude")


@dataclass(frozen=True)
class OwnLaw(Brought):
    """A law, loaded."""

    what = "Law"

    modes: tuple[str, ...]  # that it flies; the others are flown by `plumbline`


def load_law(reference: str) -> OwnLaw:
    """The law that a reference names, as `autopilot.own.source` reads it. OwnError if it cannot be one."""
    return law_of(found_class(reference, GROUP, _suits, "control law", LAWS), reference)


def law_of(kind: type, reference: str) -> OwnLaw:
    """The law of a class. OwnError if it is none."""
    modes = tuple(mode for mode in MODES if callable(getattr(kind, mode, None)))
    if not modes:
        told = f"{reference}: {kind.__name__}"
        hints = (did_you_mean(name, MODES) for name in dir(kind) if not name.startswith("_"))
        hint = next(filter(None, hints), "")
        raise OwnError(f"{told} has no method that flies; {hint}must have one of {', '.join(MODES)}")
    return OwnLaw(*named(kind, reference, LAWS), modes)


def law_number(law: str) -> int:
    """CTL_LAW of a law: of a shipped one by its name, else of the one that was brought."""
    return LAWS.index(law) if law in LAWS else OWN_LAW


def own_law(law: str) -> str:
    """The reference of a law that somebody has brought; empty for a shipped one."""
    return "" if law in LAWS else law


def name_of(law: str) -> str:
    """A law's name in tables and reports. OwnError if there is no such law."""
    return law if law in LAWS else load_law(law).name


def _suits(kind: type) -> bool:
    return any(callable(getattr(kind, mode, None)) for mode in MODES)
