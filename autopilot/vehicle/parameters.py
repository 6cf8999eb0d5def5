"""The autopilot's parameters: what it assumes about its vehicle, and how it is tuned.

`parameters.toml` defines them; here they are given the values of a vehicle. Importing this module is cheap:
the code that checks the definitions is imported when a table is made.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from autopilot.vehicle.law_files import law_files
from autopilot.vehicle.layout import PLUS, Layout
from autopilot.wire.parameter_table import Parameter, ParameterTable

if TYPE_CHECKING:
    from autopilot.vehicle.model import Vehicle
    from autopilot.wire.parameter_file import ParameterFile

FILE = "parameters.toml"


def _read_document() -> dict[str, Any]:
    found = tomllib.loads((files(__package__) / FILE).read_text(encoding="utf-8"))
    found["CTL_LAW"]["values"] = {str(law.number): law.name for law in law_files()}
    for law in law_files():
        own_parameters = dict(law.parameters)
        found["groups"].update(own_parameters.pop("groups", {}))
        found.update(own_parameters)
    return found


_DOCUMENT = _read_document()
LAWS = tuple(law.name for law in law_files())  # CTL_LAW is an index into this
OWN_LAW = len(LAWS)  # CTL_LAW of a custom law
DEFAULT_LAW = LAWS[_DOCUMENT["CTL_LAW"]["default"]]
SHAPE_NEVER, SHAPE_WITH_PLUMBLINE, SHAPE_ALWAYS = 0, 1, 2  # MIS_SHAPE

# what a builder measures on the bench: a setting of the simulator's value also sets the autopilot's
BENCH_MEASURED = {
    "SIM_ACT_DELAY_MS": "VEH_ACT_DELAY",
    "SIM_ROTOR_TAU_MS": "VEH_ROTOR_TAU",
    "SIM_SENS_LAT_MS": "VEH_IMU_DELAY",
}


def apply_settings(table: ParameterTable, settings: Iterable[tuple[str, float]]) -> None:
    """Set the autopilot's parameters; SIM_ parameters that it does not know belong to the simulator.

    Delay and lag of the rotors and latency of the sensors that are set for the simulator also set the assumed
    values, within their range, unless the assumed value is set too: then the two differ, which is the
    experiment.
    """
    given = list(settings)
    names = {name for name, _ in given}
    for name, value in given:
        if name in table or not name.startswith("SIM_"):
            table.set(name, value)
        elif name in BENCH_MEASURED and BENCH_MEASURED[name] not in names:
            assumed = table.describe(BENCH_MEASURED[name])
            table.set(assumed.name, min(max(value, assumed.low), assumed.high))


def document() -> dict[str, Any]:
    """The parsed file, not checked, with the names of the laws and the laws' own parameters."""
    return _DOCUMENT


@cache
def definitions() -> ParameterFile:
    """The definitions in `parameters.toml`."""
    from autopilot.wire.parameter_file import parameter_file

    return parameter_file(_DOCUMENT, FILE)


class AutopilotParameters(ParameterTable):
    """The autopilot's table, and the layout of the assumed vehicle's rotors, which no parameter contains."""

    def __init__(self, definitions: Iterable[Parameter], layout: Layout = PLUS) -> None:
        super().__init__(definitions)
        self.layout = layout


def autopilot_parameters(
    belief: Vehicle, law: str = "", own_parameters: Iterable[Parameter] = ()
) -> AutopilotParameters:
    """The table, with the vehicle's numbers and the parameters it is delivered with taken from `belief`.

    `law`: the name of a custom law, to which CTL_LAW is set. `own_parameters` are the parameters of custom
    classes; ParameterError if one of them already exists.
    """
    vehicle_defaults = belief.parameters
    found = [
        replace(one, default=one.checked(vehicle_defaults[one.name])) if one.name in vehicle_defaults else one
        for one in definitions().definitions(vehicle_values(belief))
    ]
    if law:
        found = [_with_law(one, law) if one.name == "CTL_LAW" else one for one in found]
    return AutopilotParameters([*found, *own_parameters], belief.layout)


def _with_law(parameter: Parameter, law: str) -> Parameter:
    """CTL_LAW with one more value, that of the custom law, which is its default."""
    number = float(OWN_LAW)
    text = f"{parameter.text}, {OWN_LAW} {law}"
    return replace(parameter, default=number, high=number, text=text)


def _coordinates(name: str, place: tuple[float, float, float]) -> dict[str, float]:
    return {f"{name}_{axis}_m": value for axis, value in zip("xyz", place, strict=True)}


_MAX_TO_HOVER_FORCE = 1.598  # of a rotor of the vehicle of Table 4-1 with its load, rounded down


def vehicle_values(belief: Vehicle) -> dict[str, float]:
    """The numbers of the vehicle by the names that `from_vehicle` and `proportional_to` use."""
    from autopilot.wire.convert.simulator import ROTOR_FMAX

    # without limits the mixer ignores these, and gains are designed for the forces of Table 4-1, or for a
    # heavier vehicle for forces that are as large in proportion to its weight
    rotor_min, rotor_max = 0.0, max(ROTOR_FMAX, _MAX_TO_HOVER_FORCE * belief.hover_force_n)
    if belief.limited:
        rotor_min, rotor_max = belief.rotor_min_n, belief.rotor_max_n
    j_xx, j_yy, j_zz = belief.inertia_kg_m2
    return {
        "quad_mass_kg": belief.quad_mass_kg,
        "load_mass_kg": belief.load_mass_kg,
        "cable_length_m": belief.cable_length_m,
        "arm_m": belief.arm_m,
        "inertia_xx_kg_m2": j_xx,
        "inertia_yy_kg_m2": j_yy,
        "inertia_zz_kg_m2": j_zz,
        "rotor_min_n": rotor_min,
        "rotor_max_n": rotor_max,
        "rotor_limited": 1.0 if belief.limited else 0.0,
        "torque_ratio_m": belief.torque_ratio_m,
        "rotor_tau_ms": 1e3 * belief.rotor_tau_s,
        "gravity_m_s2": belief.gravity_m_s2,
        **_coordinates("attachment", belief.attachment_m),
        **_coordinates("imu_position", belief.imu_position_m),
        **_coordinates("antenna_position", belief.antenna_position_m),
        "gear_height_m": belief.gear_height_m,
        "load_radius_m": belief.load_radius_m,
        "battery_cells": float(belief.battery_cells),
        "battery_capacity_mah": belief.battery_capacity_mah,
        "battery_resistance_ohm": belief.battery_resistance_ohm,
        "battery_hover_w": belief.battery_hover_w,
        "quad_drag_n_s_m": belief.quad_drag_n_s_m,
        "quad_drag_quadratic_n_s2_m2": belief.quad_drag_quadratic_n_s2_m2,
    }


def shapes_paths(table: AutopilotParameters, follows_shaped: bool) -> bool:
    """Whether paths are shaped with these parameters; `follows_shaped`: it is worthwhile with the law."""
    shaping = table["MIS_SHAPE"]
    return shaping == SHAPE_ALWAYS or (shaping == SHAPE_WITH_PLUMBLINE and follows_shaped)


def law_of(table: ParameterTable) -> str:
    """The name of the law that flies with these parameters."""
    return (*LAWS, "of your own")[int(table["CTL_LAW"])]


def standing_height_m(table: ParameterTable) -> float:
    """Height of the cable's attachment, from which the autopilot takes positions of the vehicle, above the
    ground on which it stands."""
    return table["EST_GEAR_H"] + table["VEH_ATT_Z"]
