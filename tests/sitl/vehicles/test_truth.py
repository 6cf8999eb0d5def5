"""The simulated vehicle: the plant's record of a vehicle, and the SIM_ parameters that change it."""

from __future__ import annotations

import math

import pytest

from autopilot.wire.parameter_table import ParameterError
from sitl.plant.records import Air, Drive, Truth
from sitl.vehicles.sim_parameters import apply, sim_parameters
from sitl.vehicles.truth import AIR_KEYS, DRIVE_KEYS, KEYS, load_truth


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
    never_told = {"air", "drive", "chain", "supply", "reel_rate", "reel_accel"}
    assert set(Truth._fields) - KEYS.keys() == never_told
    assert (AIR_KEYS.keys(), DRIVE_KEYS.keys()) == (set(Air._fields), set(Drive._fields))
    keys = [*KEYS.values(), *AIR_KEYS.values(), *DRIVE_KEYS.values()]
    assert len(set(keys)) == len(keys)
    assert KEYS["quad_drag"] == "quad_drag_n_s_m"  # and not the quadratic one


EFFECTS = {
    "SIM_ROTOR_DRAG": (0.4, lambda t: t.air.rotor_drag),
    "SIM_ROTOR_FLAP": (0.02, lambda t: t.air.rotor_flap),
    "SIM_BLADE_STIFF": (0.3, lambda t: t.air.blade_stiffness),
    "SIM_GND_EFFECT": (1.5, lambda t: t.air.ground_effect),
    "SIM_DOWNWASH": (0.5, lambda t: t.air.downwash),
    "SIM_CABLE_DIAM": (2.0, lambda t: 1e3 * t.air.cable_diameter),
    "SIM_ATT_X": (0.01, lambda t: t.attachment[0]),
    "SIM_ATT_Y": (-0.02, lambda t: t.attachment[1]),
    "SIM_ATT_Z": (-0.03, lambda t: t.attachment[2]),
    "SIM_IMU_POS_X": (0.04, lambda t: t.imu_position[0]),
    "SIM_IMU_POS_Y": (-0.05, lambda t: t.imu_position[1]),
    "SIM_IMU_POS_Z": (0.06, lambda t: t.imu_position[2]),
    "SIM_GPS_POS_X": (-0.1, lambda t: t.antenna_position[0]),
    "SIM_GPS_POS_Y": (0.2, lambda t: t.antenna_position[1]),
    "SIM_GPS_POS_Z": (0.3, lambda t: t.antenna_position[2]),
    "SIM_THR_CURVE": (0.8, lambda t: t.drive.thrust_curve),
    "SIM_THR_KNOWN": (0.7, lambda t: t.drive.known_curve),
    "SIM_ESC_STEPS": (500.0, lambda t: t.drive.esc_steps),
    "SIM_ESC_RPM_CTL": (1.0, lambda t: t.drive.speed_controlled),
    "SIM_BATTERY": (1.0, lambda t: t.drive.battery),
    "SIM_BAT_CELLS": (6.0, lambda t: t.drive.cells),
    "SIM_BAT_CAP": (2000.0, lambda t: t.drive.capacity_as / 3.6),
    "SIM_BAT_R": (0.02, lambda t: t.drive.resistance),
    "SIM_BAT_HOVER_W": (120.0, lambda t: t.drive.hover_w),
    "SIM_BAT_CHARGE": (70.0, lambda t: 1e2 * t.drive.charge),
}


@pytest.mark.parametrize("name", EFFECTS)
def test_each_effect_is_reached_by_one_parameter(bebop, name):
    value, read = EFFECTS[name]
    table = sim_parameters(bebop)
    table.set(name, value)
    changed = apply(bebop, table)
    assert read(changed) == pytest.approx(value, rel=1e-12)
    table.set(name, table.describe(name).default)
    assert apply(bebop, table) == bebop


def test_a_count_is_a_whole_number(bebop):
    table = sim_parameters(bebop)
    for name in ("SIM_ESC_STEPS", "SIM_CBL_LINKS", "SIM_BAT_CELLS"):
        with pytest.raises(ParameterError, match=f"{name} = 1.5; must be a whole number"):
            table.set(name, 1.5)


@pytest.mark.parametrize("name", ["bebop-real", "heavy-real"])
def test_parameters_start_from_what_a_real_vehicle_has(name):
    """Except for the rounding of capacity and charge. Its sensors sit at the centre of mass."""
    truth = load_truth(name)
    table = sim_parameters(truth)
    assert all(table[effect] == pytest.approx(read(truth)) for effect, (_, read) in EFFECTS.items())
    absent = {"SIM_ESC_RPM_CTL", *(effect for effect in EFFECTS if "_POS_" in effect)}
    assert all(table[effect] != 0.0 for effect in EFFECTS if effect not in absent)
