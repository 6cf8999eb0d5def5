"""The limits against which a mission is checked before take-off: those of a vehicle by name or file."""

from __future__ import annotations

from math import inf, radians
from typing import TYPE_CHECKING, Any

from autopilot.trajectory.feasibility import VehicleLimits
from autopilot.vehicle.file import load_truth_and_belief
from autopilot.vehicle.parameters import AutopilotParameters, autopilot_parameters
from autopilot.vehicle.shipped import VehicleFileError
from autopilot.wire.parameter_names import unknown_parameter_text
from autopilot.wire.parameter_table import ParameterError
from gcs.errors import InputError, input_error
from gcs.workflows.flight_options import SIMULATOR_PREFIX, Settings

if TYPE_CHECKING:
    from autopilot.vehicle.model import Vehicle


def load_limits(name_or_path: str, settings: Settings = ()) -> VehicleLimits:
    """The limits of a shipped vehicle or of a vehicle file, with these parameters of its autopilot; GcsError
    states what is wrong with them."""
    try:
        _, belief = load_truth_and_belief(name_or_path)  # the true one too must be one that can be simulated
    except VehicleFileError as error:
        raise input_error(error) from None
    table = with_settings(autopilot_parameters(belief), settings)
    return VehicleLimits(
        vehicle_as_set(belief, table, settings),
        tilt_max_rad=radians(table["MIS_TILT_DEG"]),
        speed_m_s=table["MIS_SPEED"],
        accel_m_s2=table["MIS_ACCEL"],
        min_tension_share=0.01 * table["MIS_TENSION"],
        max_shaping_m=table["MIS_SHAPE_ERR"],
        rotor_margin=0.01 * table["MIS_ROTOR_MARG"],
        when_infeasible=int(table["MIS_INFEASIBLE"]),
        time_optimal=table["MIS_TIME_OPT"] != 0.0,
    )


def vehicle_as_set(belief: Vehicle, table: AutopilotParameters, settings: Settings) -> Vehicle:
    """The vehicle that the autopilot assumes if the parameters among `settings` that describe it (VEH_) have
    their values in `table`; the rest is as in the vehicle file."""
    changed: dict[str, Any] = {}
    for name, _ in settings:
        if key := _NUMBERS.get(name):
            changed[key] = table[name]
        elif name in _INERTIA:
            changed["inertia_kg_m2"] = tuple(table[axis] for axis in _INERTIA)
        elif place := _PLACES.get(name[:-1]):
            changed[place] = tuple(table[name[:-1] + axis] for axis in "XYZ")
        elif name == "VEH_ROTOR_TAU":
            changed["rotor_tau_s"] = 1e-3 * table[name]
        elif name == "VEH_ARM_LEN":  # the places of the rotors are in units of it
            ratio = table[name] / belief.arm_m
            changed["arm_m"] = table[name]
            changed["rotor"] = tuple(
                one.model_copy(update={"x_m": ratio * one.x_m, "y_m": ratio * one.y_m})
                for one in belief.rotor
            )
        elif name in _ROTOR_LIMITS:
            limited = table["VEH_ROTOR_LIM"] != 0.0
            changed["rotor_min_n"] = table["VEH_ROTOR_MIN"]
            changed["rotor_max_n"] = table["VEH_ROTOR_MAX"] if limited else inf
    return belief.model_copy(update=changed) if changed else belief


_NUMBERS = {
    "VEH_QUAD_MASS": "quad_mass_kg",
    "VEH_LOAD_MASS": "load_mass_kg",
    "VEH_CABLE_LEN": "cable_length_m",
    "VEH_TORQUE": "torque_ratio_m",
    "VEH_GRAVITY": "gravity_m_s2",
}
_INERTIA = ("VEH_J_XX", "VEH_J_YY", "VEH_J_ZZ")
_PLACES = {
    "VEH_ATT_": "attachment_m",
    "VEH_IMU_POS_": "imu_position_m",
    "VEH_GPS_POS_": "antenna_position_m",
}
_ROTOR_LIMITS = ("VEH_ROTOR_MIN", "VEH_ROTOR_MAX", "VEH_ROTOR_LIM")


def with_settings(table: AutopilotParameters, settings: Settings) -> AutopilotParameters:
    """The table with these parameters set; InputError for one that it has not, or a value out of range."""
    for name, value in settings:
        if name not in table and name.startswith(SIMULATOR_PREFIX):
            raise InputError(
                f"--set {name}: must be a parameter of the autopilot, or SIM_WIND_E or SIM_WIND_N"
            )
        if name not in table:
            raise InputError(f"--set {unknown_parameter_text(name, table.names)}")
        try:
            table.set(name, value)
        except ParameterError as error:
            raise InputError(f"--set {error}") from None
    return table
