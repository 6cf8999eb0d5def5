"""The simulator's parameters, SIM_*, which an experiment can change without a new vehicle file."""

from __future__ import annotations

from functools import cache

from autopilot.wire.parameter_file import ParameterFile, parameter_file
from autopilot.wire.parameter_table import ParameterTable
from sitl.plant.records import ChainModel, Drive, Truth
from sitl.vehicles.sim_parameter_file import FILE, sim_document
from sitl.vehicles.truth import CHAIN_KEYS

_PLACES = ("attachment", "imu_position", "antenna_position")  # fields of `Truth` that are positions


@cache
def definitions() -> ParameterFile:
    """The definitions in `sim_parameters.toml`."""
    return parameter_file(sim_document(), FILE)


def sim_parameters(truth: Truth) -> ParameterTable:
    """The table, with the values of the vehicle file as defaults."""
    vehicle = {
        "quad_mass_kg": truth.quad_mass,
        "load_mass_kg": truth.load_mass,
        "cable_length_m": truth.cable_length,
        "rotor_tau_ms": truth.rotor_tau * 1e3,
        **{CHAIN_KEYS[field]: value for field, value in truth.chain._asdict().items()},
        **{
            f"{field}_{axis}": value
            for field in _PLACES
            for axis, value in zip("xyz", getattr(truth, field), strict=True)
        },
        **truth.air._asdict(),
        **truth.drive._asdict(),
        "cable_diameter_mm": truth.air.cable_diameter * 1e3,
        "capacity_mah": truth.drive.capacity_as / 3.6,
        "charge_pct": truth.drive.charge * 1e2,
    }
    return ParameterTable(definitions().definitions(vehicle))


def apply(truth: Truth, table: ParameterTable) -> Truth:
    """`truth` with the values of the plant from the table."""
    drag = table["SIM_DRAG_SCALE"]
    chain = ChainModel(
        links=int(table["SIM_CBL_LINKS"]),
        mass=table["SIM_CBL_MASS"],
        drag_coefficient=table["SIM_CBL_CD"] * drag,
        stiffness=table["SIM_CBL_EA"],
        damping=table["SIM_CBL_DAMP"],
        hook=min(table["SIM_LOAD_HOOK"], 0.5 * table["SIM_CABLE_LEN"]),
        gyration=table["SIM_LOAD_GYR"],
        gyration_upright=table["SIM_LOAD_GYR_UP"],
        pressure=table["SIM_LOAD_PRESS"],
        spin_drag=table["SIM_LOAD_SPIN"] * drag,
    )
    air = truth.air._replace(
        rotor_drag=table["SIM_ROTOR_DRAG"],
        rotor_flap=table["SIM_ROTOR_FLAP"],
        blade_stiffness=table["SIM_BLADE_STIFF"],
        ground_effect=table["SIM_GND_EFFECT"],
        downwash=table["SIM_DOWNWASH"],
        cable_diameter=table["SIM_CABLE_DIAM"] * 1e-3,
    )
    drive = Drive(
        thrust_curve=table["SIM_THR_CURVE"],
        known_curve=table["SIM_THR_KNOWN"],
        esc_steps=table["SIM_ESC_STEPS"],
        speed_controlled=table["SIM_ESC_RPM_CTL"],
        battery=table["SIM_BATTERY"],
        cells=table["SIM_BAT_CELLS"],
        capacity_as=table["SIM_BAT_CAP"] * 3.6,
        resistance=table["SIM_BAT_R"],
        hover_w=table["SIM_BAT_HOVER_W"],
        charge=table["SIM_BAT_CHARGE"] * 1e-2,
    )
    return truth._replace(
        attachment=table.vector("SIM_ATT_"),
        imu_position=table.vector("SIM_IMU_POS_"),
        antenna_position=table.vector("SIM_GPS_POS_"),
        air=air,
        drive=drive,
        quad_mass=table["SIM_QUAD_MASS"],
        load_mass=table["SIM_LOAD_MASS"],
        cable_length=table["SIM_CABLE_LEN"],
        rotor_tau=table["SIM_ROTOR_TAU_MS"] * 1e-3,
        quad_drag=truth.quad_drag * drag,
        quad_drag_quadratic=truth.quad_drag_quadratic * drag,
        spin_drag=truth.spin_drag * drag,
        load_drag=truth.load_drag * drag,
        load_drag_quadratic=truth.load_drag_quadratic * drag,
        chain=chain,
    )
