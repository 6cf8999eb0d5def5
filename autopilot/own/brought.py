"""A custom class as the rest of the autopilot sees it, and the parameters that it defines."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from inspect import getsourcelines, signature
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from autopilot.own.source import OwnError, digest_of, file_of
from autopilot.wire import parameter_table as table

_NAME = re.compile(r"[A-Za-z][\w-]{0,31}")


class Parameter(NamedTuple):
    """A parameter that a custom class defines: a number in `low` ... `high`."""

    default: float
    low: float
    high: float
    unit: str = ""
    text: str = ""


@dataclass(frozen=True)
class Brought:
    """A loaded custom class."""

    what: ClassVar[str] = ""  # its kind in messages, with a capital letter

    reference: str  # as the user named it
    name: str
    kind: type
    parameters: tuple[table.Parameter, ...]

    @property
    def path(self) -> Path | None:
        """The file in which it is written."""
        return file_of(self.kind)

    @property
    def digest(self) -> str:
        """A hash of its source."""
        return digest_of(self.kind)

    @property
    def told(self) -> str:
        """Its kind and name, for messages."""
        return f"{self.what} {self.name}"

    def made(self, parameters: Mapping[str, float]) -> Any:
        """An instance with these parameters."""
        build = getattr(self.kind, "build", None)
        if build is not None:
            return build(parameters)
        return self.kind(parameters) if signature(self.kind).parameters else self.kind()

    def line(self, method: str) -> str:
        """File and line of a method; of the class if the method is not in the file of the class."""
        found = getattr(self.kind, method, None)
        found = getattr(found, "py_func", getattr(found, "__func__", found))
        code = getattr(found, "__code__", None)
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
    def making(self) -> str:
        """File and line of the method that makes an instance."""
        return self.line("build" if hasattr(self.kind, "build") else "__init__")


class Named(NamedTuple):
    """What every custom class must have: the arguments of `Brought`."""

    reference: str
    name: str
    kind: type
    parameters: tuple[table.Parameter, ...]


def named(kind: type, reference: str, shipped: Sequence[str] = ()) -> Named:
    """The class with its name and parameters. OwnError if these are invalid; `shipped` are the names of
    shipped laws, which it must not have."""
    told = f"{reference}: {kind.__name__}"
    name = getattr(kind, "name", kind.__name__)
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise OwnError(f"{told}.name = {name!r}; must be letters, digits, - and _, beginning with a letter")
    if name in shipped:
        raise OwnError(f"{told}.name = {name!r} is that of a shipped law")
    if hasattr(kind, "_fields") and kind._fields and not hasattr(kind, "build"):
        raise OwnError(f"{told} is a NamedTuple; must have a classmethod build(cls, parameters)")
    brought = getattr(kind, "parameters", {})
    if not isinstance(brought, Mapping):
        raise OwnError(f"{told}.parameters must be a dictionary of Parameter by name")
    return Named(reference, name, kind, tuple(_parameter(told, *one) for one in brought.items()))


def _parameter(told: str, name: object, brought: object) -> table.Parameter:
    if not isinstance(brought, Parameter) or not isinstance(name, str):
        raise OwnError(f"{told}.parameters[{name!r}] must be Parameter(default, low, high, unit, text)")
    if name.startswith("SIM_"):
        raise OwnError(f"{told}.parameters: {name} would be the simulator's; must not begin with SIM_")
    try:
        numbers = (float(brought.default), float(brought.low), float(brought.high))
        return table.Parameter(name, *numbers, str(brought.unit), str(brought.text))
    except (TypeError, ValueError) as error:
        raise OwnError(f"{told}.parameters: {error}") from None
