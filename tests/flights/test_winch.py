"""The winch in flight: the vehicle stays, the load moves, assumed and true length of the cable agree."""

from __future__ import annotations

import math

import pytest

from autopilot.guidance.legs import Hold
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import Delay, Land, Takeoff, Waypoint, Winch
from tests.doubles.craft import Craft, at_phase
from tests.doubles.sky import ACCEPTED

WINCH, TAKEOFF, ARM = 42600, 22, 400
LENGTH, HOLD, RETRACT = 1.0, 5.0, 6.0
# worst while reeling at 0.3 m/s and 0.3 m/s^2; measured: vehicle 4.6 mm, load 4.6 mm, and 5.6 mm of each with
# 12 ms of delay and 30 ms of lag; both hover to 3 mm
OFF_M = 0.012
SLOW_ROTORS = {"SIM_ACT_DELAY_MS": 12.0, "SIM_ROTOR_TAU_MS": 30.0}
# m, of the final length: the rate is rounded to float32; measured 3e-9
LENGTH_M = 1e-7


def held(altitude: float = 2.0, sensors: str = "lab", **settings_: float) -> Craft:
    """A craft that holds its load."""
    craft = Craft(sensors=sensors, **settings_)
    craft.wait(1.0)
    craft.command(ARM, 1.0)
    craft.command(TAKEOFF, 0.0, 0.0, 0.0, 0.0, math.nan, math.nan, altitude)
    craft.run(at_phase(Phase.HOLD))
    craft.wait(3.0)
    return craft


def true_length(craft: Craft) -> float:
    return craft.world.cable_length


def reeled(craft: Craft, seconds: float) -> tuple[float, float]:
    """Fly on; return the greatest distance of the load from its setpoint, of the vehicle from its start."""
    start, load, vehicle = craft.truth.x_quad, 0.0, 0.0
    end = craft.onboard.now_us + round(1e6 * seconds)
    while craft.onboard.now_us < end:
        craft.tick()
        flight = craft.flight
        asked = flight.legs[0].jet((craft.onboard.now_us - flight.leg_start_us) * 1e-6)[0]
        load = max(load, math.dist(craft.truth.x_load, asked))
        vehicle = max(vehicle, math.dist(craft.truth.x_quad, start))
    return load, vehicle


@pytest.mark.parametrize("settings_", [{}, SLOW_ROTORS])
def test_the_vehicle_stays_and_the_load_goes_down_and_up(settings_: dict[str, float]) -> None:
    craft = held(**settings_)
    slack = craft.truth.slack_events
    for length, there in ((0.8, 1.5), (-0.9, 0.6)):
        assert craft.command(WINCH, 1.0, LENGTH, length, 0.3) == ACCEPTED
        load, vehicle = reeled(craft, 9.0)
        assert load < OFF_M
        assert vehicle < OFF_M
        assert true_length(craft) == pytest.approx(there, abs=LENGTH_M)
        assert craft.flight.cable.length_m == pytest.approx(there, abs=1e-12)
        assert craft.truth.x_load[2] == pytest.approx(2.7 - there, abs=0.01)
    assert craft.truth.slack_events == slack
    assert "Winch: 1.50 m to 0.60 m" in craft.texts
    estimate = craft.estimate.load
    assert estimate.length == pytest.approx(0.6, abs=0.003)


def test_with_another_length_it_is_carried_landed_and_lifted_again() -> None:
    craft = held()
    craft.command(WINCH, 1.0, LENGTH, 0.5, 0.3)
    craft.wait(6.0)
    place = (craft.truth.x_load[0], craft.truth.x_load[1])
    assert craft.command(21) == ACCEPTED
    craft.run(at_phase(Phase.DISARMED))
    assert "Landed, disarmed" in craft.texts
    # beside the load by half of the present cable length
    assert math.dist(craft.truth.x_quad[:2], place) == pytest.approx(0.6, abs=0.05)
    craft.command(ARM, 1.0)
    craft.command(TAKEOFF, 0.0, 0.0, 0.0, 0.0, math.nan, math.nan, 1.0)
    craft.run(at_phase(Phase.HOLD))
    craft.wait(2.0)
    assert craft.truth.x_load[2] == pytest.approx(1.0, abs=0.01)
    assert math.dist(craft.truth.x_load, craft.truth.x_quad) == pytest.approx(1.2, abs=1e-6)


def test_a_hold_stops_the_winch_and_belief_and_truth_stop_alike() -> None:
    craft = held()
    assert craft.command(WINCH, 1.0, 2.0, 0.0, -0.2) == ACCEPTED  # in, at this rate
    craft.wait(2.0)
    assert craft.command(WINCH, 1.0, HOLD) == ACCEPTED
    load, vehicle = reeled(craft, 4.0)
    assert max(load, vehicle) < OFF_M
    assert 0.31 < true_length(craft) < 0.5  # two seconds of stopping after two of starting
    assert craft.flight.cable.length_m == pytest.approx(true_length(craft), abs=LENGTH_M)
    assert isinstance(craft.flight.legs[0], Hold)
    assert craft.command(WINCH, 1.0, RETRACT) == ACCEPTED
    reeled(craft, 6.0)
    assert true_length(craft) == pytest.approx(0.3, abs=LENGTH_M)


def test_with_receiver_and_camera_the_length_is_followed_too() -> None:
    craft = held(sensors="rtk")
    craft.command(WINCH, 1.0, LENGTH, 0.6, 0.3)
    load, _ = reeled(craft, 7.0)
    assert load < 0.06  # measured 25 mm, as in hover
    assert craft.flight.cable.length_m == pytest.approx(true_length(craft), abs=LENGTH_M)


def test_a_mission_lowers_its_load_by_the_winch() -> None:
    craft = Craft(
        Takeoff(1.5), Waypoint(0.5, 0.0, 1.5, 0.5), Winch(0.6, 0.25), Delay(0.5), Winch(-0.6), Land()
    )
    craft.begin()
    lowest = 9.0

    def watched(c: Craft) -> bool:
        nonlocal lowest
        if c.flight.phase == Phase.MISSION:
            lowest = min(lowest, c.truth.x_load[2])
        return c.flight.phase == Phase.DISARMED

    craft.tick()
    craft.run(at_phase(Phase.MISSION))
    refused = craft.command(mavlink.MAV_CMD_DO_WINCH, 1.0, mavlink.WINCH_RELATIVE_LENGTH_CONTROL, 0.1)
    assert refused == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    craft.tick()
    assert "".join(craft.texts).endswith("Winch denied: pause the mission first")
    craft.run(watched)
    assert lowest == pytest.approx(0.9, abs=0.01)
    assert craft.flight.mission.done
    assert true_length(craft) == pytest.approx(0.7, abs=LENGTH_M)
    reached = [m.seq for m in craft.heard if m.get_type() == "MISSION_ITEM_REACHED"]
    assert reached == [0, 1, 2, 3, 4, 5]
