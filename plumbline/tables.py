"""What vehicles and sensor profiles made in Python have in common: read, changed, checked and saved."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any, ClassVar, Self

from pydantic import BaseModel, ValidationError

from gcs.errors import GcsError, input_error
from missions.toml_files import FileError, TomlFiles, problems
from missions.writing import write_toml
from plumbline.arguments import file_path, name_or_file

_EVERY_TICK = "tick"  # in a file; a record holds a rate of 0


class Table(BaseModel):
    """A record that is a TOML file: within its bounds, or there is none (`Error`)."""

    files: ClassVar[TomlFiles]

    def __init__(self, **keys: Any) -> None:
        try:
            super().__init__(**keys)
        except ValidationError as error:
            where = str(keys.get("name") or type(self).__name__)
            raise GcsError("; ".join(problems(error, type(self), where))) from None

    @classmethod
    def load(cls, name_or_path: str | PathLike[str]) -> Self:
        """A shipped one by its name, or that of a file."""
        try:
            found = cls.files.read(name_or_file(cls.files.kind, name_or_path))
            return cls(**cls.files.table(found.text, found.where))
        except FileError as error:
            raise input_error(error) from None

    def replace(self, **changes: Any) -> Self:
        """Another one with some keys changed. Of a table within it only the keys that are given change; None
        takes a key or a table away."""
        keys = self.keys()
        for name, value in changes.items():
            if isinstance(value, Mapping) and isinstance(keys.get(name), dict):
                keys[name] = _without_none({**keys[name], **value})
            else:
                keys[name] = value
        return type(self)(**_without_none(keys))

    def save(self, path: str | PathLike[str]) -> None:
        """Write the file, which `load` and every command read; one that is there is replaced."""
        try:
            write_toml(file_path("path", path), self.keys())
        except FileError as error:
            raise input_error(error) from None

    def keys(self) -> dict[str, Any]:
        """Keys and values as the file has them, but for those that were not given."""
        found = self.model_dump(exclude_unset=True, exclude_none=True)
        for table in found.values():
            if isinstance(table, dict) and table.get("rate_hz") == 0.0:
                table["rate_hz"] = _EVERY_TICK
        return found


def _without_none(keys: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in keys.items() if value is not None}
