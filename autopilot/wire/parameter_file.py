"""Parameter definitions from TOML.

The files: `autopilot/vehicle/parameters.toml`, whose head explains the keys, and `sitl/sim_parameters.toml`.
A file with wrong keys or values raises ParameterError.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from autopilot.wire.parameter_table import Parameter, ParameterError
from missions.toml_files import problems

Range = Annotated[list[float], Field(min_length=2, max_length=2)]
Names = Annotated[dict[str, str], Field(min_length=2)]  # whole number: what it stands for


class ParameterSpec(BaseModel):
    """One table of the file."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    text: str = Field(min_length=1)
    unit: str = ""
    default: float | None = None
    from_vehicle: str | None = None
    proportional_to: dict[str, float] | None = Field(None, min_length=1, max_length=1)
    range: Range | None = None
    range_factor: float | None = Field(None, gt=1.0)
    values: Names | None = None
    bits: Names | None = None
    whole: bool = False
    stored: bool = True
    reboot: bool = False
    disarmed: bool = False

    @model_validator(mode="after")
    def _complete(self) -> ParameterSpec:
        _exactly_one(self, "default", "from_vehicle")
        _exactly_one(self, "range", "range_factor", "values", "bits")
        if self.proportional_to is not None and self.default is None:
            raise ValueError("has proportional_to without default")
        if self.values is not None and list(self.values) != [str(n) for n in range(len(self.values))]:
            raise ValueError(f"has values {', '.join(self.values)}; must count from 0")
        if self.bits is not None and list(self.bits) != [str(1 << n) for n in range(len(self.bits))]:
            raise ValueError(f"has bits {', '.join(self.bits)}; must be 1, 2, 4 ...")
        return self

    def parameter(self, name: str, vehicle: Mapping[str, float]) -> Parameter:
        """The definition for this vehicle."""
        default = self._default(vehicle)
        low, high = self._limits(default)
        whole = self.whole or self.values is not None or self.bits is not None
        return Parameter(
            name,
            default,
            low,
            high,
            self.unit,
            self.meaning,
            integer=whole,
            fixed=self.reboot,
            stored=self.stored,
            disarmed=self.disarmed,
        )

    @property
    def vehicle_keys(self) -> frozenset[str]:
        """Names of the vehicle values from which the default is computed."""
        taken = frozenset(self.proportional_to or ())
        return taken if self.from_vehicle is None else taken | {self.from_vehicle}

    @property
    def meaning(self) -> str:
        """The text, with what each value or bit stands for."""
        if self.values is not None:
            return f"{self.text}: " + ", ".join(f"{n} {name}" for n, name in self.values.items())
        if self.bits is not None:
            return f"{self.text}, a sum of: " + ", ".join(f"{n} {name}" for n, name in self.bits.items())
        return self.text

    def _default(self, vehicle: Mapping[str, float]) -> float:
        if self.default is None:
            return vehicle[self.from_vehicle or ""]
        for key, nominal in (self.proportional_to or {}).items():
            return self.default * (vehicle[key] / nominal)
        return self.default

    def _limits(self, default: float) -> tuple[float, float]:
        if self.range is not None:
            return self.range[0], self.range[1]
        if self.range_factor is not None:
            return default / self.range_factor, default * self.range_factor
        numbers = [float(n) for n in self.values or self.bits or {}]
        return 0.0, max(numbers) if self.bits is None else sum(numbers)


@dataclass(frozen=True)
class ParameterFile:
    """A whole file: the title of each group of names, and the parameters in the order of the file."""

    groups: Mapping[str, str]
    parameters: Mapping[str, ParameterSpec]

    def definitions(self, vehicle: Mapping[str, float]) -> list[Parameter]:
        """All parameters, with their defaults for this vehicle; ParameterError if one does not fit."""
        for name, spec in self.parameters.items():
            for key in sorted(spec.vehicle_keys - vehicle.keys()):
                known = ", ".join(vehicle)
                raise ParameterError(f"{name}: default of vehicle value {key}; must be one of {known}")
        return [spec.parameter(name, vehicle) for name, spec in self.parameters.items()]


def group_of(name: str) -> str:
    """The group of a parameter: the letters before the first underscore of its name."""
    return name.partition("_")[0]


def parameter_file(document: Mapping[str, Any], where: str) -> ParameterFile:
    """The definitions in a TOML document: the table `groups`, and one table per parameter."""
    groups: dict[str, str] = document["groups"]
    parameters: dict[str, ParameterSpec] = {}
    wrong: list[str] = []
    for name, table in document.items():
        if name == "groups":
            continue
        if group_of(name) not in groups:
            wrong.append(f"{where}: {name} has no group; must begin with one of {', '.join(groups)}")
        try:
            parameters[name] = ParameterSpec.model_validate(table)
        except ValidationError as error:
            wrong += problems(error, ParameterSpec, where, name)
    if wrong:
        raise ParameterError("; ".join(wrong))
    return ParameterFile(groups, parameters)


def _exactly_one(spec: ParameterSpec, *keys: str) -> None:
    given = [key for key in keys if getattr(spec, key) is not None]
    if len(given) != 1:
        raise ValueError(f"has {' and '.join(given) or 'none'} of {', '.join(keys)}; must have one of them")
