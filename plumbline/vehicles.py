"""Vehicles made in Python."""

from __future__ import annotations

from os import PathLike
from typing import ClassVar, Self

from autopilot.vehicle import model
from autopilot.vehicle.file import vehicle_keys
from autopilot.vehicle.shipped import VEHICLES
from gcs.errors import input_error
from missions.toml_files import FileError, TomlFiles
from plumbline.arguments import name_or_file
from plumbline.tables import Table


class Vehicle(Table, model.Vehicle):
    """A vehicle with its cable and its load; the keys are those of a vehicle file (docs/vehicles.md).

    ```python
    Vehicle.load("bebop").replace(name="long", cable_length_m=1.2).save("long.toml")
    ```
    """

    files: ClassVar[TomlFiles] = VEHICLES

    @classmethod
    def load(cls, name_or_path: str | PathLike[str]) -> Self:
        """A shipped vehicle by its name, or the vehicle in a file. If the file names another vehicle in
        `believed`, the keys that it leaves out are those of that vehicle."""
        try:
            keys, _ = vehicle_keys(name_or_file("vehicle", name_or_path))
        except FileError as error:
            raise input_error(error) from None
        return cls(**keys)
