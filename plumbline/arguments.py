"""What scripts are told of their arguments: in words of Python, not in those of the command line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from operator import index
from typing import Any

from gcs.errors import GcsError

_PHRASES = (  # of the command line, and what they are in Python
    (r"; choose another --out, or add --fresh to .*", "; choose another out"),
    (r"; --sample takes a few", "; vary less"),
    (r"--force tries", "force=True tries"),
    (r"--law\b(?= says|[^s]*instead)", "laws"),
    (r"; see gcs [a-z ]*--help$", ""),
    (r"Invalid value for '--([a-z]+)'", r"\1"),
    (r"--set ", "settings: "),
    (r"--connect (?=[A-Z0-9])", "connect to "),
    (r"(?<![\w-])--([a-z]+)", r"\1"),
)


@contextmanager
def told_in_python() -> Iterator[None]:
    """An Error meanwhile says what it says without options of the command line."""
    try:
        yield
    except GcsError as error:
        raise type(error)(in_python(str(error))) from None


def in_python(text: str) -> str:
    """A text of the command line for scripts."""
    for phrase, instead in _PHRASES:
        text = re.sub(phrase, instead, text)
    return text


def number(name: str, value: Any) -> float:
    """A finite number, or `Error`."""
    try:
        found = float(value)
    except (TypeError, ValueError):
        found = math.nan
    if not math.isfinite(found):
        raise GcsError(f"{name} = {value!r}; must be a finite number")
    return found


def positive(name: str, value: Any) -> float:
    """A finite number above 0, or `Error`."""
    found = number(name, value)
    if found <= 0.0:
        raise GcsError(f"{name} = {value!r}; must be greater than 0")
    return found


def whole(name: str, value: Any, least: int) -> int:
    """A whole number of `least` or more, or `Error`."""
    try:
        found = index(value)
    except TypeError:
        found = least - 1
    if found < least:
        raise GcsError(f"{name} = {value!r}; must be a whole number, {least} or more")
    return found


def numbers(name: str, values: Any) -> tuple[float, ...]:
    """Finite numbers, one at least, or `Error`."""
    try:
        found = tuple(number(f"{name}[{i}]", value) for i, value in enumerate(values))
    except TypeError:
        found = ()
    if not found or isinstance(values, str):
        raise GcsError(f"{name} = {values!r}; must be a list of numbers")
    return found
