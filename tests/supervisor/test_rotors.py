"""Lost rotors: noted once, reported, and followed by a landing where the others can fly the vehicle."""

from __future__ import annotations

from dataclasses import replace

import pytest

from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import Hold
from autopilot.supervisor.advance import advance
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Flight, Phase
from autopilot.supervisor.watches.failsafe import OUT_OF_CONTROL_US
from autopilot.vehicle.file import load_vehicle
from tests.doubles.sky import SETTINGS, STEP_US, hanging

HOLDING = Flight(phase=Phase.HOLD, legs=(Hold((0.0, 0.0, 2.0)),))


def settings_for(name: str) -> Settings:
    """The settings of `Sky`, with the rotors of a shipped vehicle and the weight that they carry."""
    vehicle = load_vehicle(name)
    weight = (vehicle.quad_mass_kg + vehicle.load_mass_kg) * vehicle.gravity_m_s2
    rotors = replace(
        SETTINGS.rotors,
        layout=vehicle.layout,
        min_effort_n=vehicle.rotor_min_n,
        max_effort_n=vehicle.rotor_max_n,
        hover_thrust_n=weight,
    )
    return replace(SETTINGS, rotors=rotors)


def test_a_vehicle_that_can_do_without_lands_and_says_so_once() -> None:
    settings = settings_for("hexarotor")
    flight, report = advance(HOLDING, hanging(rotors_lost=0b10), settings)
    assert (flight.phase, flight.rotors_lost) == (Phase.LOWER, 0b10)
    assert [text for _, text in report.texts] == ["Failsafe: rotor 2 lost, landing"]
    _, again = advance(flight, hanging(4000, rotors_lost=0b10), settings)
    assert not again.texts


def test_of_two_rotors_that_are_lost_both_are_named() -> None:
    settings = settings_for("octorotor")
    flight, report = advance(replace(HOLDING, rotors_lost=1), hanging(rotors_lost=0b1000), settings)
    assert flight.rotors_lost == 0b1001
    assert [text for _, text in report.texts] == ["Failsafe: rotors 1, 4 lost, landing"]


def test_of_four_none_can_be_missed() -> None:
    flight, report = advance(HOLDING, hanging(rotors_lost=1), settings_for("bebop"))
    assert flight.phase == Phase.LOWER, "as far as they can"
    assert [text for _, text in report.texts] == ["Failsafe: rotor 1 lost, the others cannot fly it"]
    assert flight.is_failsafe, "as HEARTBEAT states"


SINKING = (0.0, 0.0, -4.0)  # m/s
FALLS = {
    "in the air": hanging(x=(0.0, 0.0, -3.1), v=SINKING, taut=False),
    "on the ground": hanging(x=(0.0, 0.0, 1.4), v=(0.4, 0.0, 0.1), taut=False),
}


@pytest.mark.parametrize("where", FALLS)
def test_one_that_falls_on_its_other_rotors_is_given_up_without_another_word(where: str) -> None:
    settings, seen = settings_for("bebop"), FALLS[where]._replace(rotors_lost=1)
    flight, report = advance(HOLDING, seen, settings)
    texts = [text for _, text in report.texts]
    for now_us in range(STEP_US, OUT_OF_CONTROL_US + 2 * STEP_US, STEP_US):
        assert flight.phase == Phase.LOWER
        flight, report = advance(flight, seen._replace(now_us=now_us), settings)
        texts += [text for _, text in report.texts]
    assert flight.phase == Phase.FAILSAFE
    distance = norm(sub(seen.x_load, (0.0, 0.0, 2.0)))
    assert texts == [
        "Failsafe: rotor 1 lost, the others cannot fly it",
        f"Flight given up: rotor 1 lost, load {distance:.1f} m off its path",
    ]


def test_which_rotors_the_hexarotor_can_miss_and_keep_its_heading() -> None:
    """As Du, Quan and others found for this order of spins."""
    rotors = settings_for("hexarotor").rotors
    assert all(rotors.can_fly_without(1 << i) for i in range(6))
    kept = [rotors.can_hold_heading_without(1 << i) for i in range(6)]
    assert kept == [True, True, True, True, False, False]
    assert not rotors.can_fly_without(0b000111)  # three adjacent rotors
