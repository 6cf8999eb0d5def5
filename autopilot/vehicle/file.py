"""Vehicle files: TOML in, `Vehicle` out. The shipped ones are the files in `vehicles`, named nowhere else."""

from __future__ import annotations

from os import PathLike

from autopilot.vehicle.model import Vehicle
from missions.toml_files import FileError, TomlFiles


class VehicleFileError(FileError):
    """A vehicle file is missing or wrong: the fault of whoever wrote or named it."""


VEHICLES = TomlFiles("vehicle", "autopilot.vehicle", "vehicles", VehicleFileError)


def load_vehicle(name_or_path: str | PathLike[str]) -> Vehicle:
    """The vehicle of a shipped name (`bebop`) or of a file; a VehicleFileError says what is wrong."""
    found = VEHICLES.read(name_or_path)
    table = VEHICLES.table(found.text, found.where)
    return VEHICLES.record(Vehicle, {"name": found.name, **table}, found.where)
