"""The winch: what is refused, with the limit, and the cable length that follows from a leg."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from autopilot.core.flight_core import commanded_rate, with_cable_now
from autopilot.guidance.legs import Hold, PathStop, Reel, winch_hold_height
from autopilot.services.requests import Orbit, Pause, Release, StartMission
from autopilot.services.requests import Winch as WinchRequest
from autopilot.supervisor.state import Flight, Phase, leg_time_s
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import Delay, Land, Takeoff, Winch
from tests.doubles.sky import ACCEPTED, Sky, entered

DENIED, LATER = mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def over(sky: Sky, problem: str) -> Sky:
    """The same sky; its law can, or cannot, fly with another cable length."""
    sky.settings = replace(sky.settings, winch=replace(sky.settings.winch, problem=problem))
    return sky


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        (WinchRequest(3.0), "a cable of 3.70 m; must be 0.3 ... 3 m (WNC_LEN_MIN, WNC_LEN_MAX)"),
        (WinchRequest(-0.5), "a cable of 0.20 m; must be 0.3 ... 3 m (WNC_LEN_MIN, WNC_LEN_MAX)"),
        (WinchRequest(1.8), "load height 0.20 m, min 0.3 m"),
        (WinchRequest(0.5, 0.4), "rate 0.40 m/s; must be 0.01 ... 0.3 m/s (WNC_SPEED)"),
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
        sky.flight = entered(sky.flight, phase, sky.view, sky.settings)
        assert sky.ask(WinchRequest(0.5)).result == LATER, phase
        sky.flight = held_there
    verdict = over(sky, "the law x flies one length of the cable").ask(WinchRequest(0.5))
    assert (verdict.result, verdict.text) == (DENIED, "Winch denied: the law x flies one length of the cable")
    over(sky, "").ask(Release())
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
            sky.flight = with_cable_now(sky.flight, sky.now_us)
            length = sky.flight.cable.length_m or 0.7
            sky.settings = replace(sky.settings, cable_length_m=length)

    assert sky.ask(StartMission(1)).result == ACCEPTED
    tick(2.3)
    assert sky.ask(Pause()).result == ACCEPTED
    tick(4.0)
    paused = sky.flight.cable.length_m
    assert paused is not None
    assert 0.75 < paused < 1.4
    assert sky.flight.cable.reel_rate == 0.0
    assert [text for text in sky.texts if "Winch" in text] == [f"Winch stopped at {paused:.2f} m"]
    assert sky.ask(StartMission(None)).result == ACCEPTED
    tick(7.0)
    assert sky.flight.cable.length_m == pytest.approx(1.5, abs=1e-9)
    assert len([text for text in sky.texts if "Winch" in text]) == 1


def test_the_length_is_that_of_the_leg_also_while_it_is_stopped() -> None:
    leg = Reel((0.0, 0.0, 2.0), 2.7, 0.3, 1.0, 2.0)
    flight = Flight(phase=Phase.HOLD, legs=(leg,), leg_start_us=0)
    assert with_cable_now(flight, 2_000_000).cable.length_m == pytest.approx(0.7 + 0.3 * 1.5)
    assert with_cable_now(flight, 2_000_000).cable.reel_rate == 0.3
    assert commanded_rate(flight, 2_000_000, 0.004) == 0.3
    stopping = PathStop(leg, 2.0, 1.0)
    assert winch_hold_height(stopping) == 2.7
    stopped = with_cable_now(replace(flight, legs=(stopping,)), 1_000_000)
    assert stopped.cable.length_m == pytest.approx(0.7 + 0.3 * 2.0)
    assert stopped.cable.reel_rate == 0.0
    resting = replace(flight, legs=(Hold((0.0, 0.0, 2.0)),))
    assert commanded_rate(resting, 0, 0.004) == 0.0


def test_while_the_winch_works_no_stream_takes_over() -> None:
    sky = Sky().airborne()
    assert sky.ask(WinchRequest(0.8)).result == ACCEPTED
    sky.wait(2.0)
    verdict = sky.ask(Orbit(2.0, 1.0, None, None, None))
    assert (verdict.result, verdict.text) == (LATER, "Orbit denied while the winch works")
    sky.wait(6.0)
    assert sky.ask(Orbit(2.0, 1.0, None, None, 2.0)).result == ACCEPTED


def test_it_is_not_reeled_once_a_mission_waits_to_begin() -> None:
    sky = Sky(Takeoff(2.0), Delay(5.0), Land()).airborne()
    sky.flight = replace(sky.flight, mission=replace(sky.flight.mission, waiting=True))
    verdict = sky.ask(WinchRequest(0.8))
    assert (verdict.result, verdict.text) == (LATER, "Winch denied: pause the mission first")


def test_nor_while_it_waits_for_the_load_to_come_to_rest() -> None:
    sky = Sky().airborne()
    assert sky.ask(Orbit(2.0, 1.0, None, None, None)).result == ACCEPTED
    sky.wait(6.0)
    assert sky.ask(Pause()).result == ACCEPTED
    assert sky.ask(WinchRequest(0.8)).result == ACCEPTED
    sky.tick()
    assert isinstance(sky.flight.legs[-2], Reel) and len(sky.flight.legs) > 2
    verdict = sky.ask(Orbit(2.0, 1.0, None, None, None))
    assert (verdict.result, verdict.text) == (LATER, "Orbit denied while the winch works")


def test_a_request_that_is_repeated_does_not_begin_the_wait_anew() -> None:
    sky = Sky().airborne()
    assert sky.ask(Orbit(2.0, 1.0, None, None, None)).result == ACCEPTED
    sky.wait(6.0)
    assert sky.ask(Pause()).result == ACCEPTED

    def wait_s() -> float:
        stop = sky.flight.legs[:-2]
        return sum(leg.duration_s for leg in stop) - leg_time_s(sky.flight, sky.now_us)

    begun_us, waits, places = sky.now_us, [], []
    for _ in range(6):
        verdict = sky.ask(WinchRequest(0.8))
        assert verdict.text == "Winch: 0.70 m to 1.50 m, when the load is at rest"
        waits.append(wait_s() + (sky.now_us - begun_us) * 1e-6)
        places.append(sky.flight.legs[-2].jet(0.0)[0])
        sky.wait(0.52)
    assert waits == pytest.approx([waits[0]] * 6, abs=2e-5)
    assert np.ptp(places, axis=0) == pytest.approx([0.0] * 3, abs=1e-9)
