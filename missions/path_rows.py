"""Rows of times and places as they are given in Python: a list, an array or a data frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from missions.errors import PathError


def path_rows(given: Any, columns: Sequence[str], name: str) -> list[tuple[Any, ...]]:
    """The rows, each with a value for each of the columns; PathError, which calls them `name`, if they have
    not. The values may be anything."""
    table = given.to_numpy() if hasattr(given, "to_numpy") else given
    rows = list(table) if _is_list(table) else None
    if rows is None:
        raise PathError(f"= {_shown(given)}; must be rows of {', '.join(columns)}")
    for index, row in enumerate(rows):
        if not _is_list(row) or len(row) != len(columns):
            count = f"has {len(row)} numbers" if _is_list(row) else f"= {_shown(row)}"
            raise PathError(f"{count}; must be {', '.join(columns)}", index, name)
    return [tuple(row) for row in rows]


def _is_list(value: Any) -> bool:
    """Whether the value has members: not a text, a mapping, or an array without dimensions."""
    is_other = isinstance(value, str | bytes | Mapping) or getattr(value, "ndim", 1) == 0
    return isinstance(value, Iterable) and not is_other


def _shown(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
