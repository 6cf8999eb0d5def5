"""What really flies: the plant's record of a vehicle, and the SIM_ parameters that change it."""

from __future__ import annotations

import math

import pytest

from autopilot.wire.parameter_table import ParameterError
from sitl.plant.records import Truth
from sitl.vehicles.sim_parameters import apply, sim_parameters
from sitl.vehicles.truth import KEYS


def test_bebop_is_table_4_1(bebop):
    assert (bebop.quad_mass, bebop.arm, bebop.load_mass, bebop.cable_length) == (0.4, 0.126, 0.1, 0.7)
    assert bebop.inertia == (2.23e-3, 2.99e-3, 4.8e-3)
    assert (bebop.rotor_min, bebop.rotor_max, bebop.rotor_tau) == (0.0, 1.96, 0.020)


def test_bebop_tops_out_at_the_speed_of_table_4_2(bebop):
    """13 m/s at 30 deg of tilt, without the load."""
    drag = (bebop.quad_drag + bebop.quad_drag_quadratic * 13.0) * 13.0
    assert drag == pytest.approx(bebop.quad_mass * bebop.gravity * math.tan(math.radians(30.0)), rel=0.05)


def test_thesis_is_bebop_without_limits_lag_and_drag(bebop, thesis):
    assert (thesis.rotor_min, thesis.rotor_max, thesis.rotor_tau) == (-math.inf, math.inf, 0.0)
    assert thesis == bebop._replace(
        rotor_min=-math.inf,
        rotor_max=math.inf,
        rotor_tau=0.0,
        quad_drag=0.0,
        quad_drag_quadratic=0.0,
        spin_drag=0.0,
        load_drag=0.0,
        load_drag_quadratic=0.0,
    )


def test_parameters_start_from_the_truth(bebop, thesis):
    for truth, tau in ((bebop, 20.0), (thesis, 0.0)):
        table = sim_parameters(truth)
        assert table["SIM_ROTOR_TAU_MS"] == tau
        assert apply(truth, table) == truth


def test_parameters_change_the_truth(bebop):
    table = sim_parameters(bebop)
    for name, value in {
        "SIM_LOAD_MASS": 0.15,
        "SIM_QUAD_MASS": 0.5,
        "SIM_CABLE_LEN": 1.0,
        "SIM_ROTOR_TAU_MS": 35.0,
        "SIM_DRAG_SCALE": 0.0,
    }.items():
        table.set(name, value)
    truth = apply(bebop, table)
    assert (truth.load_mass, truth.quad_mass, truth.cable_length, truth.rotor_tau) == (0.15, 0.5, 1.0, 0.035)
    assert truth.quad_drag == truth.quad_drag_quadratic == truth.spin_drag == truth.load_drag_quadratic == 0.0


def test_names_kept(bebop):
    required = {
        "SIM_ACT_DELAY_MS": 0.0,
        "SIM_ROTOR_TAU_MS": 20.0,
        "SIM_NOISE_SCALE": 1.0,
        "SIM_SENS_LAT_MS": 0.0,
        "SIM_LOAD_MASS": 0.1,
        "SIM_CABLE_LEN": 0.7,
        "SIM_WIND_E": 0.0,
        "SIM_WIND_N": 0.0,
        "SIM_WIND_U": 0.0,
        "SIM_RATE_HZ": 250.0,
    }
    values = sim_parameters(bebop).values()
    assert {name: values[name] for name in required} == required


def test_parameter_out_of_range(bebop):
    with pytest.raises(ParameterError, match="SIM_LOAD_MASS"):
        sim_parameters(bebop).set("SIM_LOAD_MASS", -0.1)


def test_every_number_of_the_plant_is_one_key_of_the_file():
    assert set(Truth._fields) - KEYS.keys() == Truth._field_defaults.keys()
    assert len(set(KEYS.values())) == len(KEYS)
    assert KEYS["quad_drag"] == "quad_drag_n_s_m"  # and not the quadratic one
