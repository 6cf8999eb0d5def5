"""The limits against which a mission is checked before take-off: those of a vehicle by name or file."""

from __future__ import annotations

from math import radians

from autopilot.trajectory.feasibility import VehicleLimits
from autopilot.vehicle.file import load_truth_and_belief
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.vehicle.shipped import VehicleFileError
from gcs.errors import input_error


def load_limits(name_or_path: str) -> VehicleLimits:
    """The limits of a shipped vehicle or of a vehicle file; GcsError states what is wrong with it."""
    try:
        _, belief = load_truth_and_belief(name_or_path)  # the true one too must be one that can be simulated
    except VehicleFileError as error:
        raise input_error(error) from None
    table = autopilot_parameters(belief)
    return VehicleLimits(
        belief,
        tilt_max_rad=radians(table["MIS_TILT_DEG"]),
        speed_m_s=table["MIS_SPEED"],
        accel_m_s2=table["MIS_ACCEL"],
        min_tension_share=0.01 * table["MIS_TENSION"],
        max_shaping_m=table["MIS_SHAPE_ERR"],
        rotor_margin=0.01 * table["MIS_ROTOR_MARG"],
        when_infeasible=int(table["MIS_INFEASIBLE"]),
    )
