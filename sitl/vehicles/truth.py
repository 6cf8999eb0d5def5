"""The plant's record of a vehicle: what really flies, with the names that the equations of the plant use."""

from __future__ import annotations

from os import PathLike

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.model import Vehicle
from sitl.plant.records import Truth


def truth_of(vehicle: Vehicle) -> Truth:
    """The vehicle as the plant's kernels take it: all rotors whole, the winch at rest."""
    return Truth(
        quad_mass=vehicle.quad_mass_kg,
        arm=vehicle.arm_m,
        inertia=vehicle.inertia_kg_m2,
        load_mass=vehicle.load_mass_kg,
        cable_length=vehicle.cable_length_m,
        gravity=vehicle.gravity_m_s2,
        rotor_min=vehicle.rotor_min_n,
        rotor_max=vehicle.rotor_max_n,
        rotor_tau=vehicle.rotor_tau_s,
        torque_ratio=vehicle.torque_ratio_m,
        quad_drag=vehicle.quad_drag_n_s_m,
        quad_drag_quadratic=vehicle.quad_drag_quadratic_n_s2_m2,
        spin_drag=vehicle.spin_drag_n_m_s2,
        load_drag=vehicle.load_drag_n_s_m,
        load_drag_quadratic=vehicle.load_drag_quadratic_n_s2_m2,
        gear_height=vehicle.gear_height_m,
        gear_spread=vehicle.gear_spread_m,
        rotor_reach=vehicle.rotor_reach_m,
        rotor_height=vehicle.rotor_height_m,
        load_radius=vehicle.load_radius_m,
        contact_frequency=vehicle.contact_frequency_rad_s,
        contact_damping=vehicle.contact_damping_ratio,
        friction=vehicle.friction,
        slip_rate=vehicle.slip_rate_1_s,
    )


def load_truth(name_or_path: str | PathLike[str]) -> Truth:
    """The truth of a shipped vehicle (`bebop`, `thesis`) or of a vehicle file; else a VehicleFileError."""
    return truth_of(load_vehicle(name_or_path))
