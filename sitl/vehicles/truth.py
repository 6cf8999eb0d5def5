"""The plant's record of a vehicle: what really flies, with the names that the equations of the plant use."""

from __future__ import annotations

from os import PathLike

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.model import Vehicle
from sitl.plant.records import Truth


def _keys() -> dict[str, str]:
    """Key of the vehicle file for each field of Truth: the field's name with its unit behind it."""
    found = {}
    for field in Truth._fields:
        keys = [key for key in Vehicle.model_fields if key == field or key.startswith(f"{field}_")]
        if keys:  # else it is no number of the vehicle: rotors that fail, the winch
            found[field] = min(keys, key=len)
    return found


KEYS = _keys()


def truth_of(vehicle: Vehicle) -> Truth:
    """The vehicle as the plant's kernels take it: all rotors whole, the winch at rest."""
    return Truth(**{field: getattr(vehicle, key) for field, key in KEYS.items()})


def load_truth(name_or_path: str | PathLike[str]) -> Truth:
    """The truth of a shipped vehicle (`bebop`, `thesis`) or of a vehicle file; else a VehicleFileError."""
    return truth_of(load_vehicle(name_or_path))
