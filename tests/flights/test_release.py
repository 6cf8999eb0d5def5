"""The load released in flight and on the ground: by command and by mission, in the simulated world."""

from __future__ import annotations

import math

import pytest

from autopilot.onboard.snapshot import landed_state, sub_mode
from autopilot.services.identity import AUTO_MISSION
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import Delay, Land, PlaceLoad, Speed, Takeoff, Waypoint
from missions.model import Release as ReleaseStep
from tests.doubles.craft import Craft, at_phase
from tests.doubles.sky import ACCEPTED

GRIPPER, TAKEOFF, ARM, PAUSE_CONTINUE, RETURN, LAND = 211, 22, 400, 193, 20, 21
DENIED = mavlink.MAV_RESULT_DENIED
# The load's weight, a fifth of the total, vanishes in an instant; measured: 3 mm, and 6 mm
JUMP_M = 0.01
SLOW_ROTORS = {"SIM_ACT_DELAY_MS": 12.0, "SIM_ROTOR_TAU_MS": 30.0}
SLOW_JUMP_M = 0.015
STEADY_M = 0.02  # of the vehicle, some seconds later; measured 2 mm


def held(sensors: str = "lab", **settings_: float) -> Craft:
    """A craft that holds its load at 1.5 m."""
    craft = Craft(sensors=sensors, **settings_)
    craft.wait(1.0)
    assert craft.command(ARM, 1.0) == ACCEPTED
    assert craft.command(TAKEOFF, 0.0, 0.0, 0.0, 0.0, math.nan, math.nan, 1.5) == ACCEPTED
    craft.run(at_phase(Phase.HOLD))
    craft.wait(3.0)
    return craft


def landed(craft: Craft) -> None:
    craft.run(at_phase(Phase.DISARMED), 30.0)
    assert "Landed, disarmed" in craft.texts
    craft.wait(0.5)
    assert craft.truth.vehicle_on_ground == craft.truth.load_on_ground == 1.0


@pytest.mark.parametrize(("settings_", "jump"), [({}, JUMP_M), (SLOW_ROTORS, SLOW_JUMP_M)])
def test_the_vehicle_stays_where_it_was_and_the_load_falls(settings_: dict[str, float], jump: float) -> None:
    craft = held(**settings_)
    before = craft.truth
    assert craft.command(GRIPPER, 1.0, 0.0) == ACCEPTED
    assert "Load released" in craft.texts
    assert craft.flight.phase == Phase.HOLD
    away = 0.0
    end = craft.onboard.now_us + 3_000_000
    while craft.onboard.now_us < end:
        craft.tick()
        assert craft.truth.tension == 0.0 or craft.truth.taut == 1.0
        away = max(away, math.dist(craft.truth.x_quad, before.x_quad))
    assert 0.0 < away < jump
    assert math.dist(craft.truth.x_quad, before.x_quad) < STEADY_M
    # straight down, except for its speed at the release: millimetres a second
    assert craft.truth.x_load == pytest.approx((before.x_load[0], before.x_load[1], 0.02), abs=0.03)
    assert (craft.truth.taut, craft.truth.tension) == (0.0, 0.0)
    # the estimate follows the load down
    assert craft.estimate.load.x_load == pytest.approx(craft.truth.x_load, abs=0.005)
    assert craft.estimate.load.taut == 0.0


def test_alone_it_takes_a_place_returns_and_lands_clear_of_the_load() -> None:
    craft = held()
    craft.command(GRIPPER, 1.0, 0.0)
    craft.wait(1.0)
    start = craft.truth.x_quad
    north = 47.3977420 + 2.0 / 111_319.5
    place = mavlink.MAVLink_command_int_message(
        1, 1, 6, 192, 0, 0, -1.0, 1.0, 0.0, math.nan, round(north * 1e7), round(8.5455940 * 1e7), 3.0
    )
    craft.send(place)
    craft.tick()
    assert craft.results(192) == [ACCEPTED]
    craft.wait(8.0)
    assert math.dist(craft.truth.x_quad, start) > 1.5
    assert craft.truth.x_quad[2] == pytest.approx(3.0, abs=STEADY_M)
    assert craft.command(20) == ACCEPTED
    landed(craft)
    # home is where the load lies
    apart = math.dist(craft.truth.x_quad[:2], craft.truth.x_load[:2])
    assert 0.3 < apart < 0.4


def test_taken_up_again_on_the_ground_the_load_flies_again() -> None:
    craft = held()
    craft.command(GRIPPER, 1.0, 0.0)
    assert craft.command(GRIPPER, 1.0, 1.0) == DENIED
    assert any("on the ground only" in text for text in craft.texts)
    assert craft.command(21) == ACCEPTED
    landed(craft)
    assert craft.command(GRIPPER, 1.0, 1.0) == ACCEPTED
    craft.command(ARM, 1.0)
    craft.command(TAKEOFF, 0.0, 0.0, 0.0, 0.0, math.nan, math.nan, 1.0)
    craft.run(at_phase(Phase.HOLD))
    craft.wait(2.0)
    assert craft.truth.taut == 1.0
    assert craft.truth.x_load[2] == pytest.approx(1.0, abs=0.02)


def test_released_on_the_ground_the_vehicle_takes_off_alone() -> None:
    craft = Craft()
    craft.wait(1.0)
    assert craft.command(GRIPPER, 1.0, 0.0) == ACCEPTED
    craft.command(ARM, 1.0)
    craft.command(TAKEOFF, 0.0, 0.0, 0.0, 0.0, math.nan, math.nan, 2.0)
    craft.run(at_phase(Phase.HOLD))
    craft.wait(2.0)
    assert craft.truth.x_quad[2] == pytest.approx(2.0, abs=STEADY_M)
    assert craft.truth.load_on_ground == 1.0


def test_with_receiver_and_camera_the_vehicle_flies_on_as_well() -> None:
    """A load that no sensor sees is assumed to lie under the place of its release."""
    craft = held("rtk")
    craft.command(GRIPPER, 1.0, 0.0)
    before = craft.truth.x_quad
    craft.wait(4.0)
    assert math.dist(craft.truth.x_quad, before) < 0.15  # the accuracy of the receiver; measured 0.05
    assert craft.estimate.load.x_load[2] < 0.3
    assert craft.command(21) == ACCEPTED
    landed(craft)


DELIVERY = (
    Takeoff(1.0),
    Waypoint(1.0, 0.5, 0.5, 0.5),
    ReleaseStep(),
    Waypoint(1.0, 0.5, 1.5),
    Delay(1.0),
    Land(),
)


def test_a_mission_delivers_and_lands_beside_what_it_delivered() -> None:
    craft = Craft(*DELIVERY)
    craft.begin()
    craft.run(lambda c: c.flight.cable.released)
    assert craft.flight.mission.active
    landed(craft)
    assert craft.flight.mission.done
    assert craft.truth.x_load == pytest.approx((1.0, 0.5, 0.02), abs=0.03)
    assert 0.3 < math.dist(craft.truth.x_quad[:2], (1.0, 0.5)) < 0.4
    reached = [m.seq for m in craft.heard if m.get_type() == "MISSION_ITEM_REACHED"]
    assert sorted(set(reached)) == [0, 1, 2, 3, 4, 5]
    assert craft.texts.count("Load released") == 1


PLACING = (
    Takeoff(1.0),
    Waypoint(1.0, 0.5, 1.0),
    PlaceLoad(),
    Waypoint(1.0, 0.5, 2.0),
    Land(),
)


@pytest.mark.parametrize("sensors", ["lab", "gps", "lab-blind"])
def test_a_mission_places_its_load_on_the_ground_and_flies_on(sensors: str) -> None:
    craft = Craft(*PLACING, sensors=sensors)
    craft.begin()
    craft.run(at_phase(Phase.LOWER), 60.0)
    assert sub_mode(craft.flight) == AUTO_MISSION
    assert landed_state(craft.flight) == mavlink.MAV_LANDED_STATE_IN_AIR
    craft.run(lambda c: c.flight.cable.released, 60.0)
    assert craft.truth.load_on_ground == 1.0
    assert math.hypot(*craft.truth.v_load) < 0.02, "it lies before it is released"
    placed = craft.truth.x_load
    craft.run(at_phase(Phase.DISARMED), 90.0)
    assert craft.flight.mission.done
    assert math.dist(craft.truth.x_load, placed) < 0.01
    reached = [m.seq for m in craft.heard if m.get_type() == "MISSION_ITEM_REACHED"]
    assert sorted(set(reached)) == [0, 1, 2, 3, 4]
    assert [text for text in craft.texts if text.startswith("Load")] == [
        "Load on the ground",
        "Load released",
    ]


def test_placing_is_paused_and_continued_and_given_up_for_a_return() -> None:
    craft = Craft(*PLACING)
    craft.begin()
    craft.run(at_phase(Phase.LOWER), 60.0)
    craft.wait(1.0)
    for request, phase in ((0.0, Phase.HOLD), (1.0, Phase.LOWER)):
        assert craft.command(PAUSE_CONTINUE, request) == ACCEPTED
        craft.wait(2.0)
        assert craft.flight.phase == phase
    assert craft.command(RETURN) == ACCEPTED
    craft.run(at_phase(Phase.DISARMED), 90.0)
    assert not craft.flight.cable.released
    assert math.hypot(*craft.truth.x_load[:2]) < 0.05, "it came home"


def test_a_landing_asked_for_while_the_load_is_placed_ends_the_flight_beside_it() -> None:
    craft = Craft(*PLACING)
    craft.begin()
    craft.run(at_phase(Phase.LOWER), 60.0)
    assert craft.command(LAND) == ACCEPTED
    craft.run(at_phase(Phase.DISARMED), 90.0)
    assert not craft.flight.cable.released
    assert math.dist(craft.truth.x_load[:2], (1.0, 0.5)) < 0.05


def test_a_delivered_load_stays_where_it_was_seen_best() -> None:
    """Readings from afar, good to half a metre, moved it by 0.3 m."""
    craft = Craft(
        Takeoff(1.0),
        ReleaseStep(),
        Speed(4.0),
        Waypoint(0.0, 0.0, 15.0),
        Waypoint(20.0, 0.0, 15.0),
        sensors="rtk",
    )
    craft.begin()
    craft.run(lambda c: c.truth.x_quad[2] > 5.0)
    seen_m = math.dist(craft.estimate.load.x_load[:2], craft.truth.x_load[:2])
    craft.run(lambda c: c.truth.x_quad[0] > 19.0, 60.0)
    assert math.dist(craft.estimate.load.x_load[:2], craft.truth.x_load[:2]) == seen_m
