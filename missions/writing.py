"""Writing files: a mission as the table that `missions.fileformat` reads, and tables as TOML files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from math import degrees, inf, nextafter, radians
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import Any

from missions.model import KINDS, Sine, Step, Term
from missions.toml_files import FileError

# an array of numbers, each on a line of its own
_NUMBERS = re.compile(r"\[\n((?:\s*[-+.\de]+,\n)+)\s*\]")


def write_toml(path: str | PathLike[str], table: Mapping[str, Any]) -> None:
    """Write these keys and values to a file and replace an existing one; FileError with the reason if not."""
    import tomli_w

    try:
        Path(path).write_text(_NUMBERS.sub(_in_a_line, tomli_w.dumps(table)), encoding="utf-8")
    except OSError as error:
        raise FileError([f"{path}: cannot be written: {error.strerror}"]) from None


def _in_a_line(array: re.Match[str]) -> str:
    return f"[{', '.join(array[1].replace(',', ' ').split())}]"


def mission_table(
    title: str, description: str, assumptions: Sequence[str], steps: Sequence[Step]
) -> dict[str, Any]:
    """The keys and values of the file; `missions.fileformat` checks whether they are allowed."""
    table: dict[str, Any] = {"title": title}
    if description:
        table["description"] = description
    if assumptions:
        table["assumptions"] = list(assumptions)
    return {
        **table,
        "items": [{"type": KINDS.get(type(step), type(step).__name__), **_keys(step)} for step in steps],
    }


def _keys(record: Any) -> dict[str, Any]:
    """The keys of a step, a term or a factor; angles are degrees in a file. Values not given are left out."""
    table: dict[str, Any] = {}
    known = isinstance(record, (*KINDS, Term, Sine))
    for field in fields(record) if known else ():
        value = getattr(record, field.name)
        if not field.compare:
            continue
        if field.name.endswith("_rad"):
            found = plain_value(value)
            key = field.name.removesuffix("_rad") + "_deg"
            table[key] = _degrees(found) if isinstance(found, float) else found
        elif field.name == "points":
            table["points"] = [[plain_value(number) for number in row] for row in value]
        elif isinstance(value, Sequence) and not isinstance(value, str):
            table |= {field.name: [_keys(part) for part in value]} if value else {}
        elif value is not None:
            table[field.name] = plain_value(value)
    if isinstance(record, Term) and record.hold_s is None:
        table.pop("fall_s", None)  # the term stays at its top
    return table


def is_truth_value(value: Any) -> bool:
    """Whether this is True or False, also numpy's, by its present and its former name."""
    return type(value).__name__ in ("bool", "bool_")


def plain_value(value: Any) -> Any:
    """A number as a float, infinite for an integer beyond the range of floats; other values as they are. True
    and False, also numpy's, are no numbers."""
    if is_truth_value(value):
        return bool(value)
    if not isinstance(value, Real):
        return value
    try:
        return float(value)
    except OverflowError:
        return inf


def _degrees(angle_rad: float) -> float:
    """Degrees that are read back as exactly this angle, if possible rounded ones; otherwise the nearest."""
    near = degrees(angle_rad)
    for found in (round(near, 10), near, nextafter(near, -inf), nextafter(near, inf)):
        if radians(found) == angle_rad:
            return found
    return near
