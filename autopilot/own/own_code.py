"""The custom classes of a flight, by reference, and the parameters that they define."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import NamedTuple

from autopilot.own.estimator import load_estimator
from autopilot.own.law import load_law
from autopilot.own.loaded_class import LoadedClass
from autopilot.own.planner import load_planner
from autopilot.own.source import OwnError
from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.parameters import AutopilotParameters, autopilot_parameters
from autopilot.vehicle.shipped import VehicleFileError
from autopilot.wire import parameter_table as table
from autopilot.wire.parameter_names import unknown_parameter_text

_LABEL = "the vehicle's parameters."  # begins messages about a parameter with which a vehicle is delivered


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


def parameters_for(
    belief: Vehicle,
    own: OwnCode = NO_OWN_CODE,
    ignored: Collection[str] = (),
) -> AutopilotParameters:
    """The autopilot's parameters for a vehicle, with those of the custom classes, at the values with which
    the vehicle is delivered. OwnError if a class cannot be loaded, or a parameter of it is invalid.

    The vehicle counts as delivered without the `ignored` parameters. VehicleFileError if it is delivered with
    a parameter that neither the autopilot nor a class has.
    """
    if ignored:
        kept = {name: value for name, value in belief.parameters.items() if name not in ignored}
        belief = belief.model_copy(update={"parameters": kept})
    defined: tuple[table.Parameter, ...] = ()
    parameter_table = autopilot_parameters(belief)
    for loaded_class in own.load_classes():
        defined += tuple(_as_delivered(parameter, belief) for parameter in loaded_class.parameters)
        law = load_law(own.law).name if own.law else ""
        try:
            parameter_table = autopilot_parameters(belief, law, defined)
        except table.ParameterError as error:
            label = f"{loaded_class.reference}: {loaded_class.kind.__name__}.parameters: {error}"
            raise OwnError(f"--{loaded_class.role.lower()} {label}") from None
    unknown = [name for name in belief.parameters if name not in parameter_table]
    if unknown:
        raise VehicleFileError(
            [
                f"{_LABEL}{unknown_parameter_text(name, parameter_table.names)}; fly with the custom law, "
                f"estimator or planner that has it, or without it: --ignore {name}"
                for name in unknown
            ]
        )
    return parameter_table


def require_delivered(belief: Vehicle, ignored: Collection[str]) -> None:
    """VehicleFileError if one of the `ignored` parameters is none with which the vehicle is delivered."""
    given = ", ".join(belief.parameters) or "none"
    unknown = [name for name in ignored if name not in belief.parameters]
    if unknown:
        raise VehicleFileError(
            [f"--ignore {name}: not among the vehicle's parameters; there are {given}" for name in unknown]
        )


def _as_delivered(parameter: table.Parameter, belief: Vehicle) -> table.Parameter:
    """A parameter of a custom class; its default is the value with which the vehicle is delivered, if any."""
    if parameter.name not in belief.parameters:
        return parameter
    try:
        return replace(parameter, default=parameter.checked(belief.parameters[parameter.name]))
    except table.ParameterError as error:
        raise VehicleFileError([f"{_LABEL}{error}"]) from None
