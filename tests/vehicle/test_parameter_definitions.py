"""The autopilot's parameters: where defaults come from, and what importing the definitions costs."""

from __future__ import annotations

import subprocess
import sys

import pytest

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.parameters import (
    BENCH_MEASURED,
    DEFAULT_LAW,
    LAWS,
    SHAPE_ALWAYS,
    SHAPE_NEVER,
    SHAPE_WITH_PLUMBLINE,
    autopilot_parameters,
    definitions,
    vehicle_values,
)
from autopilot.vehicle.shipped import VEHICLES
from autopilot.wire.convert.simulator import ROTOR_FMAX
from sitl.vehicles.sim_parameters import definitions as sim_definitions
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import CHAIN_KEYS, load_truth


def test_the_laws_are_the_values_of_their_parameter():
    law = autopilot_parameters(load_vehicle("bebop")).describe("CTL_LAW")
    assert (law.low, law.high, law.integer, law.fixed) == (0.0, len(LAWS) - 1.0, True, True)
    assert LAWS[int(law.default)] == DEFAULT_LAW == "plumbline"
    assert law.text == "Control law: 0 thesis, 1 lqr, 2 plumbline"


def test_the_constants_of_shaping_are_its_values():
    named = definitions().parameters["MIS_SHAPE"].values
    assert named is not None
    never, with_plumbline, always = (named[str(n)] for n in (SHAPE_NEVER, SHAPE_WITH_PLUMBLINE, SHAPE_ALWAYS))
    assert (never, with_plumbline, always) == ("never", "with the law plumbline", "always")


@pytest.mark.parametrize("name", VEHICLES.names())
def test_the_numbers_of_the_vehicle_are_the_defaults(name):
    belief = load_vehicle(name)
    table = autopilot_parameters(belief)
    assert table["VEH_QUAD_MASS"] == belief.quad_mass_kg
    assert (table["VEH_J_XX"], table["VEH_J_YY"], table["VEH_J_ZZ"]) == belief.inertia_kg_m2
    assert table["VEH_ROTOR_TAU"] == 1e3 * belief.rotor_tau_s
    assert table["VEH_ROTOR_LIM"] == float(belief.limited)
    assert table["QP_KZ"] == pytest.approx(16.0 * belief.quad_mass_kg)
    truth = load_truth(name)
    # the estimator starts at the heights at which the plant lets vehicle and load rest
    assert (table["EST_GEAR_H"], table["EST_LOAD_H"]) == (belief.gear_height_m, belief.load_radius_m)
    world = sim_parameters(truth)
    assert world["SIM_QUAD_MASS"] == truth.quad_mass
    assert world.describe("SIM_QUAD_MASS").low == truth.quad_mass / 100.0
    assert world.describe("SIM_QUAD_MASS").high == truth.quad_mass * 100.0


# keys of a vehicle file that the autopilot does not use: names, and what only the plant knows
OF_THE_ROTORS = {
    "name",
    "believed",
    "parameters",
    "rotors",
    "frame",
    "spin",
    "rotor",
}  # not numbers, or given by `layout`
OF_THE_WORLD_ALONE = {
    *OF_THE_ROTORS,
    *("spin_drag_n_m_s2", "load_drag_n_s_m", "load_drag_quadratic_n_s2_m2"),
    *("gear_spread_m", "rotor_reach_m", "rotor_height_m"),
    *("contact_frequency_rad_s", "contact_damping_ratio", "friction", "slip_rate_1_s"),
    *CHAIN_KEYS.values(),
    *("rotor_radius_m", "air_density_kg_m3", "rotor_drag_1_s", "rotor_flap_rad_s_m"),
    *("blade_stiffness_n_m_rad", "ground_effect", "downwash", "cable_diameter_m"),
    *("thrust_curve", "thrust_curve_known", "esc_steps", "esc_speed_controlled"),
    *("battery", "battery_charge"),
}
BELIEVED = tuple(key for key in Vehicle.model_fields if key not in OF_THE_WORLD_ALONE)


@pytest.mark.parametrize("key", BELIEVED)
def test_every_number_of_the_vehicle_has_a_parameter(key):
    """A change of any assumed number changes a default; of three numbers, each does."""
    vehicle = load_vehicle("heavy")
    before = autopilot_parameters(vehicle).values()
    value = getattr(vehicle, key)
    if isinstance(value, tuple):
        moves = [
            tuple(1.5 * v + 1e-3 if i == k else v for i, v in enumerate(value)) for k in range(len(value))
        ]
    else:
        moves = [value + 1 if isinstance(value, int) else 1.5 * value + 1e-3]
    for moved in moves:
        assert autopilot_parameters(vehicle.model_copy(update={key: moved})).values() != before


def test_what_only_the_plant_knows_moves_no_parameter():
    vehicle = load_vehicle("heavy")
    numbers = {key: 1.5 * getattr(vehicle, key) + 1e-3 for key in OF_THE_WORLD_ALONE - OF_THE_ROTORS}
    moved = vehicle.model_copy(update=numbers)
    assert autopilot_parameters(moved).values() == autopilot_parameters(vehicle).values()


def test_every_number_that_is_taken_from_the_vehicle_is_a_default():
    taken = [spec.vehicle_keys for spec in definitions().parameters.values()]
    assert frozenset().union(*taken) == vehicle_values(load_vehicle("bebop")).keys()


def test_without_a_rotor_limit_the_forces_are_those_of_the_wire():
    table = autopilot_parameters(load_vehicle("thesis"))
    assert (table["VEH_ROTOR_LIM"], table["VEH_ROTOR_MIN"], table["VEH_ROTOR_MAX"]) == (0.0, 0.0, ROTOR_FMAX)


def test_what_is_measured_on_the_bench_has_a_parameter_on_either_side():
    assert BENCH_MEASURED.keys() <= sim_definitions().parameters.keys()
    assert set(BENCH_MEASURED.values()) <= definitions().parameters.keys()


def test_naming_the_laws_costs_no_heavy_import():
    """The options of the command line name the laws: its help has to appear immediately."""
    heavy = ("numpy", "numba", "pydantic", "autopilot.wire.dialect.plumbline")
    check = f"import sys, autopilot.vehicle.parameters; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
