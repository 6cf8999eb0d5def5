"""Inputs of a flight: gcs itself refuses wrong ones, and starts no process."""

from __future__ import annotations

import subprocess
from importlib.resources import files

import pytest
from click.testing import CliRunner

import plumbline
from autopilot.vehicle.shipped import VEHICLES
from gcs.cli import gcs
from gcs.errors import EXIT_DONE, EXIT_USAGE
from gcs.shell.processes import Processes
from gcs.workflows.flight_inputs import (
    check_flight_inputs,
    sensor_warnings,
    setting_warnings,
    vehicle_warnings,
)
from sitl.sensors.shipped import PROFILES

BEBOP = files("autopilot.vehicle").joinpath("vehicles", "bebop.toml").read_text(encoding="utf-8")
# what is wrong, the text of bebop.toml and its replacement, and the beginning of the message
WRONG_VEHICLES = [
    ("no masses", ("quad_mass_kg = 0.4", "# "), "quad_mass_kg is missing (mass of the vehicle without"),
    ("a negative mass", ("load_mass_kg = 0.1", "load_mass_kg = -5"), "load_mass_kg = -5; must be >= 0.001"),
    ("three rotors", ('name = "bebop"', "rotors = 3"), "rotors = 3; must be >= 4 and <= 14 (number of"),
]


@pytest.fixture(autouse=True)
def no_process(monkeypatch):
    """Starting a process fails; loading a program for a later start does nothing."""

    def refuse(*_args, **_kwargs):
        raise AssertionError("a process was started")

    monkeypatch.setattr(subprocess, "Popen", refuse)
    monkeypatch.setattr(Processes, "load", lambda processes, name: None)


def refused(*arguments, code=EXIT_USAGE):
    """The one line on stderr."""
    result = CliRunner().invoke(gcs, list(arguments), prog_name="gcs")
    assert result.exit_code == code, result.output
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    return line


@pytest.mark.parametrize("command", ["check", "fly", "upload"])
@pytest.mark.parametrize(
    ("change", "part"), [row[1:] for row in WRONG_VEHICLES], ids=[row[0] for row in WRONG_VEHICLES]
)
def test_a_vehicle_that_the_simulator_refuses_no_command_takes(command, change, part, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(BEBOP.replace(*change), encoding="utf-8")
    line = refused(command, "hover", "--vehicle", str(path))
    assert line.startswith(f"gcs: {path}: {part}")


RATES = {
    "CTL_RATE_HZ=333": "CTL_RATE_HZ = 333 Hz does not divide the sensor rate of 250 Hz; must be one of 250,",
    "SIM_RATE_HZ=100": "CTL_RATE_HZ = 250 Hz does not divide the sensor rate of 100 Hz; must be one of 100",
    "SIM_RATE_HZ=333": "SIM_RATE_HZ = 333 Hz; a tick must be a whole number of microseconds",
}


@pytest.mark.parametrize("setting", RATES)
def test_rates_that_do_not_divide_are_refused_with_those_that_do(setting, tmp_path):
    out = tmp_path / "out"
    assert refused("fly", "hover", "--set", setting, "--out", str(out)).startswith(
        f"gcs: --set {RATES[setting]}"
    )
    assert not out.exists()
    assert RATES[setting] in refused("sweep", "hover", "--set", setting)
    varied = setting.replace("=", "=250,")
    assert RATES[setting] in refused("sweep", "hover", "--vary", varied)


def test_a_vehicle_of_ones_own_can_be_checked(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(BEBOP, encoding="utf-8")
    result = CliRunner().invoke(gcs, ["check", "hover", "--vehicle", str(path)])
    assert result.exit_code == EXIT_DONE
    assert f"hover: vehicle {path} can fly it" in result.stdout


def test_a_forced_flight_needs_a_vehicle_too():
    assert "unknown vehicle 'saucer'" in refused("fly", "hover", "--vehicle", "saucer", "--force")


def test_unknown_vehicles_and_sensors_get_the_names_there_are():
    for option, files_of_a_kind in (("--vehicle", VEHICLES), ("--sensors", PROFILES)):
        line = refused("fly", "hover", option, "saucer")
        names = ", ".join(files_of_a_kind.names())
        assert line == (
            f"gcs: unknown {files_of_a_kind.kind} 'saucer'; shipped: {names}; or the path of a file"
        )


@pytest.mark.parametrize(
    ("setting", "part"),
    [
        ("SIM_WINDE=3", "--set SIM_WINDE: no such parameter; did you mean SIM_WIND_E? docs/parameters.md "),
        ("SIM_BRIGHT=3", "--set SIM_BRIGHT: no such parameter; there are SIM_ACC_ALIGN_X, SIM_ACC_ALIGN_Y, "),
        ("NGC_KXX=3", "--set NGC_KXX: no such parameter; did you mean NGC_KX? docs/parameters.md lists all"),
        (
            "SIM_NOISE=1",
            "--set SIM_NOISE: no such parameter; did you mean SIM_ACC_NOISE, SIM_GYR_NOISE, SIM_NOISE_SCALE ",
        ),
        ("SIM_DELAY=1", "--set SIM_DELAY: no such parameter; did you mean SIM_ACT_DELAY_MS? "),
        ("WPNAV_SPEED=3", "--set WPNAV_SPEED: no such parameter; did you mean WNC_SPEED or MIS_SPEED? "),
        ("WIND=3", "--set WIND: no such parameter; names begin with one of BAT_, COM_, "),
        ("SIM_WIND_E=300", "--set SIM_WIND_E = 300.0 m/s; must be -50 ... 50"),
        ("SIM_LOSS_PCT=101", "--set SIM_LOSS_PCT = 101.0 %; must be 0 ... 100"),
        ("GF_ACTION=1.5", "--set GF_ACTION = 1.5; must be a whole number"),
        ("CTL_LAW=1", "--set CTL_LAW is what --law names; give --law"),
    ],
)
def test_a_setting_that_cannot_be_is_refused_with_what_there_is(setting, part):
    assert refused("fly", "hover", "--set", setting).startswith(f"gcs: {part}")


def test_a_parameter_to_be_ignored_is_one_of_the_vehicles(tmp_path):
    file = tmp_path / "mine.toml"
    plumbline.Vehicle.load("bebop").replace(name="mine", parameters={"MY_GAIN": 3, "MIS_SPEED": 1}).save(file)
    line = refused("fly", "hover", "--vehicle", str(file), "--ignore", "my_gain", "--ignore", "NOPE")
    assert line == "gcs: --ignore NOPE: not among the vehicle's parameters; there are MY_GAIN, MIS_SPEED"
    check_flight_inputs(str(file), "lab", [], ignored=["MY_GAIN"])


PLANNER = """
from plumbline.examples.minimum_snap import MinimumSnap
from plumbline.planners import Parameter

class Mine(MinimumSnap):
    parameters = {**MinimumSnap.parameters, "MY_GAIN": Parameter(1.0, 0.0, 5.0, "", "A gain")}
"""


def test_a_check_refuses_a_vehicle_that_no_flight_without_custom_code_would_take(tmp_path):
    file, planner = tmp_path / "mine.toml", tmp_path / "mine.py"
    plumbline.Vehicle.load("bebop").replace(parameters={"MY_GAIN": 3, "MIS_SPEED": 1}).save(file)
    planner.write_text(PLANNER, encoding="utf-8")
    flown = refused("fly", "hover", "--vehicle", str(file))
    assert flown.startswith("gcs: the vehicle's parameters.MY_GAIN: no such parameter; ")
    assert refused("check", "hover", "--vehicle", str(file)) == flown

    def checked(*options):
        return CliRunner().invoke(gcs, ["check", "hover", "--vehicle", str(file), *options])

    for options in (("--ignore", "my_gain"), ("--planner", f"{planner}:Mine")):
        assert checked(*options).stdout.startswith(f"hover: vehicle {file} can fly it"), options
    line = refused("check", "hover", "--vehicle", str(file), "--ignore", "MY_GAIN", "--ignore", "MIS_SPEED")
    assert line.startswith("gcs: --ignore MIS_SPEED: the mission is checked with it; --set MIS_SPEED=VALUE ")


def test_settings_of_both_programs_are_taken():
    check_flight_inputs("thesis", "ideal", [("SIM_WIND_E", 3.0), ("SIM_LOSS_PCT", 5.0), ("NGC_KX", 5.0)])


@pytest.mark.parametrize("command", ["fly", "check", "upload", "sweep"])
def test_help_names_the_shipped_vehicles(command):
    text = " ".join(CliRunner().invoke(gcs, [command, "--help"]).stdout.split())
    # a line may break after the hyphen of a name
    assert ", ".join(VEHICLES.names()) in text.replace("- ", "-")


@pytest.mark.parametrize(
    ("name", "value", "meant"),
    [
        ("SIM_ACT_DELAY_MS", 0.072, "72 if 0.072 s is meant"),
        ("VEH_ROTOR_TAU", 0.02, "20 if 0.02 s is meant"),
        ("SIM_SENS_OFS_MS", -0.005, "-5 if -0.005 s is meant"),
        ("SIM_ACT_DELAY_MS", 0.0, ""),
        ("SIM_ACT_DELAY_MS", 1.0, ""),
        ("SIM_SENS_JIT_MS", -1.0, ""),
        ("PLB_T_MASS", 0.3, ""),
    ],
)
def test_of_a_time_that_may_be_meant_in_seconds_the_unit_is_told(name, value, meant):
    told = [f"{name} = {value:g} is in milliseconds; {meant}"] if meant else []
    assert setting_warnings("bebop", [(name, value)]) == told


@pytest.mark.parametrize(
    ("name", "value", "meant"),
    [
        ("SIM_BAT_CHARGE", 0.25, "25 if a share of 0.25 is meant"),
        ("SIM_BAT_CHARGE", 1.0, "100 if a share of 1 is meant"),
        ("MIS_ROTOR_MARG", 0.3, "30 if a share of 0.3 is meant"),
        ("SIM_BAT_CHARGE", 0.0, ""),
        ("SIM_BAT_CHARGE", 2.0, ""),
        ("SIM_LOSS_PCT", 0.5, ""),
    ],
)
def test_of_a_percentage_that_may_be_meant_as_a_share_the_unit_is_told(name, value, meant):
    told = [f"{name} = {value:g} is in percent; {meant}"] if meant else []
    assert setting_warnings("bebop", [(name, value)]) == told


def test_a_battery_with_which_no_vehicle_of_this_mass_hovers_is_told(tmp_path):
    (line,) = setting_warnings("hexarotor", [("SIM_BATTERY", 1.0)])
    assert line.startswith("SIM_BATTERY = 1: 65 W to hover with 5 kg is less than any multirotor needs")
    assert setting_warnings("hexarotor", [("SIM_BATTERY", 1.0), ("SIM_BAT_HOVER_W", 700.0)]) == []
    assert setting_warnings("hexarotor", [("SIM_BATTERY", 0.0)]) == []
    assert setting_warnings("bebop", [("SIM_BATTERY", 1.0)]) == []
    file = tmp_path / "mine.toml"
    battery = {"battery": True, "battery_cells": 6, "battery_capacity_mah": 9000.0}
    mine = plumbline.Vehicle.load("hexarotor").replace(
        battery_resistance_ohm=0.02, battery_hover_w=70.0, **battery
    )
    mine.save(file)
    (line,) = vehicle_warnings(str(file))
    assert line.startswith(f"{file}: battery_hover_w = 70: 70 W to hover with 5 kg")
    mine.replace(battery_hover_w=800.0).save(file)
    assert vehicle_warnings(str(file)) == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("fly hover --set SIM_ACT_DELAY_MS=0.072", ["--set SIM_ACT_DELAY_MS = 0.072"]),
        (
            "sweep hover --vary SIM_ACT_DELAY_MS=0,0.012,0.024 --set VEH_ROTOR_TAU=0.02",
            ["--set VEH_ROTOR_TAU = 0.02", "--vary SIM_ACT_DELAY_MS = 0.012"],
        ),
        ("fly hover --set SIM_ACT_DELAY_MS=0.072 --quiet", []),
    ],
)
def test_it_is_told_on_stderr_before_anything_flies(tmp_path, words, told):
    (tmp_path / "flight.tlog").touch()  # nothing is flown into a folder that holds a flight
    result = CliRunner().invoke(gcs, [*words.split(), "--out", str(tmp_path)], prog_name="gcs")
    *lines, last = result.stderr.splitlines()
    assert "holds a flight" in last
    assert [line.split(" is in milliseconds")[0] for line in lines] == [f"gcs: {one}" for one in told]


def test_a_law_in_the_file_of_a_vehicle_is_said_to_have_no_effect(tmp_path):
    file = tmp_path / "mine.toml"
    plumbline.Vehicle.load("bebop").replace(name="mine", parameters={"CTL_LAW": 1}).save(file)
    assert vehicle_warnings(str(file)) == [f"{file}: parameters.CTL_LAW has no effect; --law names the law"]
    assert vehicle_warnings("bebop") == []


def test_no_shipped_vehicle_or_profile_has_a_warning():
    assert not any(vehicle_warnings(name) for name in VEHICLES.names())
    assert not any(sensor_warnings(name) for name in PROFILES.names())


def test_a_rotor_whose_force_or_torque_is_in_another_unit_is_told(tmp_path):
    file, bebop = tmp_path / "mine.toml", plumbline.Vehicle.load("bebop")
    bebop.replace(rotor_max_n=200.0).save(file)  # the thrust of a Bebop's rotor in grams
    told = (
        "rotor_max_n = 200: all rotors give 163 times the weight of vehicle and load; 1.96 if 200 g of thrust"
    )
    assert vehicle_warnings(str(file)) == [f"{file}: {told} are meant"]
    bebop.replace(torque_ratio_m=0.9).save(file)
    (line,) = vehicle_warnings(str(file))
    assert "torque_ratio_m = 0.9 is more than the radius of a rotor, 0.076 m" in line


def test_a_sensor_whose_readings_arrive_too_late_is_told(tmp_path):
    file = tmp_path / "late.toml"
    lab = PROFILES.read("lab").text
    for latency_ms, told in ((300.0, []), (301.0, ["mocap", "load_tracker"])):
        file.write_text(lab.replace("latency_ms = 4.0", f"latency_ms = {latency_ms}"))
        lines = sensor_warnings(str(file))
        assert [line.removeprefix(f"{file}: ").split(".")[0] for line in lines] == told
    assert "latency_ms = 301: the autopilot uses no reading that is older than 300 ms" in lines[0]


def test_a_cable_that_is_shorter_than_the_arms_is_told(tmp_path):
    file = tmp_path / "mine.toml"
    bebop = plumbline.Vehicle.load("bebop")
    for length, told in ((0.16, 0), (0.12, 1)):
        bebop.replace(cable_length_m=length, load_radius_m=0.01).save(file)
        assert len(vehicle_warnings(str(file))) == told
    assert "cable_length_m = 0.12 is less than arm_m, 0.126" in vehicle_warnings(str(file))[0]


@pytest.mark.parametrize(
    ("share", "told"),
    [
        (0.1, ""),
        (0.03, "below 10 % the pull of the cable may be lost"),
        (0.005, "below 1 % the pull of the cable may be lost"),
    ],
)
def test_a_load_too_light_to_be_felt_is_told(tmp_path, share, told):
    file, bebop = tmp_path / "mine.toml", plumbline.Vehicle.load("bebop")
    bebop.replace(load_mass_kg=share * bebop.quad_mass_kg).save(file)
    lines = vehicle_warnings(str(file))
    assert [told in line for line in lines] == ([True] if told else [])
    assert all(f"is {100.0 * share:.2g} % of quad_mass_kg" in line for line in lines)


@pytest.mark.parametrize(("lag_s", "warned"), [(0.15, False), (0.22, True)])
def test_rotors_with_which_the_load_sways_are_told(tmp_path, lag_s, warned):
    file = tmp_path / "mine.toml"
    plumbline.Vehicle.load("bebop").replace(rotor_tau_s=lag_s).save(file)
    lines = vehicle_warnings(str(file))
    assert ["5.3 rad/s, and 5.8 rad/s are needed to hold its position steadily" in one for one in lines] == (
        [True] if warned else []
    )
