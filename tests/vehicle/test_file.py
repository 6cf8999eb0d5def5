"""Vehicle files: what is read, what is refused and with which message, the same for every program."""

from __future__ import annotations

import math
import tomllib
from importlib.resources import files

import pytest

from autopilot.vehicle.file import belief_of, load_belief, load_truth_and_belief, load_vehicle
from autopilot.vehicle.layout import PLUS
from autopilot.vehicle.model import ARM_RATIOS, Vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.vehicle.shipped import VEHICLES, VehicleFileError
from gcs.workflows.vehicle_limits import load_limits
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import AIR_KEYS, CHAIN_KEYS, DRIVE_KEYS, truth_of

BEBOP = files("autopilot.vehicle").joinpath("vehicles", "bebop.toml").read_text(encoding="utf-8")
# a file with only the keys that the autopilot needs: all that it leaves out has a default
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
    assert VEHICLES.names() == (
        *("bebop", "bebop-real", "heavy", "heavy-real", "hexarotor", "iris", "octorotor", "thesis"),
    )
    for name in VEHICLES.names():
        assert load_vehicle(name).name == name


# what a shipped vehicle leaves to its default: its cable has no links
CABLE_OF_LINKS = {key: Vehicle.model_fields[key].default for key in CHAIN_KEYS.values()}
# what no vehicle has unless its file says so
EFFECTS = {
    **dict.fromkeys(("rotor_drag_1_s", "rotor_flap_rad_s_m", "blade_stiffness_n_m_rad"), 0.0),
    **dict.fromkeys(("ground_effect", "downwash", "cable_diameter_m", "esc_steps"), 0.0),
    **dict.fromkeys(("thrust_curve", "thrust_curve_known"), 0.0),
    **{"attachment_m": [0.0, 0.0, 0.0], "air_density_kg_m3": 1.225, "esc_speed_controlled": False},
    **{"battery": False, "battery_cells": 3, "battery_capacity_mah": 1200.0, "battery_charge": 1.0},
    **{"battery_resistance_ohm": 0.06, "battery_hover_w": 65.0},
}
CENTRED = {"imu_position_m": [0.0, 0.0, 0.0], "antenna_position_m": [0.0, 0.0, 0.0]}  # no file has others


def shipped(name):
    """The keys of a shipped file, as they are written."""
    text = files("autopilot.vehicle").joinpath("vehicles", f"{name}.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@pytest.mark.parametrize("name", VEHICLES.names())
def test_a_shipped_file_states_every_key_and_is_read_as_written(name):
    """A shipped file leaves the arrangement of the rotors and effects that it lacks to their defaults, no
    more."""
    table = shipped(name)
    if "believed" in table:
        table = {**shipped(table["believed"]), **table}
        assert EFFECTS.keys() - {"air_density_kg_m3", "rotor_radius_m"} <= table.keys()
    read = load_vehicle(name).model_dump()
    assert {key: list(v) if isinstance(v, tuple) else v for key, v in read.items()} == {
        **{"rotors": 4, "frame": "plus", "spin": "", "rotor": [], "believed": "", "parameters": {}},
        **EFFECTS,
        **CENTRED,
        "rotor_radius_m": ARM_RATIOS["rotor_radius_m"] * table["arm_m"],
        **CABLE_OF_LINKS,
        **table,
    }


@pytest.mark.parametrize("name", VEHICLES.names())
def test_a_vehicle_written_out_is_read_back(name, tmp_path):
    vehicle = load_vehicle(name)

    def toml(value):
        if isinstance(value, tuple):
            return str(list(value))
        if isinstance(value, bool):
            return str(value).lower()
        if isinstance(value, dict):
            return f"{{{', '.join(f'{key} = {number}' for key, number in value.items())}}}"
        return f'"{value}"' if isinstance(value, str) else str(value)

    text = "\n".join(f"{key} = {toml(value)}" for key, value in vehicle.model_dump().items())
    assert loaded(tmp_path, text) == vehicle


def test_what_may_be_left_out_has_its_default(tmp_path):
    vehicle = loaded(tmp_path, LEAST)
    assert (vehicle.name, vehicle.rotors, vehicle.rotor_tau_s, vehicle.load_radius_m) == ("foo", 4, 0.0, 0.02)
    drags = {
        key: value
        for key, value in vehicle.model_dump().items()
        if "_drag_" in key and key not in CHAIN_KEYS.values()
    }
    assert len(drags) == 6
    assert set(drags.values()) == {0.0}
    for key, share in ARM_RATIOS.items():
        assert getattr(vehicle, key) == share * 0.2


@pytest.mark.parametrize("key", [line.split(" ")[0] for line in LEAST.strip().splitlines()])
def test_what_must_be_there_is_missed(key, tmp_path):
    kept = "\n".join(line for line in LEAST.splitlines() if not line.startswith(f"{key} "))
    with pytest.raises(VehicleFileError) as caught:
        loaded(tmp_path, kept)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{tmp_path / 'foo.toml'}: {key} is missing (")


# (text in the file, its replacement, the message)
AT_LAST = "slip_rate_1_s = 500.0\n"


def rotors(*places):
    """Tables of rotors at these positions, with alternating spins."""
    return "".join(
        f'[[rotor]]\nx_m = {x}\ny_m = {y}\nspin = "{"+-"[i % 2]}"\n' for i, (x, y) in enumerate(places)
    )


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
        "inertia_kg_m2 = [0.00223, 0.00299, 0.048]; each must be <= the sum of the other two, or no body has "
        "it; check their order, about the forward, left and upward axis, and that all are in kg m^2",
    ),
    (
        "[2.23e-3, 2.99e-3, 4.8e-3]",
        "[2.23, 2.99, 4.8]",
        "inertia_kg_m2 = [2.23, 2.99, 4.8]; a body of 0.4 kg within 0.2 m has 0.016 at most; check that all "
        "are in kg m^2, quad_mass_kg, and arm_m",
    ),
    (
        "[2.23e-3, 2.99e-3, 4.8e-3]",
        "[[2.23e-3, 0.0, 0.0], [0.0, 2.99e-3, 0.0], [0.0, 0.0, 4.8e-3]]",
        "inertia_kg_m2 = [[0.00223, 0.0, 0.0], [0.0, 0.00299, ...; must be three numbers; of a matrix give "
        "the diagonal, in axes in which the rest is 0 (moments of",
    ),
    ("friction = 0.6", "battery = 1", "battery = 1; must be true or false"),
    ("friction = 0.6", "friction = 9.0", "friction = 9.0; must be >= 0 and <= 5"),
    ("slip_rate_1_s = 500.0", "slip_rate_1_s = 0.0", "slip_rate_1_s = 0.0; must be >= 0.001 and <= 600"),
    ("rotor_tau_s = 0.020", "rotor_tau_s = -0.01", "rotor_tau_s = -0.01; must be >= 0 and <= 1"),
    ('name = "bebop"', "name = 3", "name = 3; must be a text in quotes"),
    ('name = "bebop"', "rotors = 3", "rotors = 3; must be >= 4 and <= 14 (number of rotors)"),
    ('name = "bebop"', "rotors = 15", "rotors = 15; must be >= 4 and <= 14 (number of rotors)"),
    ('name = "bebop"', "rotors = 6.0", "rotors = 6.0; must be a whole number (number of rotors)"),
    ('name = "bebop"', 'frame = "h"', 'frame = "h"; must be "plus" or "x"'),
    ('name = "bebop"', 'spin = "+-+"', 'spin = "+-+"; must be 4 signs + or -, one a rotor'),
    ('name = "bebop"', 'spin = "+-cw"', 'spin = "+-cw"; must be 4 signs + or -, one a rotor'),
    ('name = "bebop"', "spin = 4", "spin = 4; must be a text in quotes"),
    (
        'name = "bebop"',
        'spin = "++++"',
        "rotor places and spins: the vehicle cannot be held level with these",
    ),
    (
        AT_LAST,
        AT_LAST + rotors((1, 1), (1, -1), (-1, 1)),
        "rotor: there must be 4 ... 14 tables [[rotor]], not 3",
    ),
    (
        AT_LAST,
        AT_LAST + rotors((0.1, 0.1), (0.1, 0.2), (0.2, 0.1), (0.2, 0.2)),
        "rotor places and spins: the vehicle cannot be held level with these",
    ),
    (AT_LAST, AT_LAST + "esc_steps = 1.5\n", "esc_steps = 1.5; must be a whole number"),
    (AT_LAST, AT_LAST + rotors((9, 1)), "rotor[0].x_m = 9; must be >= -5 and <= 5"),
    (AT_LAST, AT_LAST + "[[rotor]]\nx_m = 1\ny_m = 1\n", "rotor[0].spin is missing"),
    (AT_LAST, AT_LAST + '[[rotor]]\nx = 1\ny_m = 1\nspin = "+"\n', "rotor[0].x: unknown key; write x_m"),
    (
        AT_LAST,
        AT_LAST + '[[rotor]]\nx_m = 1\ny_m = 1\nspin = "ccw"\n',
        'rotor[0].spin = "ccw"; must be "+" or "-"',
    ),
    (
        'name = "bebop"',
        "rotors = 6\nrotor = [" + ", ".join(4 * ['{x_m = 1, y_m = 1, spin = "+"}']) + "]",
        "rotors: leave it out, because [[rotor]] says where each rotor is",
    ),
    ("load_mass_kg", "load_mas_kg", "load_mas_kg: unknown key; write load_mass_kg (in kilograms)"),
    (
        "quad_drag_n_s_m",
        "quad_drag",
        "quad_drag: unknown key; write quad_drag_n_s_m (in newtons per metre per",
    ),
    ('name = "bebop"', "wings = 2", f"wings: unknown key; allowed: {KNOWN}"),
    ('name = "bebop"', 'nme = "mine"', "nme: unknown key; write name"),
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
        "unknown vehicle 'bepop'; did you mean bebop? shipped: bebop, bebop-real, heavy, heavy-real, "
        "hexarotor, iris, octorotor, thesis; or the path of a file"
    )
    with pytest.raises(VehicleFileError, match="is a folder; must be a file"):
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
    assert len(numbers) == 48
    low, high = forces
    if high == math.inf:
        numbers = {**numbers, "esc_steps": 0.0}
    if inertia < 1.0:  # of a small body, whose feet are near
        numbers = {**numbers, "gear_height_m": 0.001, "gear_spread_m": 0.001}
        numbers["quad_mass_kg"] = min(numbers["quad_mass_kg"], 1.0)
        numbers["rotor_reach_m"] = max(numbers["rotor_reach_m"], 0.1)
    else:  # of a large one
        numbers["quad_mass_kg"] = max(numbers["quad_mass_kg"], 1.0)
        numbers["rotor_reach_m"] = 10.0
    vehicle = Vehicle(**numbers, rotor_min_n=low, rotor_max_n=high, inertia_kg_m2=(inertia,) * 3)
    believed = autopilot_parameters(vehicle)
    assert believed["VEH_QUAD_MASS"] == vehicle.quad_mass_kg
    assert believed["VEH_ROTOR_LIM"] == float(high < math.inf)
    assert sim_parameters(truth_of(vehicle))["SIM_QUAD_MASS"] == vehicle.quad_mass_kg


def test_every_field_of_the_truth_is_the_key_that_begins_with_its_name():
    beside = ("name", "believed", "parameters", "rotors", "frame", "spin", "rotor", "inertia_kg_m2")
    places = ("attachment_m", "imu_position_m", "antenna_position_m")
    elsewhere = {*places, *AIR_KEYS.values(), *DRIVE_KEYS.values(), *CHAIN_KEYS.values()}
    keys = [key for key in Vehicle.model_fields if key not in beside and key not in elsewhere]
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


def test_every_field_of_the_cable_of_links_is_a_key():
    numbers = {key: float(place) for place, key in enumerate(CHAIN_KEYS.values())}  # all different
    chain = truth_of(load_vehicle("heavy").model_copy(update=numbers)).chain
    assert chain._fields == tuple(CHAIN_KEYS)
    assert chain == tuple(numbers.values())


def test_a_hook_below_the_middle_of_the_cable_is_refused(tmp_path):
    assert loaded(tmp_path, BEBOP + "load_hook_m = 0.35\n").load_hook_m == 0.35
    with pytest.raises(VehicleFileError, match=r"load_hook_m = 0\.36; must be <= half"):
        loaded(tmp_path, BEBOP + "load_hook_m = 0.36\n")


def test_rotors_at_any_places_are_flown_as_they_are_given(tmp_path):
    """The vehicle is the same as with its named frame; and each number of a rotor reaches its layout."""
    a = 0.126 * 0.5**0.5
    listed = loaded(tmp_path, BEBOP + rotors((-a, a), (-a, -a), (a, -a), (a, a)))
    named = loaded(tmp_path, 'frame = "x"\nspin = "+-+-"\n' + BEBOP)
    for one, other in zip(listed.layout, named.layout, strict=True):
        assert one == pytest.approx(other, abs=1e-9)
    own = "thrust_factor = 0.5\ntorque_factor = 2.0\nlag_factor = 3.0\n"
    last = loaded(tmp_path, BEBOP + rotors((-a, a), (-a, -a), (a, -a), (a, a)) + own).layout[-1]
    assert last == pytest.approx((a / 0.126, a / 0.126, -2.0, 0.5, 3.0))


def test_a_plus_quadrotor_is_that_of_2_13():
    assert load_vehicle("bebop").layout == PLUS


def test_a_truth_beside_a_belief_is_flown_and_not_believed(tmp_path):
    """What the truth leaves out is as in the belief, which the autopilot uses: a name, or a file beside
    it."""
    (tmp_path / "believed.toml").write_text(BEBOP.replace("quad_mass_kg = 0.4", "quad_mass_kg = 0.5"))
    truth = loaded(tmp_path, 'believed = "believed.toml"\nrotor_drag_1_s = 0.3\n')
    assert (truth.quad_mass_kg, truth.rotor_drag_1_s, truth.name) == (0.5, 0.3, "foo")
    assert load_belief(tmp_path / "foo.toml").rotor_drag_1_s == 0.0
    assert load_belief(tmp_path / "believed.toml") == load_vehicle(tmp_path / "believed.toml")
    named = loaded(tmp_path, 'believed = "bebop"\nquad_mass_kg = 0.45\n')
    assert (named.quad_mass_kg, named.load_mass_kg) == (0.45, 0.1)
    assert load_belief(tmp_path / "foo.toml") == load_vehicle("bebop")
    assert belief_of("heavy-real") == "heavy"
    assert belief_of("heavy") == "heavy"


def test_a_key_that_the_belief_has_is_suggested_too(tmp_path):
    with pytest.raises(VehicleFileError, match="load_mas_kg: unknown key; write load_mass_kg"):
        loaded(tmp_path, 'believed = "bebop"\nload_mas_kg = 0.2\n')


def test_a_vehicle_is_delivered_with_parameters(tmp_path):
    """Its own parameters come before those of its belief; all others have their usual values."""
    (tmp_path / "believed.toml").write_text(BEBOP + "[parameters]\nMIS_SPEED = 2.0\nMIS_ACCEL = 0.5\n")
    truth = loaded(tmp_path, 'believed = "believed.toml"\n[parameters]\nMIS_SPEED = 1\n')
    assert truth.parameters == {"MIS_SPEED": 1.0}
    belief = load_belief(tmp_path / "foo.toml")
    table = autopilot_parameters(belief)
    usual = autopilot_parameters(load_vehicle("bebop"))
    assert (table["MIS_SPEED"], table["MIS_ACCEL"]) == (1.0, 0.5)
    assert table.describe("MIS_SPEED").default == 1.0, "which a report does not call changed"
    others = [name for name in usual.values() if name not in ("MIS_SPEED", "MIS_ACCEL")]
    assert [table[name] for name in others] == [usual[name] for name in others]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("MIS_SPEED = 99.0", "parameters.MIS_SPEED = 99.0 m/s; must be 0.05 ... 15"),
        ("MIS_INFEASIBLE = 0.5", "parameters.MIS_INFEASIBLE = 0.5; must be a whole number"),
        ('MIS_SPEED = "fast"', 'parameters.MIS_SPEED = "fast"; must be a number'),
        ("VEH_QUAD_MASS = 0.5", "parameters.VEH_QUAD_MASS: is quad_mass_kg; write that key instead"),
        ("SIM_WIND_E = 1.0", "parameters.SIM_WIND_E: is the simulator's, and these are"),
    ],
)
def test_a_parameter_that_cannot_be_delivered_is_told(tmp_path, line, told):
    with pytest.raises(VehicleFileError) as error:
        loaded(tmp_path, f"{BEBOP}[parameters]\n{line}\n")
    (problem,) = error.value.problems
    assert told in problem


def test_the_load_must_be_able_to_lie_beside_a_vehicle_that_stands(tmp_path):
    """The sizes of the gear are shares of the arm: 1.4 m high, on a cable of 0.7 m."""
    lines = (line for line in BEBOP.splitlines() if not line.startswith(("gear_", "rotor_reach")))
    tall = "\n".join(lines).replace("arm_m = 0.126", "arm_m = 2.8")
    with pytest.raises(VehicleFileError, match=r"cable_length_m = 0\.7; must be >= 1\.59"):
        loaded(tmp_path, tall)
    longer = tall.replace("cable_length_m = 0.7", "cable_length_m = 1.6")
    with pytest.raises(VehicleFileError, match=r"inertia_kg_m2 = .* each must be >= 0\.0153"):
        loaded(tmp_path, longer)
    heavier = longer.replace("[2.23e-3, 2.99e-3, 4.8e-3]", "[0.02, 0.02, 0.03]")
    assert loaded(tmp_path, heavier).gear_height_m == pytest.approx(1.4)


WRONG_BELIEFS = [
    ('believed = "bepop"', "unknown vehicle 'bepop'; did you mean bebop?"),
    (
        'believed = "bebop-real"',
        "believed: autopilot/vehicle/vehicles/bebop-real.toml has a `believed` of its own",
    ),
    ('believed = "mine.toml"', "mine.toml: no such file"),
    ("believed = 3", "believed = 3; must be a text in quotes"),
]


@pytest.mark.parametrize(("line", "said"), WRONG_BELIEFS)
def test_a_belief_that_is_none_is_told(tmp_path, line, said):
    with pytest.raises(VehicleFileError) as caught:
        loaded(tmp_path, BEBOP + line + "\n")
    assert said in str(caught.value)


def test_what_becomes_of_a_share_of_the_greatest_force_wants_one(tmp_path):
    for line in ("battery = true", "esc_steps = 100.0", "thrust_curve = 0.5"):
        said = broken(tmp_path, "rotor_max_n = 1.96", f"rotor_max_n = inf\n{line}")
        assert said.startswith("rotor_max_n = inf; must be finite"), line


def test_a_battery_needs_its_numbers(tmp_path):
    said = broken(tmp_path, "rotor_max_n = 1.96", "rotor_max_n = 1.96\nbattery = true\nbattery_cells = 4")
    assert said == (
        "battery = true; needs battery_capacity_mah, battery_resistance_ohm, battery_hover_w too "
        "(their defaults are those of a Bebop, 0.4 kg)"
    )


def test_the_battery_of_the_believed_vehicle_is_that_of_its_truth(tmp_path):
    (tmp_path / "own.toml").write_text(
        BEBOP
        + "battery = true\nbattery_cells = 4\nbattery_capacity_mah = 900.0\n"
        + "battery_resistance_ohm = 0.03\nbattery_hover_w = 90.0\n"
    )
    assert loaded(tmp_path, 'believed = "own.toml"\nbattery_charge = 0.5\n').battery_hover_w == 90.0


@pytest.mark.parametrize(("name", "named"), [("heavy", ["heavy"]), ("heavy-real", ["heavy-real", "heavy"])])
def test_truth_and_belief_are_those_of_two_calls_and_each_file_is_read_once(monkeypatch, name, named):
    expected = (load_vehicle(name), load_belief(name))
    read, real = [], type(VEHICLES).read

    def counted(self, name_or_path):
        read.append(name_or_path)
        return real(self, name_or_path)

    monkeypatch.setattr(type(VEHICLES), "read", counted)
    assert load_truth_and_belief(name) == expected
    assert read == named
    read.clear()
    load_limits(name)
    assert read == named
