"""Named, validated numbers with ranges: what the parameter protocol lists and a parameter file contains.

On the wire every parameter is a float32, so a value set from a ground station passes through
`decimal_from_float32`, which turns 0.10000000149011612 back into the 0.1 that was typed.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass

from autopilot.wire.parameter_names import unknown_parameter_text

_MAX_CACHED = 8
NAME_LENGTH = 16  # PARAM_VALUE.param_id
_NAME = re.compile(r"[A-Z][A-Z0-9_]*")
_FLOAT32 = struct.Struct("<f")
_EXACT_INTEGER = 2**24  # a float32 holds every integer up to here


class ParameterError(ValueError):
    """A parameter was set by a wrong name or to a wrong value: a mistake of the user."""


@dataclass(frozen=True)
class Parameter:
    """One parameter: a number in `low` ... `high`, in `unit` (empty if it has none)."""

    name: str
    default: float
    low: float
    high: float
    unit: str
    text: str
    integer: bool = False
    fixed: bool = False  # takes effect at start only
    stored: bool = True  # kept beyond the end of the process
    disarmed: bool = False  # changed only while the vehicle is disarmed

    def __post_init__(self) -> None:
        if len(self.name) > NAME_LENGTH or not _NAME.fullmatch(self.name):
            raise ParameterError(
                f"parameter {self.name!r}; a name is 1 ... {NAME_LENGTH} of A-Z, 0-9, _ and begins with A-Z"
            )
        if self.integer and not all(
            float(v).is_integer() and abs(v) <= _EXACT_INTEGER for v in self._numbers()
        ):
            raise ParameterError(
                f"{self.name}: default and range of an integer must be whole and within 2^24"
            )
        if not self.low <= self.default <= self.high:
            raise ParameterError(
                f"{self.name} = {self.default}; the default must be {self.low} ... {self.high}"
            )

    def _numbers(self) -> tuple[float, float, float]:
        return (self.default, self.low, self.high)

    def checked(self, value: float) -> float:
        """`value` as this parameter stores it, or ParameterError.

        A limit rounded to float32, as a ground station sends it, counts as the limit itself.
        """
        value = float(value)
        if math.isfinite(value):
            if self.low <= value <= self.high:
                if not self.integer or value.is_integer():
                    return value + 0.0  # -0.0 is stored as 0.0
                raise ParameterError(f"{self._shown(value)}; must be a whole number")
            for limit in (self.low, self.high):
                if float32(limit) == value:
                    return float(limit)
        raise ParameterError(f"{self._shown(value)}; must be {self.low:.10g} ... {self.high:.10g}")

    def _shown(self, value: float) -> str:
        return f"{self.name} = {value!r} {self.unit}".rstrip()


def float32(value: float) -> float:
    """`value` rounded to float32; infinite beyond its range."""
    try:
        rounded: float = _FLOAT32.unpack(_FLOAT32.pack(value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)
    return rounded


def decimal_from_float32(value: float) -> float:
    """The float64 nearest to the shortest decimal that rounds to the float32 `value`."""
    if not math.isfinite(value):
        return value
    for digits in range(6, 9):
        decimal = float(f"{value:.{digits}g}")
        if float32(decimal) == value:
            return decimal
    return float(f"{value:.9g}") if float32(value) == value else value


class ParameterTable:
    """The parameters of one process with their present values; `names` is the order on the wire."""

    def __init__(self, parameters: Iterable[Parameter]) -> None:
        listed = sorted(parameters, key=lambda parameter: parameter.name)
        self._parameters = {parameter.name: parameter for parameter in listed}
        if len(self._parameters) != len(listed):
            names = [parameter.name for parameter in listed]
            duplicates = sorted({name for name in names if names.count(name) > 1})
            raise ParameterError(f"parameters defined twice: {', '.join(duplicates)}")
        self.names = tuple(self._parameters)
        self.version = 0
        self.remote_names: set[str] = set()  # names that another process owns
        self._values = {parameter.name: float(parameter.default) for parameter in listed}
        self._index = {name: index for index, name in enumerate(self.names)}
        self._frozen = False
        self._cache: dict[Hashable, bytes] = {}  # made from the table's version `_cached_version`
        self._cached_version = self.version

    def add_remote(self, parameter: Parameter) -> None:
        """Add a parameter that another process owns, at its default; all later names move up by one."""
        if parameter.name in self._parameters:
            raise ParameterError(f"{parameter.name}: defined already")
        self._parameters[parameter.name] = parameter
        self._parameters = dict(sorted(self._parameters.items()))
        self.names = tuple(self._parameters)
        self._index = {name: index for index, name in enumerate(self.names)}
        self._values[parameter.name] = float(parameter.default)
        self.remote_names.add(parameter.name)
        self.version += 1

    def __getitem__(self, name: str) -> float:
        try:
            return self._values[name]
        except KeyError:
            raise self._unknown(name) from None

    def vector(self, name: str) -> tuple[float, float, float]:
        """The values of three parameters whose names are this one with X, Y and Z."""
        return self[f"{name}X"], self[f"{name}Y"], self[f"{name}Z"]

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __len__(self) -> int:
        return len(self.names)

    def index(self, name: str) -> int:
        """Place of `name` in `names`: PARAM_VALUE.param_index."""
        if name not in self._index:
            raise self._unknown(name)
        return self._index[name]

    def describe(self, name: str) -> Parameter:
        """The definition of `name`."""
        if name not in self._parameters:
            raise self._unknown(name)
        return self._parameters[name]

    def check(self, name: str, value: float) -> float:
        """The value that `set` would store; raises as `set` does and changes nothing."""
        parameter = self.describe(name)
        stored = parameter.checked(value)
        if self._frozen and parameter.fixed and stored != self._values[name]:
            raise ParameterError(f"{name} is fixed while running; restart with --set {name}={stored:.10g}")
        return stored

    def set(self, name: str, value: float) -> float:
        """Store `value` and increment `version`; returns the stored value."""
        stored = self.check(name, value)
        self._values[name] = stored
        self.version += 1
        return stored

    def cached(self, key: Hashable, make: Callable[[], bytes]) -> bytes:
        """The bytes of `key`, made from this table by `make`, and made again only after it has changed."""
        if self._cached_version != self.version or len(self._cache) >= _MAX_CACHED:
            self._cache, self._cached_version = {}, self.version
        if key not in self._cache:
            self._cache[key] = make()
        return self._cache[key]

    def freeze(self) -> None:
        """From now on parameters marked `fixed` keep their value."""
        self._frozen = True

    def values(self) -> dict[str, float]:
        """All values by name."""
        return dict(self._values)

    def changed(self) -> dict[str, float]:
        """The values that differ from their default."""
        return {
            name: value for name, value in self._values.items() if value != self._parameters[name].default
        }

    def _unknown(self, name: str) -> ParameterError:
        return ParameterError(unknown_parameter_text(name, self.names))


def parse_text(text: str) -> dict[str, float]:
    """Names and numbers of a parameter file, unchecked against any table.

    The lines are `NAME value` (MAVProxy, Mission Planner, also with a comma) or QGroundControl's five columns
    `vehicle component NAME value type`; `#` begins a comment. The last of two equal names wins.
    """
    found: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        if len(words) == 5 and words[0].isdigit() and words[1].isdigit():
            words = words[2:4]
        try:
            name, value = words
            found[name] = float(value)
        except ValueError:
            raise ParameterError(f"line {number}: {line.strip()[:60]!r}; must be NAME value") from None
    return found
