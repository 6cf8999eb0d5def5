"""Vehicle files: what is read, what is refused and in which words, the same for every program."""

from __future__ import annotations

import math
import tomllib
from importlib.resources import files

import pytest

from autopilot.vehicle.file import VEHICLES, VehicleFileError, load_vehicle
from autopilot.vehicle.model import SHARE_OF_ARM, Vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import truth_of

BEBOP = files("autopilot.vehicle").joinpath("vehicles", "bebop.toml").read_text(encoding="utf-8")
# a file of which the autopilot alone needs something: what it may leave out has a default
LEAST = """
quad_mass_kg = 1.0
load_mass_kg = 0.2
cable_length_m = 1.0
arm_m = 0.2
inertia_kg_m2 = [0.01, 0.01, 0.02]
gravity_m_s2 = 9.81
rotor_min_n = 0.0
rotor_max_n = 6.0
torque_ratio_m = 0.02
"""
KNOWN = ", ".join(Vehicle.model_fields)


def loaded(tmp_path, text):
    path = tmp_path / "foo.toml"
    path.write_text(text)
    return load_vehicle(path)


def broken(tmp_path, old, new):
    assert old in BEBOP
    with pytest.raises(VehicleFileError) as caught:
        loaded(tmp_path, BEBOP.replace(old, new))
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"{tmp_path / 'foo.toml'}:")
    return text.removeprefix(f"{tmp_path / 'foo.toml'}:").lstrip()


def test_the_shipped_vehicles_are_the_files_of_the_folder():
    assert VEHICLES.names() == ("bebop", "heavy", "thesis")
    for name in VEHICLES.names():
        assert load_vehicle(name).name == name


@pytest.mark.parametrize("name", VEHICLES.names())
def test_a_shipped_file_states_every_key_and_is_read_as_written(name):
    """Nothing of a shipped vehicle is left to a default but the number of rotors."""
    text = files("autopilot.vehicle").joinpath("vehicles", f"{name}.toml").read_text(encoding="utf-8")
    table = tomllib.loads(text)
    read = load_vehicle(name).model_dump()
    assert {key: list(v) if isinstance(v, tuple) else v for key, v in read.items()} == {"rotors": 4, **table}


@pytest.mark.parametrize("name", VEHICLES.names())
def test_a_vehicle_written_out_is_read_back(name, tmp_path):
    vehicle = load_vehicle(name)

    def toml(value):
        if isinstance(value, tuple):
            return str(list(value))
        return f'"{value}"' if isinstance(value, str) else str(value)

    text = "\n".join(f"{key} = {toml(value)}" for key, value in vehicle.model_dump().items())
    assert loaded(tmp_path, text) == vehicle


def test_what_may_be_left_out_has_its_default(tmp_path):
    vehicle = loaded(tmp_path, LEAST)
    assert (vehicle.name, vehicle.rotors, vehicle.rotor_tau_s, vehicle.load_radius_m) == ("foo", 4, 0.0, 0.02)
    drags = {key: value for key, value in vehicle.model_dump().items() if "_drag_" in key}
    assert len(drags) == 5
    assert set(drags.values()) == {0.0}
    for key, share in SHARE_OF_ARM.items():
        assert getattr(vehicle, key) == share * 0.2


@pytest.mark.parametrize("key", [line.split(" ")[0] for line in LEAST.strip().splitlines()])
def test_what_must_be_there_is_missed(key, tmp_path):
    kept = "\n".join(line for line in LEAST.splitlines() if not line.startswith(f"{key} "))
    with pytest.raises(VehicleFileError) as caught:
        loaded(tmp_path, kept)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{tmp_path / 'foo.toml'}: {key} is missing (")


# (what stands in the file, what is put in its place, what is said)
BROKEN = [
    (
        "load_mass_kg = 0.1",
        "load_mass_kg = -5",
        "load_mass_kg = -5; must be >= 0.001 and <= 100 (mass of the load)",
    ),
    (
        "load_mass_kg = 0.1",
        "load_mass_kg = nan",
        "load_mass_kg = nan; must be a finite number (mass of the load)",
    ),
    (
        "load_mass_kg = 0.1",
        "load_mass_kg = inf",
        "load_mass_kg = inf; must be a finite number (mass of the load)",
    ),
    (
        "load_mass_kg = 0.1",
        "load_mass_kg = 'light'",
        'load_mass_kg = "light"; must be a number (mass of the load)',
    ),
    ("load_mass_kg = 0.1", "load_mass_kg = true", "load_mass_kg = true; must be a number (mass of the load)"),
    ("load_mass_kg = 0.1", "", "load_mass_kg is missing (mass of the load)"),
    (
        "rotor_max_n = 1.96",
        "rotor_max_n = 0.0",
        "rotor_max_n = 0.0; must be 0.01 ... 1000, or inf for no limit",
    ),
    (
        "rotor_max_n = 1.96",
        "rotor_max_n = nan",
        "rotor_max_n = nan; must be 0.01 ... 1000, or inf for no limit",
    ),
    (
        "rotor_min_n = 0.0",
        "rotor_min_n = nan",
        "rotor_min_n = nan; must be -1000 ... 1000, or -inf for no limit",
    ),
    ("rotor_min_n = 0.0", "rotor_min_n = 2", "rotor_max_n = 1.96; must be > rotor_min_n = 2"),
    (
        "rotor_min_n = 0.0",
        "rotor_min_n = -inf",
        "rotor_min_n = -inf; must be finite because rotor_max_n = 1.96 is",
    ),
    ("[2.23e-3, 2.99e-3, 4.8e-3]", "[2.23e-3, -1.0, 4.8e-3]", "inertia_kg_m2[1] = -1.0; must be >= 1e-06"),
    ("[2.23e-3, 2.99e-3, 4.8e-3]", "[2.23e-3, 2.99e-3]", "inertia_kg_m2[2] is missing"),
    ("[2.23e-3, 2.99e-3, 4.8e-3]", "4.8e-3", "inertia_kg_m2 = 0.0048; must be a list"),
    (
        "4.8e-3]",
        "4.8e-2]",
        "inertia_kg_m2 = [0.00223, 0.00299, 0.048]; each must be <= the sum of the other two",
    ),
    ("friction = 0.6", "friction = 9.0", "friction = 9.0; must be >= 0 and <= 5"),
    ("slip_rate_1_s = 500.0", "slip_rate_1_s = 0.0", "slip_rate_1_s = 0.0; must be >= 0.001 and <= 600"),
    ("rotor_tau_s = 0.020", "rotor_tau_s = -0.01", "rotor_tau_s = -0.01; must be >= 0 and <= 1"),
    ('name = "bebop"', "name = 3", "name = 3; must be a text in quotes"),
    (
        'name = "bebop"',
        "rotors = 6",
        "rotors = 6; must be 4 (number of rotors; only quadrotors can be flown)",
    ),
    ("load_mass_kg", "load_mas_kg", "load_mas_kg: unknown key; write load_mass_kg (in kilograms)"),
    (
        "quad_drag_n_s_m",
        "quad_drag",
        "quad_drag: unknown key; write quad_drag_n_s_m (in newtons per metre per",
    ),
    ('name = "bebop"', "wings = 2", f"wings: unknown key; allowed: {KNOWN}"),
    ("load_mass_kg = 0.1", "load_mass_kg = ", "7:16: not TOML: Invalid value"),
]


@pytest.mark.parametrize(("old", "new", "message"), BROKEN)
def test_one_line_says_what_is_wrong(tmp_path, old, new, message):
    assert broken(tmp_path, old, new).startswith(message)


def test_all_that_is_wrong_is_told_at_once(tmp_path):
    with pytest.raises(VehicleFileError) as caught:
        loaded(
            tmp_path, BEBOP.replace("arm_m = 0.126", "arm_m = 0").replace("friction = 0.6", "friction = 9")
        )
    assert [p.split(": ")[1].split(" = ")[0] for p in caught.value.problems] == ["arm_m", "friction"]


def test_unknown_names_and_files_that_cannot_be_read(tmp_path):
    with pytest.raises(VehicleFileError) as caught:
        load_vehicle("bepop")
    assert str(caught.value) == (
        "unknown vehicle 'bepop'; did you mean bebop? shipped: bebop, heavy, thesis; or the path of a file"
    )
    with pytest.raises(VehicleFileError, match="cannot be read: Is a directory"):
        load_vehicle(tmp_path)


def test_a_vehicle_cannot_be_made_out_of_its_ranges():
    with pytest.raises(ValueError, match="quad_mass_kg"):
        Vehicle(**{**load_vehicle("bebop").model_dump(), "quad_mass_kg": -1.0})


FORCES = [(-1000.0, 0.01), (-1000.0, 1000.0), (0.0, math.inf), (-math.inf, math.inf)]


def extremes(bound):
    """All numbers at the least ("ge") or greatest ("le") value of their range."""
    rules = ((key, rule) for key, field in Vehicle.model_fields.items() for rule in field.metadata)
    return {key: getattr(rule, bound) for key, rule in rules if hasattr(rule, bound)}


@pytest.mark.parametrize("numbers", [extremes("ge"), extremes("le")], ids=["least", "greatest"])
@pytest.mark.parametrize("forces", FORCES)
@pytest.mark.parametrize("inertia", [1e-6, 100.0])
def test_what_the_file_may_say_both_programs_can_take(numbers, forces, inertia):
    assert len(numbers) == 21
    low, high = forces
    vehicle = Vehicle(**numbers, rotor_min_n=low, rotor_max_n=high, inertia_kg_m2=(inertia,) * 3)
    believed = autopilot_parameters(vehicle)
    assert believed["VEH_QUAD_MASS"] == vehicle.quad_mass_kg
    assert believed["VEH_ROTOR_LIM"] == float(high < math.inf)
    assert sim_parameters(truth_of(vehicle))["SIM_QUAD_MASS"] == vehicle.quad_mass_kg


def test_every_field_of_the_truth_is_the_key_that_begins_with_its_name():
    keys = [key for key in Vehicle.model_fields if key not in ("name", "rotors", "inertia_kg_m2")]
    numbers = {key: float(place) for place, key in enumerate(keys)}  # all different
    vehicle = load_vehicle("heavy").model_copy(update=numbers)
    truth = truth_of(vehicle)
    given = [field for field in truth._fields if field not in truth._field_defaults]
    assert len(given) == len(keys) + 1
    for field in given:
        key = min(
            (key for key in Vehicle.model_fields if key.startswith(field + "_") or key == field), key=len
        )
        assert getattr(truth, field) == getattr(vehicle, key), field
