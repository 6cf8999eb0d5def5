"""Slack cables: tautened gently at take-off, caught in the air, and the stops that used to cause them."""

from __future__ import annotations

import math

import pytest

from autopilot.geometry.linear import norm
from autopilot.supervisor.state import Phase
from autopilot.wire.dialect import plumbline as mavlink
from gcs.closed_loop import Conditions
from gcs.sweep.flight import fly, start_times
from missions.fileformat import load_mission
from missions.model import Delay, Land, Signals, Sine, Takeoff, Term
from tests.doubles.craft import Craft, at_phase
from tests.doubles.sky import SETTINGS

PLUMBLINE = {"CTL_LAW": 2.0}
HIGH = (Takeoff(5.0), Delay(60.0), Land())


def snaps(craft: Craft, until, limit_s: float = 60.0) -> list[float]:
    """Closing speeds (m/s) of every snap until a condition holds."""
    found = []
    end = craft.onboard.now_us + round(limit_s * 1e6)
    while not until(craft):
        craft.tick()
        assert craft.onboard.now_us < end, craft.texts
        if craft.world.snap_speed > 1e-3:
            found.append(craft.world.snap_speed)
    return found


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("limit", [0.05, 0.25])
def test_the_cable_comes_taut_no_faster_than_the_parameter_says(limit: float, seed: int) -> None:
    craft = Craft(Takeoff(2.0), Delay(1.0), Land(), seed=seed, MIS_SNAP_SPEED=limit, **PLUMBLINE)
    craft.begin()
    found = snaps(craft, lambda c: c.flight.phase == Phase.MISSION)
    # measured 0.051 and 0.151 m/s (the creep of MIS_TAUT_SPEED): the vehicle's climb varies by its noise
    assert 0.0 < max(found) < min(limit, SETTINGS.motion.taut_speed_m_s) + 0.02
    assert snaps(craft, at_phase(Phase.DISARMED)) == [], "nor does landing snap"


@pytest.mark.parametrize("true_m", [0.64, 0.68, 0.735])
def test_a_cable_that_is_not_as_long_as_assumed_is_lifted_and_set_down(true_m: float) -> None:
    """Within 9 % of the assumed 0.70 m; up to 0.689 m the take-off once ended before the load was lifted."""
    mission, conditions = load_mission("hover"), Conditions(seed=2, settings={"SIM_CABLE_LEN": true_m})
    result = fly(mission, conditions, start_times(mission, Conditions()))
    assert (result.outcome, result.reason, result.slack_events) == ("completed", "", 0)
    assert result.load_error_max_m < 0.01  # measured 3.2 to 4.0 mm


# With the assumed mass alone, 5 of 8 flights with 0.32 kg and rtk were lost, and all with 0.48 kg, for a true
# mass of 0.4 kg: what the cable seemed to pull was wrong by 0.8 of the load's weight.
@pytest.mark.parametrize("assumed_kg", [0.32, 0.48])
@pytest.mark.parametrize(("sensors", "seeds", "error_m"), [("lab", (1,), 0.008), ("rtk", (1, 2, 3, 4), 0.06)])
def test_a_vehicle_that_is_not_as_heavy_as_assumed_lifts_its_load(
    sensors: str, seeds: tuple[int, ...], error_m: float, assumed_kg: float
) -> None:
    mission, settings = load_mission("hover"), {"VEH_QUAD_MASS": assumed_kg}
    start = start_times(mission, Conditions(sensors=sensors))
    for seed in seeds:
        result = fly(mission, Conditions(sensors=sensors, seed=seed, settings=settings), start)
        assert (result.outcome, result.reason) == ("completed", "")
        assert "Cable slack, the load is not lifted: pulling it taut again" not in result.texts
        assert result.load_error_max_m < error_m  # measured 5 mm and 35 mm


def kicked(sensors: str, speed: float) -> tuple[Craft, float]:
    """Strike a load that hangs at 5 m upwards; return the craft seconds later, and the hardest snap."""
    craft = Craft(*HIGH, sensors=sensors, **PLUMBLINE)
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    craft.wait(2.0)
    core = craft.world
    up = core.state.v_load[2] + speed
    core.state = core.state._replace(v_load=(0.0, 0.0, up), taut=0.0)
    end = craft.onboard.now_us + 6_000_000
    hardest = max(snaps(craft, lambda c: c.onboard.now_us >= end))
    return craft, hardest


# measured with the catch: 1.01, 1.33 and 1.88 m/s; without it 2.9 and 2.3 m/s, and the last flight is lost
CAUGHT = [("ideal", 2.0, 1.3), ("lab", 2.0, 1.7), ("lab", 3.0, 2.3)]


@pytest.mark.parametrize(("sensors", "speed", "most"), CAUGHT)
def test_a_load_that_flies_free_is_caught(sensors: str, speed: float, most: float) -> None:
    craft, hardest = kicked(sensors, speed)
    assert "Load caught" in craft.texts
    assert not any("again" in text or "ground" in text for text in craft.texts)
    assert hardest < most
    assert craft.flight.phase == Phase.MISSION
    craft.run(lambda c: c.flight.phase == Phase.MISSION and norm(c.truth.v_load) < 0.02, 20.0)
    assert craft.truth.x_load[2] > 2.0  # measured 3.0 m


EIGHT = Signals(
    12.0,
    (
        Term("y", 1.0, 0.0, 3.0, 6.0, 3.0, (Sine(3.0),)),
        Term("z", 0.15, 0.0, 3.0, 6.0, 3.0, (Sine(1.5),)),
    ),
)


@pytest.mark.parametrize("after_s", [5.0, 5.4, 5.8])
def test_a_hold_in_full_flight_stops_along_the_path(after_s: float) -> None:
    craft = Craft(Takeoff(2.0), EIGHT, Land(), **PLUMBLINE)
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    craft.wait(after_s)
    fast = norm(craft.truth.v_load)
    assert craft.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == 0
    worst, jet = 0.0, None
    while len(craft.flight.legs) > 1 or norm(jet[1]) > 0.0:
        craft.tick()
        assert craft.flight.phase == Phase.HOLD, craft.texts
        jet = craft.flight.legs[0].jet((craft.onboard.now_us - craft.flight.leg_start_us) * 1e-6)
        worst = max(worst, math.dist(jet[0], craft.truth.x_load))
    assert fast > 0.5
    # measured 19 mm over the same stops in Case C; formerly, 6.7 m/s was commanded, and the flight lost
    assert worst < 0.04


def test_a_load_on_the_ground_is_no_slack_to_catch() -> None:
    craft = Craft(Takeoff(2.0), Delay(1.0), Land(), **PLUMBLINE)
    craft.begin()
    craft.run(at_phase(Phase.DISARMED), 60.0)
    assert not any("slack" in text.lower() for text in craft.texts)


@pytest.mark.parametrize("speed", [1.0, 3.0])
def test_of_a_load_that_no_tracker_sees_a_cable_that_is_slack_for_a_moment_is_not_noticed(
    speed: float,
) -> None:
    """The vehicle used to dive after a load of which it does not know where it is: snaps of up to 4 m/s,
    and the mission was interrupted."""
    craft, hardest = kicked("rtk", speed)
    assert hardest < speed
    assert not any("slack" in text.lower() for text in craft.texts)
    assert craft.flight.phase == Phase.MISSION
    craft.run(lambda c: norm(c.truth.v_load) < 0.05, 20.0)
    assert craft.truth.x_load[2] == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize("seed", [24, 39, 120, 136, 173])
def test_a_gust_that_hides_or_imitates_the_pull_of_the_load_makes_no_vehicle_dive(seed: int) -> None:
    """Gusts of 3 m/s around 5 m/s: of 200 such flights, six used to be lost and eight dived after a load that
    hung on the cable, or lay on the ground and was taken for one that hung."""
    mission = load_mission("case-b")
    gusts = {"SIM_WIND_E": 5.0, "SIM_GUST_STD": 3.0, "MIS_INFEASIBLE": 1.0}
    conditions = Conditions(sensors="rtk", seed=seed, settings=gusts)
    flown = fly(mission, conditions, start_times(mission, conditions))
    assert not any("falling" in text for text in flown.texts)
    assert flown.outcome == "completed"
    assert flown.load_error_max_m < 0.3  # of those that dived up to 2 m
