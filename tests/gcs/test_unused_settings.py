"""What is said to have no effect has none, and what has one is not said to have none."""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path

import pytest
from click.testing import CliRunner

import plumbline
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import LAWS, autopilot_parameters
from gcs.cli import gcs
from gcs.closed_loop import Conditions
from gcs.sweep.flight import StartTimes, fly, start_times
from gcs.workflows.unused_settings import UNUSED_BY_LAW, unused_settings
from missions.fileformat import parse_mission

OF_LAWS = [(law, name) for law, names in UNUSED_BY_LAW.items() for name in sorted(names)]
BELIEF = autopilot_parameters(load_belief("bebop"))
ON_LINKS = {"SIM_CBL_LINKS": 4.0}
TURNING = {**ON_LINKS, "SIM_LOAD_GYR": 0.05}
FED = {"SIM_BATTERY": 1.0, "SIM_BAT_CHARGE": 30.0}
# by parameter: a value, and what must be set for it to have an effect
OF_WORLD: dict[str, tuple[float, dict[str, float]]] = {
    "SIM_GUST_E": (2.0, {"SIM_GUST_AT_S": 12.0}),
    "SIM_GUST_N": (2.0, {"SIM_GUST_AT_S": 12.0}),
    "SIM_GUST_U": (2.0, {"SIM_GUST_AT_S": 12.0}),
    "SIM_GUST_FOR_S": (1.0, {"SIM_GUST_E": 2.0, "SIM_GUST_AT_S": 12.0}),
    "SIM_GUST_AT_S": (12.0, {"SIM_GUST_E": 2.0}),
    "SIM_GUST_TAU_S": (2.0, {"SIM_GUST_STD": 1.0}),
    "SIM_ENGINE_AT_S": (12.0, {"SIM_ENGINE_FAIL": 1.0}),
    "SIM_SENS_AT_S": (12.0, {"SIM_SENS_FAIL": 2.0}),
    "SIM_SENS_FOR_S": (12.0, {"SIM_SENS_FAIL": 2.0}),
    "SIM_ENGINE_MUL": (0.9, {"SIM_ENGINE_FAIL": 1.0}),
    "SIM_CBL_MASS": (0.01, ON_LINKS),
    "SIM_CBL_CD": (2.0, {**ON_LINKS, "SIM_CABLE_DIAM": 5.0}),
    "SIM_CBL_EA": (1000.0, ON_LINKS),
    "SIM_CBL_DAMP": (20.0, ON_LINKS),
    "SIM_LOAD_GYR": (0.05, {**ON_LINKS, "SIM_LOAD_HOOK": 0.05}),
    "SIM_LOAD_HOOK": (0.05, TURNING),
    "SIM_LOAD_GYR_UP": (0.03, {**TURNING, "SIM_LOAD_PRESS": 0.05, "SIM_WIND_E": 1.0}),
    "SIM_LOAD_PRESS": (0.05, TURNING),
    "SIM_LOAD_SPIN": (1.0, {**TURNING, "SIM_LOAD_PRESS": 0.05, "SIM_WIND_E": 1.0}),
    "SIM_BAT_CELLS": (4.0, FED),
    "SIM_BAT_CAP": (800.0, FED),
    "SIM_BAT_R": (0.1, FED),
    "SIM_BAT_HOVER_W": (80.0, FED),
    "SIM_BAT_CHARGE": (30.0, {"SIM_BATTERY": 1.0}),
    "SIM_ESC_RPM_CTL": (1.0, FED),
    "COM_LOW_BAT_ACT": (2.0, {"SIM_BATTERY": 1.0, "SIM_BAT_CAP": 200.0, "BAT_CRIT_THR": 0.97}),
    "SIM_BLADE_STIFF": (1.0, {"SIM_ROTOR_FLAP": 0.01}),
    "SIM_GPS_MP_M": (0.1, {}),
    "SIM_MAG_MOT": (0.1, {}),
    "SIM_GPS_POS_X": (0.1, {}),
    "VEH_GPS_POS_Z": (0.1, {}),
}


# shorter than the missions hover and load-attitude, and all that these show is seen here too: positions and
# attitudes of the load, to all sides, are tracked
HOVER = """
title = "Hover"
description = "A mission for tests."

[[items]]
type = "takeoff"
altitude_m = 1.0

[[items]]
type = "delay"
duration_s = 3.0

[[items]]
type = "land"
"""
_LEAN = """
[[items]]
type = "attitude"
controlled = "load"
tilt_north_deg = {0}
tilt_east_deg = {0}
duration_s = 0.6

"""
_END = HOVER[HOVER.rindex("[[items]]") :]
LEAN = HOVER.removesuffix(_END) + _LEAN.format(7.0) + _LEAN.format(-7.0) + _END
MISSIONS = {name: parse_mission(text, name, name) for name, text in (("hover", HOVER), ("lean", LEAN))}


@cache
def start(mission: str) -> StartTimes:
    plumbline_law = {"CTL_LAW": float(LAWS.index("plumbline"))}
    return start_times(MISSIONS[mission], Conditions(settings=plumbline_law))


@cache
def flown(mission: str, law: str, settings: tuple[tuple[str, float], ...]) -> str:
    """The result of a flight in all digits."""
    conditions = Conditions(settings={**dict(settings), "CTL_LAW": float(LAWS.index(law))})
    return repr(fly(MISSIONS[mission], conditions, start(mission)))


@pytest.mark.parametrize(("law", "name"), OF_LAWS)
@pytest.mark.parametrize("mission", MISSIONS)
def test_a_parameter_of_another_law_has_no_effect(mission: str, law: str, name: str) -> None:
    parameter = BELIEF.describe(name)
    value = 0.8 * parameter.default
    assert flown(mission, law, ((name, value),)) == flown(mission, law, ())
    assert unused_settings("bebop", "lab", [law], [(name, value)]) == {
        name: f"{name} has no effect: law {law} does not use it"
    }
    others = [other for other in LAWS if name not in UNUSED_BY_LAW[other]]
    assert unused_settings("bebop", "lab", [law, *others], [(name, value)]) == {}


@pytest.mark.parametrize("name", OF_WORLD)
def test_a_parameter_of_an_effect_that_is_switched_off_has_no_effect(name: str) -> None:
    value, needed = OF_WORLD[name]
    assert flown("hover", "plumbline", ((name, value),)) == flown("hover", "plumbline", ())
    (line,) = unused_settings("bebop", "lab", ["plumbline"], [(name, value)]).values()
    assert line.startswith(f"{name} has no effect: ")
    if not needed:
        assert unused_settings("bebop", "rtk", ["plumbline"], [(name, value)]) == {}
        return
    others = tuple(one for one in needed.items() if one[0] != name)
    assert unused_settings("bebop", "lab", ["plumbline"], [(name, value), *others]) == {}
    assert flown("hover", "plumbline", ((name, value), *others)) != flown("hover", "plumbline", others)


def test_of_several_values_one_with_an_effect_is_enough() -> None:
    gusts = [("SIM_GUST_E", 0.0), ("SIM_GUST_E", 2.0)]
    never, sometimes = [("SIM_GUST_AT_S", -1.0)], [("SIM_GUST_AT_S", -1.0), ("SIM_GUST_AT_S", 12.0)]
    assert set(unused_settings("bebop", "lab", ["plumbline"], gusts + never)) == {"SIM_GUST_E"}
    assert unused_settings("bebop", "lab", ["plumbline"], gusts + sometimes) == {}


def test_the_default_of_a_parameter_and_a_parameter_that_there_is_not_are_not_told() -> None:
    settings = [("NGC_KX", BELIEF["NGC_KX"]), ("SIM_GUST_E", 0.0), ("SIM_NONE", 1.0)]
    assert unused_settings("bebop", "lab", ["plumbline"], settings) == {}


def test_what_the_file_of_a_vehicle_switches_on_has_an_effect() -> None:
    settings = [("SIM_BAT_CAP", 800.0)]
    assert unused_settings("bebop-real", "lab", ["plumbline"], settings) == {}


@pytest.mark.parametrize(
    ("law", "shaping", "why"),
    [
        ("plumbline", (), ""),
        ("plumbline", (0.0,), "no path is shaped; set MIS_SHAPE to 1 or 2"),
        ("thesis", (), "paths are shaped for law plumbline only; set MIS_SHAPE to 2"),
        ("thesis", (2.0,), ""),
        ("mine.py:Pid", (), "paths are shaped for law plumbline only; set MIS_SHAPE to 2"),
    ],
)
def test_the_error_of_shaping_needs_shaping(law: str, shaping: tuple[float, ...], why: str) -> None:
    settings = [("MIS_SHAPE_ERR", 0.1), *(("MIS_SHAPE", value) for value in shaping)]
    found = unused_settings("bebop", "lab", [law], settings)
    assert found == ({"MIS_SHAPE_ERR": f"MIS_SHAPE_ERR has no effect: {why}"} if why else {})


TOLD = {
    "fly": (
        "--set NGC_KX=5 --set SIM_MAG_MOT=0.1",
        ["law plumbline does not use it", "sensors lab have no m"],
    ),
    "sweep": (
        "--set LQR_Q_POS=5 --law plumbline --law thesis --vary SIM_GUST_E=0,2 --vary NGC_KX=4,5",
        ["laws plumbline, thesis do not use it", "no gust begins; set SIM_GUST_AT_S, or SIM_GUST_NOW in fli"],
    ),
}


@pytest.mark.parametrize("command", TOLD)
def test_the_command_line_tells_it_before_anything_flies(tmp_path, command):
    (tmp_path / "flight.tlog").touch()  # nothing is flown into a folder that holds a flight
    words, told = TOLD[command]
    result = CliRunner().invoke(
        gcs, [command, "hover", *words.split(), "--out", str(tmp_path)], prog_name="gcs"
    )
    *lines, last = result.stderr.splitlines()
    assert "holds a flight" in last
    assert len(lines) == len(told)
    assert all(f" has no effect: {why}" in line for line, why in zip(lines, told, strict=True))


def test_scripts_are_warned(tmp_path: Path) -> None:
    mission = tmp_path / "hover.toml"
    mission.write_text(HOVER, encoding="utf-8")
    with pytest.warns(UserWarning) as told:
        plumbline.fly(mission, settings={"NGC_KX": 5.0, "SIM_GUST_E": 2.0, "SIM_GUST_AT_S": 12.0})
        plumbline.sweep(
            mission, vary={"SIM_GUST_FOR_S": "1:2:2"}, settings={"PLB_ZETA": 0.8}, kind="arrow", jobs=1
        )
    assert [str(one.message) for one in told] == [
        "settings: NGC_KX has no effect: law plumbline does not use it",
        "vary: SIM_GUST_FOR_S has no effect: no gust begins; set SIM_GUST_AT_S, or SIM_GUST_NOW in flight",
    ]
    assert {one.filename for one in told} == {__file__}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plumbline.fly(mission, settings={"PLB_ZETA": 0.8})
