"""Truth files and the SIM_ parameters."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import sitl.vehicles
from autopilot.wire.parameter_table import ParameterError
from sitl.vehicles import TruthFileError, load_truth, shipped
from sitl.vehicles.sim_parameters import apply, sim_parameters

BEBOP = (Path(sitl.vehicles.__file__).parent / "bebop.toml").read_text()


def _broken(tmp_path, old, new):
    assert old in BEBOP
    path = tmp_path / "foo.toml"
    path.write_text(BEBOP.replace(old, new))
    with pytest.raises(TruthFileError) as caught:
        load_truth(path)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"{path}: ")
    return text.removeprefix(f"{path}: ")


def test_shipped_vehicles():
    assert shipped() == ("bebop", "heavy", "thesis")


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


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("load_mass_kg = 0.1", "load_mass_kg = -1", "load_mass_kg = -1; must be > 0"),
        ("load_mass_kg = 0.1", "load_mass_kg = nan", "load_mass_kg = nan; must be a finite number"),
        ("load_mass_kg = 0.1", "load_mass_kg = inf", "load_mass_kg = inf; must be a finite number"),
        ("load_mass_kg = 0.1", "load_mass_kg = 'light'", "load_mass_kg = 'light'; must be a valid number"),
        ("load_mass_kg = 0.1", "", "load_mass_kg is missing"),
        ("rotor_max_n = 1.96", "rotor_max_n = 0.0", "rotor_max_n = 0; must be > rotor_min_n = 0"),
        ("rotor_max_n = 1.96", "rotor_max_n = nan", "rotor_max_n = nan; must be > rotor_min_n = 0"),
        ("[2.23e-3, 2.99e-3, 4.8e-3]", "[2.23e-3, -1.0, 4.8e-3]", "inertia_kg_m2[1] = -1.0; must be > 0"),
        ("friction = 0.6", "friction = 9.0", "friction = 9.0; must be <= 5"),
        ("slip_rate_1_s = 500.0", "slip_rate_1_s = 0.0", "slip_rate_1_s = 0.0; must be > 0"),
    ],
)  # fmt: skip
def test_one_line_says_what_is_wrong(tmp_path, old, new, message):
    assert _broken(tmp_path, old, new) == message


def test_inertia_of_no_body(tmp_path):
    assert "sum of the other two" in _broken(tmp_path, "4.8e-3]", "4.8e-2]")


def test_unknown_key_lists_the_known(tmp_path):
    text = _broken(tmp_path, "load_mass_kg", "load_mas_kg")
    assert text.startswith("load_mass_kg is missing") or text.startswith("load_mas_kg: unknown key")


def test_broken_toml_and_missing_files(tmp_path):
    assert _broken(tmp_path, "load_mass_kg = 0.1", "load_mass_kg = ").startswith("not TOML: ")
    with pytest.raises(
        TruthFileError, match=r"nosuch: no such vehicle; must be bebop, heavy, thesis or the path"
    ):
        load_truth("nosuch")
    with pytest.raises(TruthFileError, match="cannot be read"):
        load_truth(tmp_path)


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
