"""A custom class as the rest of the autopilot sees it, and the parameters that it defines."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from inspect import getsourcelines, signature
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from autopilot.own.source import OwnError, source_digest, source_file
from autopilot.wire import parameter_table as table
from missions.nearest import did_you_mean

_VALID_NAME = re.compile(r"[A-Za-z][\w-]{0,31}")


class Parameter(NamedTuple):
    """A parameter that a custom class defines: a number in `low` ... `high`."""

    default: float
    low: float
    high: float
    unit: str = ""
    text: str = ""


class _ParametersByName(dict[str, float]):
    """All parameters of the autopilot, as a custom class is given them; a wrong name is answered by the
    nearest."""

    def __missing__(self, name: object) -> float:
        hint = did_you_mean(str(name), self).strip()
        raise KeyError(f"{name}: there is no such parameter{f'; {hint}' if hint else ''}")


@dataclass(frozen=True)
class LoadedClass:
    """A loaded custom class."""

    role: ClassVar[str] = ""  # its kind in messages, with a capital letter

    reference: str  # as the user named it
    name: str
    kind: type
    parameters: tuple[table.Parameter, ...]

    @property
    def path(self) -> Path | None:
        """The file in which it is written."""
        return source_file(self.kind)

    @property
    def digest(self) -> str:
        """A hash of its source."""
        return source_digest(self.kind)

    @property
    def label(self) -> str:
        """Its kind and name, for messages."""
        return f"{self.role} {self.name}"

    def new_instance(self, parameters: Mapping[str, float]) -> Any:
        """An instance with these parameters."""
        by_name = _ParametersByName(parameters)
        build = getattr(self.kind, "build", None)
        if build is not None:
            return build(by_name)
        return self.kind(by_name) if signature(self.kind).parameters else self.kind()

    def location(self, method: str) -> str:
        """File and line of a method; of the class if the method is not in the file of the class."""
        method_object = getattr(self.kind, method, None)
        method_object = getattr(method_object, "py_func", getattr(method_object, "__func__", method_object))
        code = getattr(method_object, "__code__", None)
        path = self.path
        if path is None:
            return f"{self.reference}:{code.co_firstlineno if code else '?'}"
        if code is not None and Path(code.co_filename) == path:
            return f"{path.name}:{code.co_firstlineno}"
        try:
            return f"{path.name}:{getsourcelines(self.kind)[1]}"
        except (OSError, TypeError):
            return path.name

    @property
    def constructor_location(self) -> str:
        """File and line of the method that makes an instance."""
        return self.location("build" if hasattr(self.kind, "build") else "__init__")


class ClassFields(NamedTuple):
    """What every custom class must have: the arguments of `LoadedClass`."""

    reference: str
    name: str
    kind: type
    parameters: tuple[table.Parameter, ...]


def checked_fields(kind: type, reference: str, shipped: Sequence[str] = ()) -> ClassFields:
    """The class with its name and parameters. OwnError if these are invalid; `shipped` are the names of
    shipped laws, which it must not have."""
    label = f"{reference}: {kind.__name__}"
    name = getattr(kind, "name", kind.__name__)
    if not isinstance(name, str) or not _VALID_NAME.fullmatch(name):
        raise OwnError(f"{label}.name = {name!r}; must be letters, digits, - and _, beginning with a letter")
    if name in shipped:
        raise OwnError(f"{label}.name = {name!r} is that of a shipped law")
    if hasattr(kind, "_fields") and kind._fields and not hasattr(kind, "build"):
        raise OwnError(f"{label} is a NamedTuple; must have a classmethod build(cls, parameters)")
    defined = getattr(kind, "parameters", {})
    if not isinstance(defined, Mapping):
        raise OwnError(f"{label}.parameters must be a dictionary of Parameter by name")
    return ClassFields(reference, name, kind, tuple(_parameter(label, *item) for item in defined.items()))


def _parameter(label: str, name: object, defined: object) -> table.Parameter:
    if not isinstance(defined, Parameter) or not isinstance(name, str):
        raise OwnError(f"{label}.parameters[{name!r}] must be Parameter(default, low, high, unit, text)")
    if name.startswith("SIM_"):
        raise OwnError(f"{label}.parameters: {name} would be the simulator's; must not begin with SIM_")
    try:
        numbers = (float(defined.default), float(defined.low), float(defined.high))
        return table.Parameter(name, *numbers, str(defined.unit), str(defined.text))
    except (TypeError, ValueError) as error:
        raise OwnError(f"{label}.parameters: {error}") from None
