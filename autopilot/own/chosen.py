"""What of a flight's software somebody has brought, by reference, and the parameters that come along."""

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
    """An OwnError meanwhile says by which option of the command line its cause was brought."""
    try:
        yield
    except OwnError as error:
        raise OwnError(f"--{option} {error}") from None


class Own(NamedTuple):
    """References, as `autopilot.own.source` reads them; empty where what is built in flies."""

    law: str = ""
    estimator: str = ""
    planner: str = ""

    def loaded(self) -> tuple[Brought, ...]:
        """The classes. OwnError if one cannot be."""
        loaded: list[Brought] = []
        ways = zip(self._fields, self, (load_law, load_estimator, load_planner), strict=True)
        for option, reference, load in ways:
            if reference:
                with of_option(option):
                    loaded.append(load(reference))
        return tuple(loaded)

    @property
    def digests(self) -> tuple[str, ...]:
        """Hashes of their sources."""
        return tuple(one.digest for one in self.loaded())


NOTHING_OWN = Own()


@dataclass(frozen=True)
class OwnSetup:
    """What a class that somebody has brought is made from; plain data, for other processes."""

    reference: str
    values: Mapping[str, float]  # of all parameters


def parameters_for(belief: Vehicle, own: Own = NOTHING_OWN) -> AutopilotParameters:
    """The autopilot's parameters for a vehicle, with those of what somebody has brought. OwnError if that, or
    a parameter of it, cannot be."""
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
