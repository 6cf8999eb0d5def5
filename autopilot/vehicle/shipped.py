"""Which vehicles are shipped: the files in `vehicles`. No kernel is loaded, so help may ask."""

from __future__ import annotations

from missions.toml_files import FileError, TomlFiles


class VehicleFileError(FileError):
    """A vehicle file is missing or wrong: the fault of whoever wrote or named it."""


VEHICLES = TomlFiles("vehicle", VehicleFileError)
