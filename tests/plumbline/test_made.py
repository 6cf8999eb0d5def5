"""Missions, vehicles and sensor profiles made in Python: checked as they are made, saved as the files."""

from __future__ import annotations

import dataclasses
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import plumbline
from autopilot.vehicle.shipped import VEHICLES
from missions.fileformat import load_mission, shipped
from plumbline import (
    AttitudeRun,
    Delay,
    Land,
    Mission,
    Release,
    ReturnHome,
    Sensors,
    Signals,
    Sine,
    Speed,
    Takeoff,
    Term,
    Trajectory,
    Vehicle,
    Waypoint,
    Winch,
)
from sitl.sensors.shipped import PROFILES
from tests.doubles.trajectories import trajectories

SHORT = Mission("short", [Takeoff(0.5), Waypoint(0.2, 0.0, 0.5, hold_s=0.5), Land()])


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_subnormal=False)


# ---- missions

FACTORS = st.builds(Sine, numbers(0.1, 2000), numbers(-6.28, 6.28), numbers(0, 3600))
EDGES = numbers(0.1, 3600)
STAYING = st.builds(
    Term, st.sampled_from("xyz"), numbers(-1000, 1000), numbers(0, 9), EDGES, st.none(), st.just(0.0)
)
RETURNING = st.builds(
    Term,
    st.sampled_from("xyz"),
    numbers(-1000, 1000),
    numbers(0, 3600),
    EDGES,
    numbers(0, 3600),
    EDGES,
    st.lists(FACTORS, max_size=3).map(tuple),
)
TIMED = st.builds(dataclasses.replace, STAYING, rise_90_by_s=EDGES)
HEIGHTS = numbers(0.01, 1000)
WITH_LOAD = st.one_of(
    st.builds(Waypoint, numbers(-1000, 1000), numbers(-1000, 1000), HEIGHTS, numbers(0, 3600)),
    st.builds(Speed, numbers(0.01, 20)),
    st.builds(Delay, numbers(0.001, 3600)),
    st.builds(
        Signals,
        numbers(0.001, 3600),
        st.lists(STAYING | RETURNING | TIMED, min_size=1, max_size=3).map(tuple),
    ),
    trajectories(100.0),
    st.builds(
        AttitudeRun,
        st.sampled_from(["vehicle", "load"]),
        numbers(-1.55, 1.55),
        numbers(-1.55, 1.55),
        EDGES,
    ),
    st.builds(Winch, numbers(-100, 100), st.none() | numbers(0.01, 1.0)),
    st.just(ReturnHome()),
)
ALONE = st.builds(Waypoint, numbers(-1000, 1000), numbers(-1000, 1000), HEIGHTS) | st.builds(Release)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)

TITLES = TEXTS.filter(str.isprintable)


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Any mission that a file can hold, with a name that its file can have."""
    return Mission(
        draw(st.from_regex(r"[a-z][a-z0-9-]{0,20}", fullmatch=True)),
        [Takeoff(draw(HEIGHTS)), *draw(st.lists(WITH_LOAD, max_size=5)), *draw(st.lists(ALONE)), Land()],
        draw(TITLES),
        draw(TEXTS),
        draw(st.lists(TEXTS, max_size=3)),
    )


@given(mission=missions())
def test_a_mission_that_is_saved_is_loaded_as_it_was(mission: Mission, tmp_path_factory: Any) -> None:
    path = tmp_path_factory.mktemp("saved") / f"{mission.name}.toml"
    mission.save(path)
    assert Mission.load(path) == mission
    assert pickle.loads(pickle.dumps(mission)) == mission


@pytest.mark.parametrize("name", shipped())
def test_shipped_missions_are_the_same_to_the_bit(name: str) -> None:
    assert Mission.load(name).steps == load_mission(name).steps


def test_numbers_of_numpy_and_whole_ones_are_numbers(tmp_path: Path) -> None:
    corners = [Waypoint(x, np.float32(0.5), np.int64(2)) for x in np.arange(2.0)]
    Mission("m", [Takeoff(1), *corners, Land()]).save(tmp_path / "m.toml")
    assert Mission.load(tmp_path / "m.toml").steps[2] == Waypoint(1.0, 0.5, 2.0)


def test_a_term_has_the_defaults_of_a_file() -> None:
    assert Term(axis="y", amplitude_m=1.0, rise_s=1.0) == Term("y", 1.0, 0.0, 1.0, None, 0.0, (), None)
    with pytest.raises(TypeError, match="rise_s"):
        Term("y", 1.0)


WRONG: dict[str, tuple[Any, str]] = {
    "value": (
        lambda: Mission("m", [Takeoff(1.0), Waypoint(0.0, 0.0, -1.0), Land()]),
        "m: items[1].altitude_m = -1.0; must be >= 0.01 and <= 10000 (height of the load above home)",
    ),
    "type": (lambda: Mission("m", [Takeoff("1"), Land()]), 'items[0].altitude_m = "1"; must be a number'),  # type: ignore[arg-type]
    "no step": (lambda: Mission("m", [Takeoff(1.0), "land", Land()]), 'items[1].type = "str"; must be one'),  # type: ignore[list-item]
    "order": (lambda: Mission("m", [Takeoff(1.0)]), "a mission ends on the ground"),
    "no name": (lambda: Mission("", [Land()]), "name = ''; must be a text that is not empty, as 'there'"),
    "name": (
        lambda: Mission("x\ny", [Land()], "Title"),
        "name = 'x\\ny'; must be one line of printable characters, as 'there'",
    ),
    "classes": (
        lambda: Mission("m", [Takeoff, Land]),  # type: ignore[list-item]
        "m: items[0] is the class Takeoff; write Takeoff(...); m: items[1] is the class Land; write Land()",
    ),
    "class of a term": (
        lambda: Mission("m", [Takeoff(1.0), Signals(5.0, (Term,)), Land()]),  # type: ignore[arg-type]
        "m: items[1].terms[0] is the class Term; write Term(...)",
    ),
    "no terms": (
        lambda: Mission("m", [Takeoff(1.0), Signals(5.0, ()), Land()]),
        "m: items[1].terms is empty; must be a list of one Term at least",
    ),
    "fall alone": (
        lambda: Mission("m", [Takeoff(1.0), Signals(5.0, (Term("y", 1.0, rise_s=1.0, fall_s=1.0),)), Land()]),
        "m: items[1].terms[0] has fall_s without hold_s; give both, or neither to stay at the top",
    ),
    "close points": (
        lambda: Mission(
            "m", [Takeoff(1.0), Trajectory([(0.05 * k, 0.0, 0.0, 0.0) for k in range(9)]), Land()]
        ),
        "m: items[1] points[1] comes 0.05 s after the one before; must be 0.1 s at least; closer",
    ),
    "nothing": (lambda: Mission("m", []), "items = []; must be a list of at least 1"),
    "after release": (lambda: Mission("m", [Takeoff(1.0), Release(), Winch(0.1), Land()]), "needs the load"),
    "load": (lambda: Mission.load("hovr"), "did you mean hover?"),
    "save": (lambda: SHORT.save("none/such.toml"), "none/such.toml: cannot be written: No such file"),
    "vehicle": (lambda: Vehicle(name="mine"), "mine: quad_mass_kg is missing (mass of the vehicle"),
    "vehicle's name": (lambda: Vehicle.load("bepop"), "did you mean bebop?"),
    "vehicle's key": (lambda: Vehicle.load("bebop").replace(arm=1.0), "bebop: arm: unknown key; write arm_m"),
    "vehicle's thing": (
        lambda: Vehicle.load("bebop").replace(cable=1.0),
        "cable: unknown key; write cable_length_m",
    ),
    "vehicle's value": (lambda: Vehicle.load("bebop").replace(load_mass_kg=-1), "load_mass_kg = -1; must be"),
    "sensors": (lambda: Sensors.load("lab").replace(imu=None), "Sensors: imu is missing"),
    "nothing sees the vehicle": (
        lambda: Sensors.load("lab").replace(mocap=None),
        "Sensors: has neither mocap nor gnss; one of them must tell where the vehicle is",
    ),
    "sensor's value": (lambda: Sensors.load("lab").replace(mocap={"rate_hz": 0}), "mocap.rate_hz = 0; must"),
}


@pytest.mark.parametrize(("make", "says"), WRONG.values(), ids=WRONG)
def test_what_cannot_be_is_told_as_it_is_made(make: Any, says: str) -> None:
    with pytest.raises(plumbline.Error) as told:
        make()
    assert says in str(told.value) and "\n" not in str(told.value)


# ---- vehicles and sensors


@pytest.mark.parametrize("name", VEHICLES.names())
def test_a_vehicle_that_is_saved_is_loaded_as_it_was(name: str, tmp_path: Path) -> None:
    vehicle = Vehicle.load(name).replace(load_mass_kg=0.123)
    vehicle.save(tmp_path / "v.toml")
    assert Vehicle.load(tmp_path / "v.toml") == vehicle
    assert vehicle.load_mass_kg == 0.123 != Vehicle.load(name).load_mass_kg


@pytest.mark.parametrize("name", PROFILES.names())
def test_sensors_that_are_saved_are_loaded_as_they_were(name: str, tmp_path: Path) -> None:
    sensors = Sensors.load(name).replace(imu={"accel_noise_m_s2": 0.123, "accel_range_m_s2": None})
    sensors.save(tmp_path / "s.toml")
    assert Sensors.load(tmp_path / "s.toml") == sensors
    assert (sensors.imu.accel_noise_m_s2, sensors.imu.accel_range_m_s2) == (0.123, None)
    assert sensors.imu.gyro_noise_rad_s == Sensors.load(name).imu.gyro_noise_rad_s


def test_a_sensor_is_taken_off_and_put_on() -> None:
    without = Sensors.load("ideal").replace(load_tracker=None)
    assert without.load_tracker is None
    again = without.replace(load_tracker={"rate_hz": "tick", "position_noise_m": 0.0})
    assert again.load_tracker is not None and again.load_tracker.rate_hz == 0.0


# ---- flown


def test_objects_fly_as_the_files_do(tmp_path: Path) -> None:
    vehicle = Vehicle.load("bebop").replace(cable_length_m=0.9)
    sensors = Sensors.load("lab").replace(mocap={"latency_ms": 8.0})
    for made, name in ((SHORT, "short"), (vehicle, "v"), (sensors, "s")):
        made.save(tmp_path / f"{name}.toml")
    flown = plumbline.fly(SHORT, vehicle=vehicle, sensors=sensors, quiet=True)
    files = plumbline.fly(
        tmp_path / "short.toml", vehicle=tmp_path / "v.toml", sensors=tmp_path / "s.toml", quiet=True
    )
    assert flown.outcome == "completed" and flown.tlog == files.tlog
    assert flown.tlog != plumbline.fly(SHORT, sensors=sensors, quiet=True).tlog
    # the file is kept, so that the report and the command of the flight find it
    assert Vehicle.load(flown.summary["vehicle"]) == vehicle


@pytest.mark.usefixtures("swept_here")
def test_a_sweep_takes_objects() -> None:
    vehicle = Vehicle.load("bebop").replace(load_mass_kg=0.08)
    sensors = Sensors.load("ideal")
    flown = plumbline.sweep(SHORT, vehicle=vehicle, sensors=sensors, jobs=1, quiet=True, kind="arrow")
    assert flown["outcome"].to_pylist() == ["completed"]
    alone = plumbline.fly(SHORT, vehicle=vehicle, sensors=sensors, quiet=True)
    assert flown["flight_s"].to_pylist() == pytest.approx([alone.summary["flight_s"]], abs=0.1)


def test_importing_is_light() -> None:
    """The simulator is loaded only for a flight."""
    program = "import sys, plumbline; sys.exit('numba' in sys.modules or 'sitl.world' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


@pytest.mark.parametrize("name", ["there.plan", "there.waypoints", "there.txt"])
def test_a_mission_is_not_saved_under_the_ending_of_another_format(tmp_path: Path, name: str) -> None:
    mission = Mission("there", [Takeoff(1.0), Land()])
    with pytest.raises(plumbline.Error, match=r"a mission is written as TOML; name it there\.toml"):
        mission.save(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_mission_with_other_steps_is_a_copy() -> None:
    hover = Mission.load("hover")
    longer = hover.replace(name="longer", steps=[*hover.steps[:-1], Delay(1.0), hover.steps[-1]])
    assert (longer.name, longer.description, len(longer.steps)) == ("longer", hover.description, 4)
    assert len(hover.steps) == 3
    with pytest.raises(plumbline.Error, match="altitude: a Mission has no such part; it has name, steps"):
        hover.replace(altitude=3.0)
