"""What wind a vehicle stands, as the check says it and as flights show it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from click.testing import CliRunner

import plumbline
from autopilot.trajectory.feasibility import PathReport
from gcs.cli import gcs
from gcs.closed_loop import Conditions
from gcs.errors import EXIT_DONE, EXIT_ERROR, EXIT_USAGE
from gcs.mission_files import load
from gcs.sweep.flight import FlightResult, fly, start_times
from gcs.workflows.before_flight import check_mission, wind_warnings
from gcs.workflows.vehicle_limits import load_limits
from gcs.workflows.wind import Craft, craft_of
from tests.gcs.test_refused_settings import options

# a flight in too much wind says so
pytestmark = pytest.mark.filterwarnings("ignore:.*in wind of:UserWarning")

MARGIN = 0.15  # of the speed, within which check and flights agree
STILL = PathReport(1, "waypoint", 10.0, 0.0, 1.1, 1.3, 0.9, 2.0, speed_m_s=1.0)


def craft(vehicle: str, **settings: float) -> Craft:
    return craft_of(vehicle, load_limits(vehicle), settings.items())


def stands_m_s(craft: Craft, *reports: PathReport) -> float:
    limit = craft.limit(reports)
    assert limit is not None
    return limit.speed_m_s


def flown(name: str, wind_m_s: float, vehicle: str = "bebop") -> FlightResult:
    """A flight in a wind towards the north, without messages, which takes a fraction of the time."""
    mission, conditions = load(name), Conditions(vehicle=vehicle, settings={"SIM_WIND_N": wind_m_s})
    return fly(mission, conditions, start_times(mission, Conditions(vehicle=vehicle)))


def checked(*arguments: str) -> tuple[int, Any]:
    result = CliRunner().invoke(gcs, ["check", *arguments, "--json"])
    return result.exit_code, json.loads(result.stdout)


@pytest.mark.parametrize("vehicle", ["bebop-real", "heavy-real"])
def test_flights_are_lost_in_little_more_wind_than_the_vehicle_is_said_to_stand(vehicle: str) -> None:
    speed_m_s = stands_m_s(craft(vehicle))

    def outcome(share: float) -> str:
        return flown("hover", share * speed_m_s, vehicle).outcome

    assert outcome(1.0 - MARGIN) == "completed"
    assert outcome(1.0 + MARGIN) in ("refused", "interrupted", "diverged")


def test_the_rotors_reach_their_limit_in_the_wind_that_the_check_says() -> None:
    code, found = checked("case-c")
    assert code == EXIT_DONE
    assert found["wind_reason"] == "a rotor would be at its limit in items[2] (signals)"

    def saturated(share: float) -> float:
        return flown("case-c", share * found["wind_limit_m_s"]).saturated_fraction

    assert saturated(1.0 - MARGIN) == 0.0
    assert saturated(1.06) > 0.0  # not much more, as the vehicle is then blown along the ground


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (
            ("hover",),
            ["vehicle and load are blown along the ground by 3.36 N; friction holds 2.94 N (14 % over)"],
        ),
        (
            ("hover", "--vehicle", "heavy-real"),
            ["the vehicle leans 51 deg to stay in place while it pulls the cable taut; the limit is 45 deg"],
        ),
    ],
)
def test_a_check_in_wind_says_what_the_vehicle_lacks(arguments: tuple[str, ...], texts: list[str]) -> None:
    code, found = checked(*arguments, "--set", "SIM_WIND_N=-16")
    assert code == EXIT_ERROR
    assert [one["item"] for one in found["violations"]] == [0]
    for violation, text in zip(found["violations"], texts, strict=True):
        assert violation["text"].startswith("in wind of 16.0 m/s ")
        assert text in violation["text"]
    assert found["wind_limit_m_s"] is None


def test_east_and_north_are_one_wind_and_a_path_is_named_by_its_line() -> None:
    code, found = checked("case-c", "--set", "SIM_WIND_N=9.9", "--set", "SIM_WIND_E=-9.9")
    (violation,) = found["violations"]
    assert code == EXIT_ERROR and violation["quantity"] == "rotor force"
    assert "case-c.toml:" in violation["text"]
    assert "items[2] (signals): in wind of 14.0 m/s from the worst direction one rotor" in violation["text"]
    assert checked("case-c", "--set", "SIM_WIND_N=9", "--set", "SIM_WIND_E=9")[0] == EXIT_DONE


def test_a_wind_out_of_range_and_another_parameter_of_the_world_are_refused() -> None:
    for setting, text in (
        ("SIM_WIND_E=60", "must be -50 ... 50"),
        ("SIM_WIND_U=1", "or SIM_WIND_E or SIM_WIND_N"),
    ):
        result = CliRunner().invoke(gcs, ["check", "hover", "--set", setting])
        assert (result.exit_code, text in result.stderr) == (EXIT_USAGE, True)


def test_more_drag_or_a_faster_path_or_a_weaker_rotor_stands_less_wind() -> None:
    bebop = craft("bebop", SIM_GND_EFFECT=0.0)
    assert stands_m_s(craft("bebop", SIM_DRAG_SCALE=2.0)) < stands_m_s(bebop)
    assert stands_m_s(craft("bebop", SIM_ROTOR_DRAG=0.3)) < stands_m_s(bebop)
    assert stands_m_s(bebop, STILL) == stands_m_s(bebop)
    assert stands_m_s(bebop, replace(STILL, rotor_high_n=1.9)) < stands_m_s(bebop)
    assert stands_m_s(bebop, replace(STILL, speed_m_s=12.0)) < stands_m_s(bebop)
    # in still air beyond its limits already, or not held in place: the wind is not what is lacking
    for report in (replace(STILL, rotor_high_n=2.0), replace(STILL, kind="attitude", rotor_high_n=1.95)):
        assert stands_m_s(bebop, report) == stands_m_s(bebop)


def test_a_flight_in_too_much_wind_is_warned_of_and_not_refused() -> None:
    flight = options("SIM_WIND_E=-14", "MIS_ROTOR_MARG=16")
    check_mission(load("case-c"), flight)
    (line,) = wind_warnings(load("case-c"), flight)
    assert "case-c.toml:" in line
    assert "items[2] (signals): in wind of 14.0 m/s from the worst direction one rotor has to give" in line
    assert wind_warnings(load("case-c"), replace(flight, planner="line.py:Line")) == []
    assert wind_warnings(load("case-c"), options("SIM_WIND_E=13")) == []
    (line,) = wind_warnings(load("hover"), options("SIM_WIND_E=13", vehicle="bebop-real"))
    assert line.startswith("in wind of 13.0 m/s the vehicle leans 48 deg to stay in place while it pulls the")
    # with less drag than in its file it stands this wind
    assert (
        wind_warnings(load("hover"), options("SIM_WIND_E=13", "SIM_DRAG_SCALE=0.5", vehicle="bebop-real"))
        == []
    )


def test_a_mission_made_in_python_is_judged_as_a_file_is() -> None:
    windy, path = options("SIM_WIND_E=14", "MIS_ROTOR_MARG=16"), "missions/case-c.toml"
    (in_file,) = wind_warnings(load("case-c"), windy)
    (made,) = wind_warnings(plumbline.Mission.load("case-c"), windy)
    assert in_file.startswith(path) and in_file.endswith(made)
