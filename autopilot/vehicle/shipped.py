"""The shipped vehicles: the files in `vehicles`. No kernel is loaded, so help texts can use this."""

from __future__ import annotations

from missions.toml_files import FileError, TomlFiles


class VehicleFileError(FileError):
    """A vehicle file is missing or wrong: an error of the user who wrote or named it."""


VEHICLES = TomlFiles("vehicle", VehicleFileError)
