"""The custom classes of a flight, by reference, and the parameters that they define."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from autopilot.own.estimator import load_estimator
from autopilot.own.law import load_law
from autopilot.own.loaded_class import LoadedClass
from autopilot.own.planner import load_planner
from autopilot.own.source import OwnError
from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.parameters import AutopilotParameters, autopilot_parameters
from autopilot.wire import parameter_table as table


@contextmanager
def naming_option(option: str) -> Iterator[None]:
    """Make an OwnError in this context name the option of the command line that caused it."""
    try:
        yield
    except OwnError as error:
        raise OwnError(f"--{option} {error}") from None


class OwnCode(NamedTuple):
    """References as in `autopilot.own.source`; empty if the built-in code is used."""

    law: str = ""
    estimator: str = ""
    planner: str = ""

    def load_classes(self) -> tuple[LoadedClass, ...]:
        """The loaded classes. OwnError if one cannot be loaded."""
        classes: list[LoadedClass] = []
        loaders = zip(self._fields, self, (load_law, load_estimator, load_planner), strict=True)
        for option, reference, load in loaders:
            if reference:
                with naming_option(option):
                    classes.append(load(reference))
        return tuple(classes)

    @property
    def digests(self) -> tuple[str, ...]:
        """Hashes of the sources of the classes."""
        return tuple(one.digest for one in self.load_classes())


NO_OWN_CODE = OwnCode()


@dataclass(frozen=True)
class OwnSetup:
    """What an instance of a custom class is made from; plain data, for other processes."""

    reference: str
    values: Mapping[str, float]  # of all parameters


def parameters_for(belief: Vehicle, own: OwnCode = NO_OWN_CODE) -> AutopilotParameters:
    """The autopilot's parameters for a vehicle, with those of the custom classes. OwnError if a class cannot
    be loaded, or a parameter of it is invalid."""
    defined: tuple[table.Parameter, ...] = ()
    parameter_table = autopilot_parameters(belief)
    for loaded_class in own.load_classes():
        defined += loaded_class.parameters
        law = load_law(own.law).name if own.law else ""
        try:
            parameter_table = autopilot_parameters(belief, law, defined)
        except table.ParameterError as error:
            label = f"{loaded_class.reference}: {loaded_class.kind.__name__}.parameters: {error}"
            raise OwnError(f"--{loaded_class.role.lower()} {label}") from None
    return parameter_table
