"""The simulator's parameters, SIM_*: what an experiment changes without writing a vehicle file."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files

from autopilot.wire.parameter_file import ParameterFile, parameter_file
from autopilot.wire.parameter_table import ParameterTable
from sitl.plant.records import Truth

FILE = "sim_parameters.toml"


@cache
def definitions() -> ParameterFile:
    """What `sim_parameters.toml` says."""
    text = (files("sitl") / FILE).read_text(encoding="utf-8")
    return parameter_file(tomllib.loads(text), FILE)


def sim_parameters(truth: Truth) -> ParameterTable:
    """The table, with the values of the vehicle file as defaults."""
    vehicle = {
        "quad_mass_kg": truth.quad_mass,
        "load_mass_kg": truth.load_mass,
        "cable_length_m": truth.cable_length,
        "rotor_tau_ms": truth.rotor_tau * 1e3,
    }
    return ParameterTable(definitions().definitions(vehicle))


def apply(truth: Truth, table: ParameterTable) -> Truth:
    """`truth` with what the table says of the plant itself."""
    drag = table["SIM_DRAG_SCALE"]
    failing, left = int(table["SIM_ENGINE_FAIL"]), table["SIM_ENGINE_MUL"]
    one, two, three, four = (left if failing >> bit & 1 else 1.0 for bit in range(4))
    return truth._replace(
        quad_mass=table["SIM_QUAD_MASS"],
        load_mass=table["SIM_LOAD_MASS"],
        cable_length=table["SIM_CABLE_LEN"],
        rotor_tau=table["SIM_ROTOR_TAU_MS"] * 1e-3,
        rotor_share=(one, two, three, four),
        quad_drag=truth.quad_drag * drag,
        quad_drag_quadratic=truth.quad_drag_quadratic * drag,
        spin_drag=truth.spin_drag * drag,
        load_drag=truth.load_drag * drag,
        load_drag_quadratic=truth.load_drag_quadratic * drag,
    )
