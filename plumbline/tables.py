"""The base class of vehicles and sensor profiles made in Python: loading, changing, checking, saving."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any, ClassVar, Self

from pydantic import BaseModel, ValidationError

from gcs.errors import GcsError, input_error
from missions.toml_files import FileError, TomlFiles, problems
from missions.writing import write_toml
from plumbline.arguments import file_path, name_or_file

_EVERY_TICK = "tick"  # rate_hz in a file; a record has a rate of 0 instead


class Table(BaseModel):
    """A record with the keys of a TOML file, checked when it is created: `Error` if a value is invalid."""

    files: ClassVar[TomlFiles]

    def __init__(self, **keys: Any) -> None:
        try:
            super().__init__(**keys)
        except ValidationError as error:
            where = str(keys.get("name") or type(self).__name__)
            raise GcsError("; ".join(problems(error, type(self), where))) from None

    @classmethod
    def load(cls, name_or_path: str | PathLike[str]) -> Self:
        """A shipped record by its name, or the record in a file."""
        try:
            found = cls.files.read(name_or_file(cls.files.kind, name_or_path))
            return cls(**cls.files.table(found.text, found.where))
        except FileError as error:
            raise input_error(error) from None

    def replace(self, **changes: Any) -> Self:
        """A copy with some keys changed. In a nested table only the given keys change; None removes a key or
        a table."""
        keys = self.keys()
        for name, value in changes.items():
            if isinstance(value, Mapping) and isinstance(keys.get(name), dict):
                keys[name] = _without_none({**keys[name], **value})
            else:
                keys[name] = value
        return type(self)(**_without_none(keys))

    def save(self, path: str | PathLike[str]) -> None:
        """Write the record as a file, which `load` and every command read; an existing file is replaced."""
        try:
            write_toml(file_path("path", path), self.keys())
        except FileError as error:
            raise input_error(error) from None

    def keys(self) -> dict[str, Any]:
        """Keys and values as in a file, without those that were not given."""
        found = self.model_dump(exclude_unset=True, exclude_none=True)
        for table in found.values():
            if isinstance(table, dict) and table.get("rate_hz") == 0.0:
                table["rate_hz"] = _EVERY_TICK
        return found


def _without_none(keys: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in keys.items() if value is not None}
