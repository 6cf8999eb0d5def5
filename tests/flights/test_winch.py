"""The winch in flight: the vehicle stays, the load moves, belief and truth of the cable's length agree."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from autopilot.core.winch import cable_now, commanded_rate
from autopilot.guidance.legs import Hold, Reel, Slow, reel_leg, top_of
from autopilot.services.requests import Orbit, Pause, Release, StartMission
from autopilot.services.requests import Winch as WinchRequest
from autopilot.supervisor.advance import enter
from autopilot.supervisor.state import Flight, Phase
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import Delay, Land, Takeoff, Waypoint, Winch
from tests.doubles.craft import Craft, at_phase
from tests.doubles.sky import ACCEPTED, SETTINGS, Sky

WINCH, TAKEOFF, ARM = 42600, 22, 400
DENIED, LATER = mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
LENGTH, HOLD, RETRACT = 1.0, 5.0, 6.0
# worst while reeling at 0.3 m/s and 0.3 m/s^2; measured: vehicle 4.6 mm, load 4.6 mm, and 5.6 mm of each with
# 12 ms of delay and 30 ms of lag; both hover to 3 mm
OFF_M = 0.012
SLOW_ROTORS = {"SIM_ACT_DELAY_MS": 12.0, "SIM_ROTOR_TAU_MS": 30.0}
# of the length at its end: what float32 leaves of the rate; measured 3e-9
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
    return craft.simulator._core.cable_length


def reeled(craft: Craft, seconds: float) -> tuple[float, float]:
    """Fly on; how far at worst the load was from where it is asked to be, the vehicle from where it was."""
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
    estimate = craft.onboard._state.estimator.load
    assert estimate.length == pytest.approx(0.6, abs=0.003)


def test_with_another_length_it_is_carried_landed_and_lifted_again() -> None:
    craft = held()
    craft.command(WINCH, 1.0, LENGTH, 0.5, 0.3)
    craft.wait(6.0)
    place = (craft.truth.x_load[0], craft.truth.x_load[1])
    assert craft.command(21) == ACCEPTED
    craft.run(at_phase(Phase.DISARMED))
    assert "Landed, disarmed" in craft.texts
    # beside the load by half of the cable as it is
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
    assert 0.31 < true_length(craft) < 0.5  # two seconds of stopping behind two of getting under way
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
    craft.run(lambda c: c.flight.phase == Phase.MISSION)
    craft.run(watched)
    assert lowest == pytest.approx(0.9, abs=0.01)
    assert craft.flight.mission.done
    assert true_length(craft) == pytest.approx(0.7, abs=LENGTH_M)
    reached = [m.seq for m in craft.heard if m.get_type() == "MISSION_ITEM_REACHED"]
    assert reached == [0, 1, 2, 3, 4, 5]


# ---- what is refused, and what a leg is


def over(sky: Sky, usable: bool) -> Sky:
    """The same in which the law can, or cannot, fly another length of the cable."""
    sky.settings = replace(sky.settings, winch=replace(sky.settings.winch, usable=usable))
    return sky


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        (WinchRequest(3.0), "a cable of 3.70 m; must be 0.3 ... 3 m (WNC_LEN_MIN, WNC_LEN_MAX)"),
        (WinchRequest(-0.5), "a cable of 0.20 m; must be 0.3 ... 3 m (WNC_LEN_MIN, WNC_LEN_MAX)"),
        (WinchRequest(1.8), "load height 0.20 m, least 0.3 m"),
        (WinchRequest(0.5, 0.4), "0.40 m/s; must be 0.01 ... 0.3 m/s (WNC_SPEED)"),
    ],
)
def test_what_the_winch_cannot_do_is_denied_with_the_limit(request_: WinchRequest, text: str) -> None:
    verdict = Sky().airborne().ask(request_)
    assert (verdict.result, verdict.text) == (DENIED, f"Winch denied: {text}")


def test_the_winch_wants_a_load_that_is_held_in_the_air() -> None:
    sky = Sky()
    assert sky.ask(WinchRequest(0.5)).result == LATER
    sky.airborne()
    for phase in (Phase.RETURN, Phase.LOWER, Phase.SET_DOWN):
        held_there = sky.flight
        sky.flight = enter(sky.flight, phase, sky.view, sky.settings)
        assert sky.ask(WinchRequest(0.5)).result == LATER, phase
        sky.flight = held_there
    assert over(sky, usable=False).ask(WinchRequest(0.5)).result == DENIED
    over(sky, usable=True).ask(Release())
    assert sky.ask(WinchRequest(0.5)).result == DENIED


def test_out_without_end_the_load_stays_above_the_ground() -> None:
    sky = Sky().airborne()
    verdict = sky.ask(WinchRequest(math.inf, 0.2))
    assert verdict.text == "Winch: 0.70 m to 2.40 m"
    assert sky.flight.legs[0].jet(1e3)[0][2] == pytest.approx(0.3, abs=1e-12)


def test_a_mission_that_reels_too_far_is_denied_at_its_start() -> None:
    sky = Sky(Takeoff(9.0), Winch(1.0), Winch(1.5), Land()).airborne()
    verdict = sky.ask(StartMission(0))
    assert verdict.result == DENIED
    assert "item 2: a cable of 3.20 m" in str(verdict.text)


def test_a_mission_paused_while_reeling_goes_on_to_the_same_length() -> None:
    sky = Sky(Takeoff(2.0), Winch(0.8), Delay(1.0), Land()).airborne()

    def tick(seconds: float) -> None:
        for _ in range(round(seconds / 0.02)):
            sky.tick()
            sky.flight = cable_now(sky.flight, sky.now_us)
            length = sky.flight.cable.length_m or 0.7
            sky.settings = replace(sky.settings, cable_length_m=length)

    assert sky.ask(StartMission(1)).result == ACCEPTED
    tick(2.5)
    assert sky.ask(Pause()).result == ACCEPTED
    tick(4.0)
    paused = sky.flight.cable.length_m
    assert paused is not None
    assert 0.75 < paused < 1.4
    assert sky.flight.cable.reel_rate == 0.0
    assert sky.ask(StartMission(None)).result == ACCEPTED
    tick(7.0)
    assert sky.flight.cable.length_m == pytest.approx(1.5, abs=1e-9)


@pytest.mark.parametrize(("wanted", "speed"), [(1.9, 0.3), (0.75, 0.3), (0.4, 0.05), (0.7005, 0.3)])
def test_a_reel_keeps_to_rate_and_acceleration(wanted: float, speed: float) -> None:
    leg = reel_leg((1.0, 2.0, 3.0), 0.7, wanted, speed, 0.3)
    t = np.linspace(0.0, leg.duration_s, 2001)
    jets = np.array([leg.jet(float(s)) for s in t])
    assert leg.jet(0.0)[0] == (1.0, 2.0, 3.0)
    assert leg.end == pytest.approx((1.0, 2.0, 3.7 - wanted), abs=1e-12)
    assert jets[-2, 0] == pytest.approx(leg.end, abs=1e-6)
    assert np.abs(jets[:, 1, 2]).max() <= speed * (1.0 + 1e-9)
    assert np.abs(jets[:, 2, 2]).max() <= 0.3 * 1.001
    assert np.abs(jets[:, :, :2] - jets[0, :, :2]).max() == 0.0


def test_the_length_is_that_of_the_leg_also_while_it_is_stopped() -> None:
    leg = Reel((0.0, 0.0, 2.0), 2.7, 0.3, 1.0, 2.0)
    flight = Flight(phase=Phase.HOLD, legs=(leg,), leg_start_us=0)
    assert cable_now(flight, 2_000_000).cable.length_m == pytest.approx(0.7 + 0.3 * 1.5)
    assert cable_now(flight, 2_000_000).cable.reel_rate == 0.3
    assert commanded_rate(flight, 2_000_000, 0.004) == 0.3
    stopping = Slow(leg, 2.0, 1.0)
    assert top_of(stopping) == 2.7
    stopped = cable_now(replace(flight, legs=(stopping,)), 1_000_000)
    assert stopped.cable.length_m == pytest.approx(0.7 + 0.3 * 2.0)
    assert stopped.cable.reel_rate == 0.0
    resting = replace(flight, legs=(Hold((0.0, 0.0, 2.0)),))
    assert commanded_rate(resting, 0, 0.004) == 0.0
    assert SETTINGS.winch.longest_m == 3.0


def test_while_the_winch_works_no_stream_takes_over() -> None:
    sky = Sky().airborne()
    assert sky.ask(WinchRequest(0.8)).result == ACCEPTED
    sky.wait(2.0)
    verdict = sky.ask(Orbit(2.0, 1.0, None, None, None))
    assert (verdict.result, verdict.text) == (LATER, "Orbit denied while the winch works")
    sky.wait(6.0)
    assert sky.ask(Orbit(2.0, 1.0, None, None, 2.0)).result == ACCEPTED
