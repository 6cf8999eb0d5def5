"""The limits against which a mission is checked before take-off: those of a vehicle by name or file."""

from __future__ import annotations

from math import radians

from autopilot.trajectory.feasibility import VehicleLimits
from autopilot.vehicle.file import load_truth_and_belief
from autopilot.vehicle.parameters import AutopilotParameters, autopilot_parameters
from autopilot.vehicle.shipped import VehicleFileError
from autopilot.wire.parameter_table import ParameterError
from gcs.errors import InputError, input_error
from gcs.workflows.flight_options import Settings

_OF_THE_VEHICLE = "VEH_"


def load_limits(name_or_path: str, settings: Settings = ()) -> VehicleLimits:
    """The limits of a shipped vehicle or of a vehicle file, with these parameters of its autopilot; GcsError
    states what is wrong with them."""
    try:
        _, belief = load_truth_and_belief(name_or_path)  # the true one too must be one that can be simulated
    except VehicleFileError as error:
        raise input_error(error) from None
    table = with_settings(autopilot_parameters(belief), settings)
    return VehicleLimits(
        belief,
        tilt_max_rad=radians(table["MIS_TILT_DEG"]),
        speed_m_s=table["MIS_SPEED"],
        accel_m_s2=table["MIS_ACCEL"],
        min_tension_share=0.01 * table["MIS_TENSION"],
        max_shaping_m=table["MIS_SHAPE_ERR"],
        rotor_margin=0.01 * table["MIS_ROTOR_MARG"],
        when_infeasible=int(table["MIS_INFEASIBLE"]),
        time_optimal=table["MIS_TIME_OPT"] != 0.0,
    )


def with_settings(table: AutopilotParameters, settings: Settings) -> AutopilotParameters:
    """The table with these parameters set; InputError for one that it has not, or of the vehicle itself, or a
    value out of range."""
    for name, value in settings:
        if name.startswith(_OF_THE_VEHICLE) or name not in table:
            raise InputError(
                f"--set {name}: must be a parameter of the autopilot, and not of its vehicle "
                f"({_OF_THE_VEHICLE}), which a vehicle file describes"
            )
        try:
            table.set(name, value)
        except ParameterError as error:
            raise InputError(f"--set {error}") from None
    return table
