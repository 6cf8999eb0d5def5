"""Checks of the arguments of scripts; messages use the terms of Python, not those of the command line."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import wraps
from inspect import Parameter, signature
from operator import index
from os import PathLike, fspath
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from platformdirs import user_cache_path

from autopilot.own.source import file_being_loaded
from gcs.errors import GcsError
from missions.nearest import did_you_mean
from missions.writing import is_truth_value

P = ParamSpec("P")
R = TypeVar("R")

INPUTS = user_cache_path("plumbline") / "inputs"  # the files of what is made in Python
_MAX_SHOWN_CHARS = 80  # characters of a value
_PHRASES = (  # phrases of the command line, and their equivalents in Python
    (rf"(?<=flown by vehicle ){re.escape(str(INPUTS))}[/\\]\w+[/\\]([\w-]+)\.toml", r"\1"),
    (r"(?<=another folder) by --out\b", ""),
    (r"add --fresh to", "give fresh=True to"),
    (r"(?<=has it, or )without it: --ignore (\w+)", r"leave \1 out of the vehicle's parameters"),
    (r"--skip uploads", "skip=True uploads"),
    (r"--force tries:;?", "force=True tries:"),
    (r"--law\b(?= says|[^s]*instead)", "laws"),
    (r"; see gcs [a-z ]*--help$", ""),
    (r"Invalid value for '--([a-z]+)'", r"\1"),
    (r"--set ", "settings: "),
    (
        r"\(other addresses: --connect (\d+) or --connect HOST:PORT\)",
        r"(another address: connect(\1))",
    ),
    (r"--connect (\d+)", r"connect(\1)"),
    (r"--connect (?=[A-Z])", "connect to "),
    (
        r"(?<![\w-])(?<!gcs sweep )(?<!autopilot )--([a-z]+)",
        r"\1",
    ),  # a command that is quoted keeps its options
)


def called_by_scripts(function: Callable[P, R]) -> Callable[P, R]:
    """The function; an unknown argument name raises a TypeError that suggests the nearest name, and a call by
    a script that is loaded only for its class raises `Error`, as does a wrong flag (`checked_flags`)."""
    parameters = signature(function).parameters
    names = tuple(parameters)

    @wraps(function)
    def wrapper(*values: P.args, **named: P.kwargs) -> R:
        _require_guard(function.__name__)
        for name in named:
            if name not in names:
                hint = did_you_mean(name, names)
                known = ", ".join(names)
                raise TypeError(f"{function.__name__}: no argument {name!r}; {hint}must be one of {known}")
        _check_flags(parameters, values, named)
        return function(*values, **named)

    return wrapper


def checked_flags(function: Callable[P, R]) -> Callable[P, R]:
    """The function; an argument whose default is True or False raises `Error` if it is given another value:
    a text, as "no", would count as True."""
    parameters = signature(function).parameters

    @wraps(function)
    def wrapper(*values: P.args, **named: P.kwargs) -> R:
        _check_flags(parameters, values, named)
        return function(*values, **named)

    return wrapper


def _check_flags(
    parameters: Mapping[str, Parameter], values: Iterable[object], named: Mapping[str, object]
) -> None:
    for name, value in (*zip(parameters, values, strict=False), *named.items()):
        is_flag = name in parameters and isinstance(parameters[name].default, bool)
        if is_flag and not is_truth_value(value):
            raise GcsError(f"{name} = {shown_value(value)}; must be True or False")


def _require_guard(called: str) -> None:
    """Refuse calls of a script that another process loads for a class of its own: it would fly again."""
    script = file_being_loaded()
    if script is not None:
        raise GcsError(
            f"{script.name} calls plumbline.{called} while its class is loaded; "
            'put its calls below: if __name__ == "__main__":'
        )


@contextmanager
def errors_for_python() -> Iterator[None]:
    """Reword an Error raised in this context: without options of the command line."""
    try:
        yield
    except GcsError as error:
        raise type(error)(reworded_for_python(str(error))) from None


def reworded_for_python(text: str) -> str:
    """A text written for the command line, reworded for scripts."""
    for phrase, replacement in _PHRASES:
        text = re.sub(phrase, replacement, text)
    return text


def number(name: str, value: Any) -> float:
    """A finite number, or `Error`. True and False are no numbers, as they would pass for 1 and 0, nor is a
    text with the digits of one."""
    try:
        found = math.nan if is_truth_value(value) or _is_text(value) else float(value)
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if not math.isfinite(found):
        raise GcsError(f"{name} = {shown_value(value)}; must be a finite number")
    return found


def _is_text(value: Any) -> bool:
    return isinstance(value, str | bytes | bytearray)


def positive(name: str, value: Any) -> float:
    """A finite number above 0, or `Error`."""
    found = number(name, value)
    if found <= 0.0:
        raise GcsError(f"{name} = {shown_value(value)}; must be greater than 0")
    return found


def not_negative(name: str, value: Any) -> float:
    """A finite number, 0 or more, or `Error`."""
    found = number(name, value)
    if found < 0.0:
        raise GcsError(f"{name} = {shown_value(value)}; must be 0 or more")
    return found


def whole_number(name: str, value: Any, minimum: int, maximum: int | None = None) -> int:
    """A whole number from `minimum` to `maximum`, or `Error`."""
    try:
        found = index(value)
    except TypeError:
        found = minimum - 1
    if is_truth_value(value) or found < minimum or (maximum is not None and found > maximum):
        limits = f", {minimum} or more" if maximum is None else f" from {minimum} to {maximum}"
        raise GcsError(f"{name} = {shown_value(value)}; must be a whole number{limits}")
    return found


def numbers(name: str, values: Any) -> tuple[float, ...]:
    """Finite numbers, one at least, or `Error`."""
    listed = items(name, values, "a list of numbers")
    if not listed:
        raise GcsError(f"{name} is empty; must be a list of one number at least")
    return tuple(number(f"{name}[{i}]", value) for i, value in enumerate(listed))


def text(name: str, value: Any, example: str) -> str:
    """A text, or `Error`, which shows an example."""
    if not isinstance(value, str):
        raise GcsError(f"{name} = {shown_value(value)}; must be a text, as {example!r}")
    return value


def file_path(name: str, value: Any) -> Path:
    """The path of a file or a directory, or `Error`."""
    path = name_or_file(name, value)
    if not path:
        raise GcsError(f"{name} = ''; must be the path of a file or a directory")
    return Path(path)


def name_or_file(name: str, value: Any) -> str:
    """A name or the path of a file, neither of which need exist; `Error` if the value is no text and no
    path."""
    path = fspath(value) if isinstance(value, str | PathLike) else None
    if not isinstance(path, str):
        raise GcsError(f"{name} = {shown_value(value)}; must be a text or a Path")
    return path


def items(name: str, values: Any, what: str) -> tuple[Any, ...]:
    """The members of a list or of another iterable, or `Error`, which says `what` it must be."""
    if isinstance(values, Iterable) and not isinstance(values, str | bytes | Mapping):
        with suppress(TypeError):  # a numpy array without dimensions
            return tuple(values)
    raise GcsError(f"{name} = {shown_value(values)}; must be {what}")


def parameter_mapping(name: str, values: Any, example: str) -> Mapping[str, Any]:
    """A mapping whose keys are names of parameters, empty for None; or `Error`, which shows an example."""
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise GcsError(f"{name} = {shown_value(values)}; must be a dict, as {example}")
    for key in values:
        parameter_name(name, key)
    return values


def values_by_parameter(name: str, values: Any, example: str) -> dict[str, Any]:
    """As `parameter_mapping`, with the names in capitals; `Error` if two keys are the same parameter."""
    found: dict[str, Any] = {}
    for key, value in parameter_mapping(name, values, example).items():
        known = parameter_name(name, key)
        if known in found:
            raise GcsError(f"{name}: {known} is there twice, in capital and small letters; leave one out")
        found[known] = value
    return found


def parameter_name(where: str, name: Any) -> str:
    """The name of a parameter, which need not exist, in capitals; `Error` if it cannot be a name."""
    if not isinstance(name, str) or not name.isidentifier():
        raise GcsError(f"{where}: {shown_value(name)} is no name of a parameter; must be one as 'SIM_WIND_E'")
    return name.upper()


def setting_arguments(settings: Any) -> tuple[str, ...]:
    """Parameters with their values, as the command line writes them; or `Error`."""
    found = values_by_parameter("settings", settings, "{'SIM_WIND_E': 3}")
    return tuple(f"{name}={number(f'settings[{name!r}]', value)!r}" for name, value in found.items())


def shown_value(value: Any) -> str:
    """The value as Python writes it, in one short line."""
    try:
        written = " ".join(repr(value).split())
    except ValueError:  # an integer of thousands of digits
        written = f"a number of {value.bit_length()} bits" if isinstance(value, int) else type(value).__name__
    return written if len(written) <= _MAX_SHOWN_CHARS else written[: _MAX_SHOWN_CHARS - 3] + "..."
