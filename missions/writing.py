"""Files written: a mission as the table that `missions.fileformat` reads, and tables as TOML files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from math import degrees, inf, nextafter, radians
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import Any

from missions.model import KINDS, Sine, Step, Term
from missions.toml_files import FileError


def write_toml(path: str | PathLike[str], table: Mapping[str, Any]) -> None:
    """Write a file of these keys and values, over one that is there; a FileError says why it cannot be."""
    import tomli_w

    try:
        Path(path).write_text(tomli_w.dumps(table), encoding="utf-8")
    except OSError as error:
        raise FileError([f"{path}: cannot be written: {error.strerror}"]) from None


def mission_table(
    title: str, description: str, assumptions: Sequence[str], steps: Sequence[Step]
) -> dict[str, Any]:
    """The keys and values of the file; whether they may be is for `missions.fileformat` to say."""
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
    """The keys of a step, a term or a factor; angles are degrees in a file. What is not given is left out."""
    table: dict[str, Any] = {}
    known = isinstance(record, (*KINDS, Term, Sine))
    for field in fields(record) if known else ():
        value = getattr(record, field.name)
        if field.name.endswith("_rad") and isinstance(value, Real):
            table[field.name.removesuffix("_rad") + "_deg"] = _degrees(_number(value))
        elif isinstance(value, Sequence) and not isinstance(value, str):
            table |= {field.name: [_keys(part) for part in value]} if value else {}
        elif value is not None:
            table[field.name] = _number(value) if isinstance(value, Real) else value
    if isinstance(record, Term) and record.hold_s is None:
        table.pop("fall_s", None)  # the term stays at its top
    return table


def _number(value: Real) -> float:
    """As a file has it; an integer that no float holds is infinite."""
    try:
        return float(value)
    except OverflowError:
        return inf


def _degrees(angle_rad: float) -> float:
    """Degrees that are read as just this angle, the shortest of them; where there are none, the nearest."""
    near = degrees(angle_rad)
    for found in (round(near, 10), near, nextafter(near, -inf), nextafter(near, inf)):
        if radians(found) == angle_rad:
            return found
    return near
