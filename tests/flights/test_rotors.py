"""Vehicles with any rotors fly; one that can do without a rotor lands with its load after losing it."""

from __future__ import annotations

import re
from math import dist
from pathlib import Path

import pytest

from autopilot.supervisor.state import Phase
from autopilot.vehicle.shipped import VEHICLES
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import Delay, Land, Takeoff
from tests.doubles.craft import ACCEPTED, Craft, at_phase

ROUTE = (Takeoff(1.0), Delay(3.0), Land())
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
MOTOR, OFF = mavlink.FAILURE_UNIT_SYSTEM_MOTOR, mavlink.FAILURE_TYPE_OFF
ROTOR = '[[rotor]]\nx_m = {}\ny_m = {}\nspin = "{}"\n'
# five in an irregular ring; coaxial pairs at the ends of a cross, the lower ones weaker
FIVE = ((-0.12, 0.02, "+"), (-0.03, -0.13, "-"), (0.11, -0.06, "+"), (0.1, 0.08, "-"), (-0.02, 0.12, "+"))
CROSS = ((-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1), (0.1, 0.1))
PAIRS = [(x, y, spin) for x, y in CROSS for spin in "+-"]


def vehicle(tmp_path: Path, head: str, rotors: str) -> str:
    """The file of a vehicle that is `bebop` except for its rotors."""
    path = tmp_path / "own.toml"
    path.write_text(head + VEHICLES.read("bebop").text + rotors, encoding="utf-8")
    return str(path)


def held(craft: Craft) -> None:
    """Fly the route to its end: the vehicle lands, and the load lies on the ground."""
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    craft.wait(3.0)
    craft.run(at_phase(Phase.DISARMED), 90.0)
    assert craft.texts[-1] == "Landed, disarmed"
    assert craft.truth.load_on_ground > 0.0


@pytest.mark.parametrize(
    ("head", "rotors"),
    [
        ('frame = "x"\n', ""),
        ("", "".join(ROTOR.format(*one) for one in FIVE)),
        ("", "".join(ROTOR.format(*one) + "thrust_factor = 0.8\n" * (one[2] == "-") for one in PAIRS)),
    ],
    ids=["x", "five", "pairs"],
)
def test_rotors_at_any_places_lift_hold_and_land_the_load(tmp_path: Path, head: str, rotors: str) -> None:
    craft = Craft(*ROUTE, vehicle=vehicle(tmp_path, head, rotors))
    held(craft)


@pytest.mark.parametrize(("rotor", "text"), [(2, "landing"), (5, "heading given up, landing")])
def test_a_hexarotor_that_loses_a_rotor_lands_with_its_load(rotor: int, text: str) -> None:
    craft = Craft(Takeoff(1.0), Delay(60.0), vehicle="hexarotor")
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    craft.wait(1.0)
    over = craft.truth.x_load
    assert craft.command(mavlink.MAV_CMD_INJECT_FAILURE, MOTOR, OFF, rotor) == ACCEPTED
    craft.wait(0.4)
    assert craft.texts[-1] == f"Failsafe: rotor {rotor} lost, {text}"
    craft.run(at_phase(Phase.DISARMED), 60.0)
    assert craft.texts[-1] == "Landed, disarmed"
    load = craft.truth.x_load
    assert craft.truth.load_on_ground > 0.0
    assert dist(load[:2], over[:2]) < 0.1
    assert craft.command(ARM, 1.0) == mavlink.MAV_RESULT_DENIED
    told = "".join(craft.texts[-2:])  # longer than one STATUSTEXT
    assert told == f"Arming denied: rotor {rotor} did not follow the commands of the last flight"
    assert craft.command(mavlink.MAV_CMD_INJECT_FAILURE, MOTOR, mavlink.FAILURE_TYPE_OK, rotor) == ACCEPTED
    craft.wait(0.1)
    assert craft.command(ARM, 1.0) == ACCEPTED


def test_a_quadrotor_says_that_three_cannot_fly_it() -> None:
    craft = Craft(Takeoff(1.0), Delay(60.0))
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    assert craft.command(mavlink.MAV_CMD_INJECT_FAILURE, MOTOR, OFF, 1) == ACCEPTED
    craft.run(at_phase(Phase.DISARMED), 20.0)
    assert "Failsafe: rotor 1 lost, the others cannot fly it" in craft.texts


def test_a_rotor_that_the_vehicle_does_not_have_cannot_fail() -> None:
    craft = Craft(*ROUTE, vehicle="hexarotor")
    craft.wait(0.1)
    assert craft.command(mavlink.MAV_CMD_INJECT_FAILURE, MOTOR, OFF, 7) == mavlink.MAV_RESULT_DENIED
    told = "".join(craft.texts[-2:])  # longer than one STATUSTEXT
    assert told == "Failure: rotor (param3) = 7; must be 1 ... 6, or 0 for all"


@pytest.mark.parametrize("delay_ms", [60, 72, 84])
def test_rotors_that_answer_late_are_not_taken_for_lost(delay_ms: int) -> None:
    """The vehicle trembles on its gear under such a delay: a rotor gives little while much is commanded."""
    craft = Craft(Takeoff(0.4), Delay(0.5), Land(), SIM_ACT_DELAY_MS=delay_ms)
    craft.begin()
    craft.run(at_phase(Phase.DISARMED), 60.0)
    assert craft.texts[-1] == "Landed, disarmed"


@pytest.mark.parametrize("name", ["heavy", "iris", "hexarotor"])
def test_rotors_without_limits_carry_a_heavy_vehicle(tmp_path: Path, name: str) -> None:
    text = VEHICLES.read(name).text
    path = tmp_path / "strong.toml"
    path.write_text(re.sub(r"(?m)^rotor_max_n = .*$", "rotor_max_n = inf", text), encoding="utf-8")
    held(Craft(*ROUTE, vehicle=str(path)))
