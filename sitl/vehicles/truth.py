"""The plant's record of the true vehicle, with the names that the equations of the plant use."""

from __future__ import annotations

from os import PathLike

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.model import Vehicle
from sitl.plant.records import Air, ChainModel, Drive, Truth

# keys of the vehicle file that are not the name of the field followed by its unit
_IRREGULAR_KEYS = {
    "known_curve": "thrust_curve_known",
    "speed_controlled": "esc_speed_controlled",
    "cells": "battery_cells",
    "capacity_as": "battery_capacity_mah",
    "resistance": "battery_resistance_ohm",
    "hover_w": "battery_hover_w",
    "charge": "battery_charge",
    "density": "air_density_kg_m3",
}
_RECORDS = ("air", "drive")  # of numbers
_SCALES = {"capacity_as": 3.6}  # A s per mAh


def _keys(record: type[Truth] | type[Air] | type[Drive]) -> dict[str, str]:
    """Key of the vehicle file for each field: from `_IRREGULAR_KEYS`, or its name followed by its unit."""
    found = {}
    for field in record._fields:
        if field in _RECORDS:
            continue
        keys = [key for key in Vehicle.model_fields if key == field or key.startswith(f"{field}_")]
        if (
            field in _IRREGULAR_KEYS or keys
        ):  # else the field is not in the vehicle file: the winch, the voltage
            found[field] = _IRREGULAR_KEYS.get(field) or min(keys, key=len)
    return found


KEYS, AIR_KEYS, DRIVE_KEYS = _keys(Truth), _keys(Air), _keys(Drive)
CHAIN_KEYS = {
    "links": "cable_links",
    "mass": "cable_mass_kg_m",
    "drag_coefficient": "cable_drag_coefficient",
    "stiffness": "cable_stiffness_n",
    "damping": "cable_damping_n_s",
    "hook": "load_hook_m",
    "gyration": "load_gyration_m",
    "gyration_upright": "load_gyration_upright_m",
    "pressure": "load_pressure_m",
    "spin_drag": "load_spin_drag_n_m_s2",
}


def truth_of(vehicle: Vehicle) -> Truth:
    """The vehicle as the plant's kernels require it: all rotors intact, the winch at rest, the battery
    without current."""
    values = {field: getattr(vehicle, key) for field, key in KEYS.items()}
    air = {field: float(getattr(vehicle, key)) for field, key in AIR_KEYS.items()}
    drive = {
        field: _SCALES.get(field, 1.0) * float(getattr(vehicle, key)) for field, key in DRIVE_KEYS.items()
    }
    chain = ChainModel(**{field: getattr(vehicle, key) for field, key in CHAIN_KEYS.items()})
    return Truth(**values, air=Air(**air), drive=Drive(**drive), chain=chain)


def load_truth(name_or_path: str | PathLike[str]) -> Truth:
    """The truth of a shipped vehicle (`bebop`, `thesis`) or of a vehicle file; otherwise VehicleFileError."""
    return truth_of(load_vehicle(name_or_path))
