"""The custom classes of a flight, by reference, and the parameters that they define."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from autopilot.own.brought import Brought
from autopilot.own.estimator import load_estimator
from autopilot.own.law import load_law
from autopilot.own.planner import load_planner
from autopilot.own.source import OwnError
from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.parameters import AutopilotParameters, autopilot_parameters
from autopilot.wire import parameter_table as table


@contextmanager
def of_option(option: str) -> Iterator[None]:
    """Make an OwnError in this context name the option of the command line that caused it."""
    try:
        yield
    except OwnError as error:
        raise OwnError(f"--{option} {error}") from None


class Own(NamedTuple):
    """References as in `autopilot.own.source`; empty if the built-in code is used."""

    law: str = ""
    estimator: str = ""
    planner: str = ""

    def loaded(self) -> tuple[Brought, ...]:
        """The loaded classes. OwnError if one cannot be loaded."""
        loaded: list[Brought] = []
        ways = zip(self._fields, self, (load_law, load_estimator, load_planner), strict=True)
        for option, reference, load in ways:
            if reference:
                with of_option(option):
                    loaded.append(load(reference))
        return tuple(loaded)

    @property
    def digests(self) -> tuple[str, ...]:
        """Hashes of the sources of the classes."""
        return tuple(one.digest for one in self.loaded())


NOTHING_OWN = Own()


@dataclass(frozen=True)
class OwnSetup:
    """What an instance of a custom class is made from; plain data, for other processes."""

    reference: str
    values: Mapping[str, float]  # of all parameters


def parameters_for(belief: Vehicle, own: Own = NOTHING_OWN) -> AutopilotParameters:
    """The autopilot's parameters for a vehicle, with those of the custom classes. OwnError if a class cannot
    be loaded, or a parameter of it is invalid."""
    brought: tuple[table.Parameter, ...] = ()
    found = autopilot_parameters(belief)
    for one in own.loaded():
        brought += one.parameters
        law = load_law(own.law).name if own.law else ""
        try:
            found = autopilot_parameters(belief, law, brought)
        except table.ParameterError as error:
            told = f"{one.reference}: {one.kind.__name__}.parameters: {error}"
            raise OwnError(f"--{one.what.lower()} {told}") from None
    return found
